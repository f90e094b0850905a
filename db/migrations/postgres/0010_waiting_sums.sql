-- The schema of version 10 on PostgreSQL: as db/migrations/0010_waiting_sums.sql, which has the reasons.
DROP TRIGGER people_sum_before_change ON people;
DROP TRIGGER people_sum_after_change ON people;
DROP FUNCTION people_sum();
DROP FUNCTION step_waiting(TEXT, BIGINT);
DROP VIEW attempt_shares;
DROP TABLE attempt_sums;

CREATE VIEW attempt_shares AS
  SELECT session, exercise_id, trainee, attempts * (1 - waits) AS attempts, counted * (1 - waits) AS counted,
    judged * (1 - waits) AS judged, passed * (1 - waits) AS passed, attempts * waits AS waiting_attempts,
    counted * waits AS waiting_counted, judged * waits AS waiting_judged, passed * waits AS waiting_passed
  FROM (SELECT session, exercise_id, trainee, waits, attempts, attempts * (1 - excused) AS counted,
          CASE WHEN passed IS NULL THEN 0 ELSE attempts * (1 - excused) END AS judged,
          coalesce(passed, 0) * attempts * (1 - excused) AS passed
        FROM (SELECT s.number AS session, s.exercise_id, s.trainee, s.excused, s.passed,
                CASE WHEN u.code_unchecked = 0 THEN 1::bigint ELSE 0 END AS waits,
                CASE WHEN u.code_unchecked = 1 THEN 0::bigint ELSE 1 END AS attempts
              FROM sessions s LEFT JOIN unknown_trainees u ON u.session = s.number AND u.by_whom IS NULL
              WHERE s.trainee <> '' AND s.erased = 0) AS those) AS shares;

CREATE TABLE attempt_sums (
  exercise_id      TEXT COLLATE "C" NOT NULL,
  trainee          TEXT COLLATE "C" NOT NULL,
  sessions         BIGINT NOT NULL,
  attempts         BIGINT NOT NULL,
  counted          BIGINT NOT NULL,
  judged           BIGINT NOT NULL,
  passed           BIGINT NOT NULL,
  waiting_attempts BIGINT NOT NULL,
  waiting_counted  BIGINT NOT NULL,
  waiting_judged   BIGINT NOT NULL,
  waiting_passed   BIGINT NOT NULL,
  PRIMARY KEY (exercise_id, trainee)
);
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);
INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed, waiting_attempts, waiting_counted,
    waiting_judged, waiting_passed)
  SELECT exercise_id, trainee, count(*), sum(attempts), sum(counted), sum(judged), sum(passed), sum(waiting_attempts),
    sum(waiting_counted), sum(waiting_judged), sum(waiting_passed)
  FROM attempt_shares GROUP BY exercise_id, trainee;

CREATE VIEW attempt_counts AS
  SELECT exercise_id, trainee, sessions, attempts + nobodys * waiting_attempts AS attempts,
    counted + nobodys * waiting_counted AS counted, judged + nobodys * waiting_judged AS judged,
    passed + nobodys * waiting_passed AS passed
  FROM (SELECT a.*, CASE WHEN a.waiting_attempts > 0 AND NOT EXISTS (SELECT 1 FROM people p WHERE p.name = a.trainee)
          THEN 1::bigint ELSE 0 END AS nobodys FROM attempt_sums a) AS sums;

CREATE OR REPLACE FUNCTION step_attempts(of_session BIGINT, sign BIGINT) RETURNS void LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO attempt_sums AS t (exercise_id, trainee, sessions, attempts, counted, judged, passed, waiting_attempts, waiting_counted,
      waiting_judged, waiting_passed)
    SELECT a.exercise_id, a.trainee, sign, sign * a.attempts, sign * a.counted, sign * a.judged, sign * a.passed,
      sign * a.waiting_attempts, sign * a.waiting_counted, sign * a.waiting_judged, sign * a.waiting_passed
    FROM attempt_shares a WHERE a.session = of_session
    ON CONFLICT (exercise_id, trainee) DO UPDATE SET sessions = t.sessions + excluded.sessions,
      attempts = t.attempts + excluded.attempts, counted = t.counted + excluded.counted,
      judged = t.judged + excluded.judged, passed = t.passed + excluded.passed,
      waiting_attempts = t.waiting_attempts + excluded.waiting_attempts, waiting_counted = t.waiting_counted + excluded.waiting_counted,
      waiting_judged = t.waiting_judged + excluded.waiting_judged, waiting_passed = t.waiting_passed + excluded.waiting_passed;
  DELETE FROM attempt_sums t USING attempt_shares a
    WHERE a.session = of_session AND t.exercise_id = a.exercise_id AND t.trainee = a.trainee AND t.sessions = 0;
END $$;
