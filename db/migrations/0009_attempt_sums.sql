-- Schema version 9. What the lists of results need, so that they read what they show and not all sessions.

-- What a session adds to the sums of its trainee and exercise. One that counts for nobody (uncounted_sessions) adds itself alone: its
-- trainee is listed all the same.
CREATE VIEW attempt_shares AS
  SELECT session, exercise_id, trainee, attempts, attempts * (1 - excused) AS counted,
    CASE WHEN passed IS NULL THEN 0 ELSE attempts * (1 - excused) END AS judged,
    coalesce(passed, 0) * attempts * (1 - excused) AS passed
  FROM (SELECT s.number AS session, s.exercise_id, s.trainee, s.excused, s.passed,
          CASE WHEN EXISTS (SELECT 1 FROM uncounted_sessions u WHERE u.session = s.number) THEN 0 ELSE 1 END AS attempts
        FROM sessions s WHERE s.trainee <> '' AND s.erased = 0) AS shares;

CREATE TABLE attempt_sums (
  exercise_id TEXT NOT NULL,
  trainee     TEXT NOT NULL,
  sessions    INTEGER NOT NULL,
  attempts    INTEGER NOT NULL,   -- without those that count for nobody
  counted     INTEGER NOT NULL,   -- of these, not excused
  judged      INTEGER NOT NULL,   -- of the counted: with a verdict
  passed      INTEGER NOT NULL,
  PRIMARY KEY (exercise_id, trainee)
) STRICT, WITHOUT ROWID;
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);
INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed)
  SELECT exercise_id, trainee, count(*), sum(attempts), sum(counted), sum(judged), sum(passed) FROM attempt_shares
  GROUP BY exercise_id, trainee;

-- Whatever changes a session's share takes the share from the sums before and adds it after: sign -1, then 1.
CREATE VIEW attempt_steps AS SELECT 0 AS session, 0 AS sign;
CREATE TRIGGER attempt_steps_taken INSTEAD OF INSERT ON attempt_steps BEGIN
  INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed)
    SELECT exercise_id, trainee, NEW.sign, NEW.sign * attempts, NEW.sign * counted, NEW.sign * judged, NEW.sign * passed
    FROM attempt_shares WHERE session = NEW.session
    ON CONFLICT (exercise_id, trainee) DO UPDATE SET sessions = sessions + excluded.sessions,
      attempts = attempts + excluded.attempts, counted = counted + excluded.counted,
      judged = judged + excluded.judged, passed = passed + excluded.passed;
  DELETE FROM attempt_sums WHERE sessions = 0
    AND (exercise_id, trainee) IN (SELECT exercise_id, trainee FROM attempt_shares WHERE session = NEW.session);
END;

CREATE TRIGGER sessions_sum_after_insert AFTER INSERT ON sessions BEGIN
  INSERT INTO attempt_steps VALUES (NEW.number, 1);
END;
CREATE TRIGGER sessions_sum_before_update BEFORE UPDATE OF trainee, exercise_id, excused, passed, erased ON sessions BEGIN
  INSERT INTO attempt_steps VALUES (OLD.number, -1);
END;
CREATE TRIGGER sessions_sum_after_update AFTER UPDATE OF trainee, exercise_id, excused, passed, erased ON sessions BEGIN
  INSERT INTO attempt_steps VALUES (NEW.number, 1);
END;
CREATE TRIGGER sessions_sum_before_delete BEFORE DELETE ON sessions BEGIN
  INSERT INTO attempt_steps VALUES (OLD.number, -1);
END;
-- An INSERT of what is there already may do nothing, but its trigger is run: it must not take the share.
CREATE TRIGGER unknown_trainees_sum_before_insert BEFORE INSERT ON unknown_trainees
  WHEN NOT EXISTS (SELECT 1 FROM unknown_trainees WHERE session = NEW.session) BEGIN
  INSERT INTO attempt_steps VALUES (NEW.session, -1);
END;
CREATE TRIGGER unknown_trainees_sum_after_insert AFTER INSERT ON unknown_trainees BEGIN
  INSERT INTO attempt_steps VALUES (NEW.session, 1);
END;
CREATE TRIGGER unknown_trainees_sum_before_update BEFORE UPDATE OF by_whom, code_unchecked ON unknown_trainees BEGIN
  INSERT INTO attempt_steps VALUES (OLD.session, -1);
END;
CREATE TRIGGER unknown_trainees_sum_after_update AFTER UPDATE OF by_whom, code_unchecked ON unknown_trainees BEGIN
  INSERT INTO attempt_steps VALUES (NEW.session, 1);
END;
CREATE TRIGGER unknown_trainees_sum_before_delete BEFORE DELETE ON unknown_trainees BEGIN
  INSERT INTO attempt_steps VALUES (OLD.session, -1);
END;
CREATE TRIGGER unknown_trainees_sum_after_delete AFTER DELETE ON unknown_trainees BEGIN
  INSERT INTO attempt_steps VALUES (OLD.session, 1);
END;
-- An account takes the sessions that wait under its name from the count.
CREATE TRIGGER people_sum_before_insert BEFORE INSERT ON people
  WHEN NOT EXISTS (SELECT 1 FROM people WHERE name = NEW.name) BEGIN
  INSERT INTO attempt_steps SELECT s.number, -1 FROM sessions s JOIN unknown_trainees u ON u.session = s.number
    WHERE s.trainee = NEW.name AND u.by_whom IS NULL;
END;
CREATE TRIGGER people_sum_after_insert AFTER INSERT ON people BEGIN
  INSERT INTO attempt_steps SELECT s.number, 1 FROM sessions s JOIN unknown_trainees u ON u.session = s.number
    WHERE s.trainee = NEW.name AND u.by_whom IS NULL;
END;
CREATE TRIGGER people_sum_before_delete BEFORE DELETE ON people BEGIN
  INSERT INTO attempt_steps SELECT s.number, -1 FROM sessions s JOIN unknown_trainees u ON u.session = s.number
    WHERE s.trainee = OLD.name AND u.by_whom IS NULL;
END;
CREATE TRIGGER people_sum_after_delete AFTER DELETE ON people BEGIN
  INSERT INTO attempt_steps SELECT s.number, 1 FROM sessions s JOIN unknown_trainees u ON u.session = s.number
    WHERE s.trainee = OLD.name AND u.by_whom IS NULL;
END;

-- The best of a trainee's attempts at an exercise is its last entry: passed, then most requirements met, then newest (AttemptStore::best
-- has the same words). 13 is the length of "passed":true.
CREATE INDEX sessions_by_verdict ON sessions (trainee, exercise_id, coalesce(passed, 0),
  (length(replace(coalesce(score_json, ''), ' ', '')) -
   length(replace(replace(coalesce(score_json, ''), ' ', ''), '"passed":true', ''))) / 13, started_unix_ns)
  WHERE excused = 0 AND state <> 1;
