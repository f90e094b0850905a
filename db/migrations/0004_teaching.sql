-- Schema version 4. Who learns what and how far they are: groups, courses with dates and attempts, assignments, scores by version
-- of their definitions, references, consent to studies, erasure. Times are ns since 1970 (UTC): a due date has no time zone.

-- Assignments first: they refer to people, who follow. Exactly one of course and exercise, and one of group and trainee; each
-- pair once, whichever the columns that are NULL.
CREATE TABLE assignments_4 (
  id              INTEGER PRIMARY KEY AUTOINCREMENT,   -- never used again
  course_id       TEXT,
  exercise_id     TEXT,
  group_id        TEXT,
  trainee         TEXT,
  due_unix_ns     INTEGER,                             -- NULL: never
  by_whom         TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  CHECK ((course_id IS NULL) <> (exercise_id IS NULL)),
  CHECK ((group_id IS NULL) <> (trainee IS NULL))
) STRICT;
INSERT INTO assignments_4 (exercise_id, trainee, by_whom, created_unix_ns)
  SELECT exercise_id, trainee, by_whom, created_unix_ns FROM assignments ORDER BY created_unix_ns, trainee, exercise_id;
DROP TABLE assignments;
ALTER TABLE assignments_4 RENAME TO assignments;
CREATE UNIQUE INDEX assignments_once ON assignments
  (coalesce(course_id, ''), coalesce(exercise_id, ''), coalesce(group_id, ''), coalesce(trainee, ''));
CREATE INDEX assignments_by_trainee ON assignments (trainee);
CREATE INDEX assignments_by_group ON assignments (group_id);

-- role: needlelab.pb.Role: 5 is the stations', 6 a researcher. revision: of what can be changed of a person; password and
-- consent are not part of it.
CREATE TABLE people_4 (
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  role            INTEGER NOT NULL CHECK (role BETWEEN 1 AND 6 AND role <> 5),
  password_hash   TEXT,                        -- argon2id; NULL: cannot log in
  disabled        INTEGER NOT NULL DEFAULT 0 CHECK (disabled IN (0, 1)),
  created_unix_ns INTEGER NOT NULL,
  full_name       TEXT NOT NULL DEFAULT '',
  revision        INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1),
  changed_unix_ns INTEGER NOT NULL,
  changed_by      TEXT NOT NULL DEFAULT ''     -- '': as it was made
) STRICT, WITHOUT ROWID;
INSERT INTO people_4 (name, role, password_hash, disabled, created_unix_ns, changed_unix_ns)
  SELECT name, role, password_hash, disabled, created_unix_ns, created_unix_ns FROM people;
DROP TABLE people;
ALTER TABLE people_4 RENAME TO people;

CREATE TABLE groups (
  id              TEXT PRIMARY KEY CHECK (length(id) BETWEEN 1 AND 64),
  name            TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  changed_by      TEXT NOT NULL,
  changed_unix_ns INTEGER NOT NULL,
  removed         INTEGER NOT NULL DEFAULT 0 CHECK (removed IN (0, 1))   -- the row stays, so that its revision goes on
) STRICT, WITHOUT ROWID;
CREATE TABLE group_members (
  group_id TEXT NOT NULL REFERENCES groups (id),
  person   TEXT NOT NULL REFERENCES people (name),
  PRIMARY KEY (group_id, person)
) STRICT, WITHOUT ROWID;
CREATE INDEX group_members_by_person ON group_members (person);

-- What a person said to studies, each time; the last one counts. Never updated.
CREATE TABLE consents (
  id          INTEGER PRIMARY KEY,
  person      TEXT NOT NULL REFERENCES people (name),
  given       INTEGER NOT NULL CHECK (given IN (0, 1)),
  unix_ns     INTEGER NOT NULL,
  recorded_by TEXT NOT NULL,
  note        TEXT NOT NULL
) STRICT;
CREATE INDEX consents_by_person ON consents (person, id);

-- Scores by the version of the definitions (common/scoring) that they were made with. The first one that a session was given,
-- which its trainee saw, stands in sessions.score_json as well, and stays; it is not always the one of the lowest version.
CREATE TABLE scores (
  session            INTEGER NOT NULL REFERENCES sessions (number),
  definition_version INTEGER NOT NULL CHECK (definition_version >= 1),
  measures           TEXT NOT NULL,                     -- JSON rows: measure, value, unit, words, min, max, passed
  passed             INTEGER CHECK (passed IN (0, 1)),  -- all requirements met; NULL: there are none
  first              INTEGER NOT NULL CHECK (first IN (0, 1)),
  engine_version     TEXT NOT NULL,                     -- of the program that scored
  made_unix_ns       INTEGER NOT NULL,
  PRIMARY KEY (session, definition_version)
) STRICT, WITHOUT ROWID;
CREATE UNIQUE INDEX scores_first ON scores (session) WHERE first = 1;
-- those of before are version 1
INSERT INTO scores (session, definition_version, measures, passed, first, engine_version, made_unix_ns)
  SELECT number, 1, score_json,
         CASE WHEN json_valid(score_json) THEN
           (SELECT min(value ->> 'passed') FROM json_each(score_json) WHERE value ->> 'passed' IS NOT NULL) END,
         1, engine_version, coalesce(closed_unix_ns, received_unix_ns)
  FROM sessions WHERE score_json IS NOT NULL;

-- An attempt is a session of its trainee at its exercise; its number is its place by started_unix_ns. passed: of the first score.
ALTER TABLE sessions ADD COLUMN passed INTEGER CHECK (passed IN (0, 1));
UPDATE sessions SET passed = (SELECT passed FROM scores WHERE session = number AND first = 1);
-- 1: it does not count against the attempts
ALTER TABLE sessions ADD COLUMN excused INTEGER NOT NULL DEFAULT 0 CHECK (excused IN (0, 1));
-- 1: of somebody whose data was erased: `trainee` is a pseudonym, also within `description`; what a station still sends of it
-- is acknowledged and not kept.
ALTER TABLE sessions ADD COLUMN erased INTEGER NOT NULL DEFAULT 0 CHECK (erased IN (0, 1));
CREATE INDEX sessions_by_attempt ON sessions (trainee, exercise_id, started_unix_ns);

-- Sessions of experts whose measures make the bands of an exercise. Revisions are never overwritten.
CREATE TABLE exercise_references (
  exercise_id     TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  sessions        TEXT NOT NULL,               -- JSON list of session ids as text
  by_whom         TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (exercise_id, revision)
) STRICT, WITHOUT ROWID;

-- Who was erased: no name. name_hash is keyed with DIR/pseudonym.key, which is in no backup; DIR/erasures holds the same lines,
-- so that a restored backup, which knows the person again, can be told from this one (service/erasure.h).
CREATE TABLE erasures (
  pseudonym       TEXT PRIMARY KEY,
  name_hash       BLOB NOT NULL CHECK (length(name_hash) = 32),
  erased_unix_ns  INTEGER NOT NULL,
  by_whom         TEXT NOT NULL,
  reason          TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- Pieces of an import of everything, until the last one comes.
CREATE TABLE import_pieces (
  import_id   TEXT NOT NULL,
  position    INTEGER NOT NULL,
  records     TEXT NOT NULL,                   -- one a line
  by_whom     TEXT NOT NULL,
  unix_ns     INTEGER NOT NULL,
  PRIMARY KEY (import_id, position)
) STRICT;
