-- Schema version 6. Sessions whose trainee the server did not know when they came: a station without its server takes any name.
-- They wait for a manager to assign them to the right person. A session is nobody's (no row) with an empty name or as 'guest'.
CREATE TABLE unknown_trainees (
  session          INTEGER PRIMARY KEY REFERENCES sessions (number),
  given            TEXT NOT NULL,   -- the name that the station gave; a station that asks again still gives it
  by_whom          TEXT,            -- the manager who assigned it; NULL: it waits
  assigned_unix_ns INTEGER,
  CHECK ((by_whom IS NULL) = (assigned_unix_ns IS NULL))
) STRICT;
CREATE INDEX unknown_trainees_waiting ON unknown_trainees (session) WHERE by_whom IS NULL;
-- those of before
INSERT INTO unknown_trainees (session, given)
  SELECT number, trainee FROM sessions
  WHERE erased = 0 AND trainee NOT IN ('', 'guest') AND trainee NOT IN (SELECT name FROM people);
