-- Schema version 7. Codes of trainees: a PIN, or what a badge reader types, so that nobody practises as somebody else.
ALTER TABLE people ADD COLUMN code_hash TEXT;   -- argon2id; NULL: no code
-- Why a session waits: 0: nobody had its trainee's name when it came; 1: the account existed, but nobody gave its code.
ALTER TABLE unknown_trainees ADD COLUMN code_unchecked INTEGER NOT NULL DEFAULT 0 CHECK (code_unchecked IN (0, 1));
-- The sessions that count for nobody until a manager assigns them: who gets a name later has none of the sessions that came
-- under it before; and a session without its trainee's code is not the trainee's. Others that wait are listed under their name.
CREATE VIEW uncounted_sessions AS
  SELECT u.session FROM unknown_trainees u JOIN sessions s ON s.number = u.session
  WHERE u.by_whom IS NULL AND (u.code_unchecked = 1 OR EXISTS (SELECT 1 FROM people WHERE name = s.trainee));
