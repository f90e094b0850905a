-- Schema version 5. The counters of open sessions have a table of their own: a chunk that comes in changes a row of some bytes
-- beside its own, and not the session's row, whose profile makes it two pages long.
--
-- Exactly the sessions with state 1 (open) have a row here; sessions.chunks, samples and stored_bytes are 0 meanwhile. The
-- triggers see to that, whoever opens or ends a session: the final numbers go into its row as its state changes.
CREATE TABLE session_progress (
  session      INTEGER PRIMARY KEY REFERENCES sessions (number),
  chunks       INTEGER NOT NULL DEFAULT 0 CHECK (chunks >= 0),
  samples      INTEGER NOT NULL DEFAULT 0 CHECK (samples >= 0),
  stored_bytes INTEGER NOT NULL DEFAULT 0 CHECK (stored_bytes >= 0)
) STRICT;
INSERT INTO session_progress (session, chunks, samples, stored_bytes)
  SELECT number, chunks, samples, stored_bytes FROM sessions WHERE state = 1;
UPDATE sessions SET chunks = 0, samples = 0, stored_bytes = 0 WHERE state = 1;

CREATE TRIGGER sessions_opened AFTER INSERT ON sessions WHEN NEW.state = 1 BEGIN
  INSERT INTO session_progress (session, chunks, samples, stored_bytes)
    VALUES (NEW.number, NEW.chunks, NEW.samples, NEW.stored_bytes);
  UPDATE sessions SET chunks = 0, samples = 0, stored_bytes = 0 WHERE number = NEW.number AND NEW.chunks > 0;
END;
CREATE TRIGGER sessions_ended AFTER UPDATE OF state ON sessions WHEN OLD.state = 1 AND NEW.state <> 1 BEGIN
  UPDATE sessions SET (chunks, samples, stored_bytes) =
      (SELECT p.chunks, p.samples, p.stored_bytes FROM session_progress p WHERE p.session = NEW.number)
    WHERE number = NEW.number AND EXISTS (SELECT 1 FROM session_progress WHERE session = NEW.number);
  DELETE FROM session_progress WHERE session = NEW.number;
END;
