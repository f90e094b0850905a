-- The schema of version 9 on PostgreSQL: as db/migrations/0009_attempt_sums.sql, which has the reasons.

CREATE VIEW attempt_shares AS
  SELECT session, exercise_id, trainee, attempts, attempts * (1 - excused) AS counted,
    CASE WHEN passed IS NULL THEN 0 ELSE attempts * (1 - excused) END AS judged,
    coalesce(passed, 0) * attempts * (1 - excused) AS passed
  FROM (SELECT s.number AS session, s.exercise_id, s.trainee, s.excused, s.passed,
          CASE WHEN EXISTS (SELECT 1 FROM uncounted_sessions u WHERE u.session = s.number) THEN 0::bigint ELSE 1 END AS attempts
        FROM sessions s WHERE s.trainee <> '' AND s.erased = 0) AS shares;

CREATE TABLE attempt_sums (
  exercise_id TEXT COLLATE "C" NOT NULL,
  trainee     TEXT COLLATE "C" NOT NULL,
  sessions    BIGINT NOT NULL,
  attempts    BIGINT NOT NULL,   -- without those that count for nobody
  counted     BIGINT NOT NULL,   -- of these, not excused
  judged      BIGINT NOT NULL,   -- of the counted: with a verdict
  passed      BIGINT NOT NULL,
  PRIMARY KEY (exercise_id, trainee)
);
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);
INSERT INTO attempt_sums (exercise_id, trainee, sessions, attempts, counted, judged, passed)
  SELECT exercise_id, trainee, count(*), sum(attempts), sum(counted), sum(judged), sum(passed) FROM attempt_shares
  GROUP BY exercise_id, trainee;

-- Whatever changes a session's share takes the share from the sums before and adds it after: sign -1, then 1.
CREATE FUNCTION step_attempts(of_session BIGINT, sign BIGINT) RETURNS void LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO attempt_sums AS t (exercise_id, trainee, sessions, attempts, counted, judged, passed)
    SELECT a.exercise_id, a.trainee, sign, sign * a.attempts, sign * a.counted, sign * a.judged, sign * a.passed
    FROM attempt_shares a WHERE a.session = of_session
    ON CONFLICT (exercise_id, trainee) DO UPDATE SET sessions = t.sessions + excluded.sessions,
      attempts = t.attempts + excluded.attempts, counted = t.counted + excluded.counted,
      judged = t.judged + excluded.judged, passed = t.passed + excluded.passed;
  DELETE FROM attempt_sums t USING attempt_shares a
    WHERE a.session = of_session AND t.exercise_id = a.exercise_id AND t.trainee = a.trainee AND t.sessions = 0;
END $$;
CREATE FUNCTION step_waiting(of_trainee TEXT, sign BIGINT) RETURNS void LANGUAGE plpgsql AS $$
BEGIN
  PERFORM step_attempts(s.number, sign) FROM sessions s JOIN unknown_trainees u ON u.session = s.number
    WHERE s.trainee = of_trainee AND u.by_whom IS NULL;
END $$;

CREATE FUNCTION sessions_sum() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF TG_WHEN = 'BEFORE' THEN
    PERFORM step_attempts(OLD.number, -1);
    IF TG_OP = 'DELETE' THEN RETURN OLD; END IF;
    RETURN NEW;
  END IF;
  PERFORM step_attempts(NEW.number, 1);
  RETURN NULL;
END $$;
CREATE TRIGGER sessions_sum_after_insert AFTER INSERT ON sessions FOR EACH ROW EXECUTE FUNCTION sessions_sum();
CREATE TRIGGER sessions_sum_before_update BEFORE UPDATE OF trainee, exercise_id, excused, passed, erased ON sessions
  FOR EACH ROW EXECUTE FUNCTION sessions_sum();
CREATE TRIGGER sessions_sum_after_update AFTER UPDATE OF trainee, exercise_id, excused, passed, erased ON sessions
  FOR EACH ROW EXECUTE FUNCTION sessions_sum();
CREATE TRIGGER sessions_sum_before_delete BEFORE DELETE ON sessions FOR EACH ROW EXECUTE FUNCTION sessions_sum();

-- An INSERT of what is there already may do nothing, but its trigger is run: it must not take the share.
CREATE FUNCTION unknown_trainees_sum() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
  changed BIGINT := CASE TG_OP WHEN 'DELETE' THEN OLD.session ELSE NEW.session END;
BEGIN
  IF TG_WHEN = 'BEFORE' THEN
    IF TG_OP <> 'INSERT' OR NOT EXISTS (SELECT 1 FROM unknown_trainees WHERE session = changed) THEN
      PERFORM step_attempts(changed, -1);
    END IF;
    IF TG_OP = 'DELETE' THEN RETURN OLD; END IF;
    RETURN NEW;
  END IF;
  PERFORM step_attempts(changed, 1);
  RETURN NULL;
END $$;
CREATE TRIGGER unknown_trainees_sum_before_change BEFORE INSERT OR DELETE OR UPDATE OF by_whom, code_unchecked ON unknown_trainees
  FOR EACH ROW EXECUTE FUNCTION unknown_trainees_sum();
CREATE TRIGGER unknown_trainees_sum_after_change AFTER INSERT OR DELETE OR UPDATE OF by_whom, code_unchecked ON unknown_trainees
  FOR EACH ROW EXECUTE FUNCTION unknown_trainees_sum();

-- An account takes the sessions that wait under its name from the count.
CREATE FUNCTION people_sum() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
  changed TEXT := CASE TG_OP WHEN 'DELETE' THEN OLD.name ELSE NEW.name END;
BEGIN
  IF TG_WHEN = 'BEFORE' THEN
    IF TG_OP <> 'INSERT' OR NOT EXISTS (SELECT 1 FROM people WHERE name = changed) THEN
      PERFORM step_waiting(changed, -1);
    END IF;
    IF TG_OP = 'DELETE' THEN RETURN OLD; END IF;
    RETURN NEW;
  END IF;
  PERFORM step_waiting(changed, 1);
  RETURN NULL;
END $$;
CREATE TRIGGER people_sum_before_change BEFORE INSERT OR DELETE ON people FOR EACH ROW EXECUTE FUNCTION people_sum();
CREATE TRIGGER people_sum_after_change AFTER INSERT OR DELETE ON people FOR EACH ROW EXECUTE FUNCTION people_sum();

CREATE INDEX sessions_by_verdict ON sessions (trainee, exercise_id, coalesce(passed, 0),
  ((length(replace(coalesce(score_json, ''), ' ', '')) -
    length(replace(replace(coalesce(score_json, ''), ' ', ''), '"passed":true', ''))) / 13), started_unix_ns, number)
  WHERE excused = 0 AND state <> 1;
