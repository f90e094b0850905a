-- Schema version 10. Sums of the sessions that wait for their trainee stand apart: they count as long as nobody has the name. So an
-- account that is made or removed changes no sums, however many sessions wait under its name (on PostgreSQL the steps of schema 9 took
-- time with their square).
DROP TRIGGER people_sum_before_insert;
DROP TRIGGER people_sum_after_insert;
DROP TRIGGER people_sum_before_delete;
DROP TRIGGER people_sum_after_delete;
DROP TRIGGER attempt_steps_taken;
DROP VIEW attempt_shares;
DROP TABLE attempt_sums;

-- What a session adds to the sums of its trainee and exercise. One whose code nobody gave adds itself alone: its trainee is listed all
-- the same.
CREATE VIEW attempt_shares AS
  SELECT session, exercise_id, trainee, attempts * (1 - waits) AS attempts, counted * (1 - waits) AS counted,
    judged * (1 - waits) AS judged, passed * (1 - waits) AS passed, attempts * waits AS waiting_attempts,
    counted * waits AS waiting_counted, judged * waits AS waiting_judged, passed * waits AS waiting_passed
  FROM (SELECT session, exercise_id, trainee, waits, attempts, attempts * (1 - excused) AS counted,
          CASE WHEN passed IS NULL THEN 0 ELSE attempts * (1 - excused) END AS judged,
          coalesce(passed, 0) * attempts * (1 - excused) AS passed
        FROM (SELECT s.number AS session, s.exercise_id, s.trainee, s.excused, s.passed,
                CASE WHEN u.code_unchecked = 0 THEN 1 ELSE 0 END AS waits, CASE WHEN u.code_unchecked = 1 THEN 0 ELSE 1 END AS attempts
              FROM sessions s LEFT JOIN unknown_trainees u ON u.session = s.number AND u.by_whom IS NULL
              WHERE s.trainee <> '' AND s.erased = 0) AS those) AS shares;

CREATE TABLE attempt_sums (
  exercise_id      TEXT NOT NULL,
  trainee          TEXT NOT NULL,
  sessions         INTEGER NOT NULL,
  attempts         INTEGER NOT NULL,   -- without those that wait, or whose code nobody gave
  counted          INTEGER NOT NULL,   -- of these, not excused
  judged           INTEGER NOT NULL,   -- of the counted: with a verdict
  passed           INTEGER NOT NULL,
  waiting_attempts INTEGER NOT NULL,   -- the same of those that wait
  waiting_counted  INTEGER NOT NULL,
  waiting_judged   INTEGER NOT NULL,
  waiting_passed   INTEGER NOT NULL,
  PRIMARY KEY (exercise_id, trainee)
) STRICT, WITHOUT ROWID;
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);
INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed, waiting_attempts, waiting_counted,
    waiting_judged, waiting_passed)
  SELECT exercise_id, trainee, count(*), sum(attempts), sum(counted), sum(judged), sum(passed), sum(waiting_attempts),
    sum(waiting_counted), sum(waiting_judged), sum(waiting_passed)
  FROM attempt_shares GROUP BY exercise_id, trainee;

-- The sums as they count now.
CREATE VIEW attempt_counts AS
  SELECT exercise_id, trainee, sessions, attempts + nobodys * waiting_attempts AS attempts,
    counted + nobodys * waiting_counted AS counted, judged + nobodys * waiting_judged AS judged,
    passed + nobodys * waiting_passed AS passed
  FROM (SELECT a.*, CASE WHEN a.waiting_attempts > 0 AND NOT EXISTS (SELECT 1 FROM people p WHERE p.name = a.trainee) THEN 1 ELSE 0 END
          AS nobodys FROM attempt_sums a) AS sums;

-- Whatever changes a session's share takes the share from the sums before and adds it after: sign -1, then 1.
CREATE TRIGGER attempt_steps_taken INSTEAD OF INSERT ON attempt_steps BEGIN
  INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed, waiting_attempts, waiting_counted,
      waiting_judged, waiting_passed)
    SELECT exercise_id, trainee, NEW.sign, NEW.sign * attempts, NEW.sign * counted, NEW.sign * judged, NEW.sign * passed,
      NEW.sign * waiting_attempts, NEW.sign * waiting_counted, NEW.sign * waiting_judged, NEW.sign * waiting_passed
    FROM attempt_shares WHERE session = NEW.session
    ON CONFLICT (exercise_id, trainee) DO UPDATE SET sessions = sessions + excluded.sessions,
      attempts = attempts + excluded.attempts, counted = counted + excluded.counted,
      judged = judged + excluded.judged, passed = passed + excluded.passed,
      waiting_attempts = waiting_attempts + excluded.waiting_attempts, waiting_counted = waiting_counted + excluded.waiting_counted,
      waiting_judged = waiting_judged + excluded.waiting_judged, waiting_passed = waiting_passed + excluded.waiting_passed;
  DELETE FROM attempt_sums WHERE sessions = 0
    AND (exercise_id, trainee) IN (SELECT exercise_id, trainee FROM attempt_shares WHERE session = NEW.session);
END;
