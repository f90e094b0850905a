-- Schema version 1 on PostgreSQL: as db/migrations/0001_first.sql, which has the reasons (a test compares the two).
-- Whole numbers are BIGINT; texts compare byte by byte (COLLATE "C"), as SQLite's do.

-- Functions of SQLite that the stores use.
CREATE FUNCTION min(a BIGINT, b BIGINT) RETURNS BIGINT LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS 'SELECT least(a, b)';
CREATE FUNCTION max(a BIGINT, b BIGINT) RETURNS BIGINT LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS 'SELECT greatest(a, b)';
CREATE FUNCTION instr(whole TEXT, part TEXT) RETURNS BIGINT LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS 'SELECT strpos(whole, part)::bigint';
CREATE FUNCTION hex(bytes BYTEA) RETURNS TEXT LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS 'SELECT upper(encode(bytes, ''hex''))';
CREATE FUNCTION zeroblob(count BIGINT) RETURNS BYTEA LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS 'SELECT decode(repeat(''00'', count::int), ''hex'')';

-- A whole-number key that an INSERT leaves out is the greatest one plus 1, as in SQLite; of numbered tables never one that was used.
-- Writers come one after another (kWriterLock).
CREATE TABLE last_numbers (
  name   TEXT COLLATE "C" PRIMARY KEY,
  number BIGINT NOT NULL
);
CREATE FUNCTION next_number() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
  key_name TEXT := TG_ARGV[0];
  given BIGINT;
  used BIGINT;
BEGIN
  EXECUTE format('SELECT ($1).%I', key_name) INTO given USING NEW;
  IF given IS NULL THEN
    EXECUTE format('SELECT coalesce(max(%I), 0) FROM %I.%I', key_name, TG_TABLE_SCHEMA, TG_TABLE_NAME) INTO used;
    IF TG_ARGV[1] = 'numbered' THEN
      used := greatest(used, (SELECT number FROM last_numbers WHERE name = TG_TABLE_NAME));
    END IF;
    given := used + 1;
    NEW := jsonb_populate_record(NEW, jsonb_build_object(key_name, given));
  END IF;
  IF TG_ARGV[1] = 'numbered' THEN
    INSERT INTO last_numbers AS l (name, number) VALUES (TG_TABLE_NAME, given)
      ON CONFLICT (name) DO UPDATE SET number = greatest(l.number, excluded.number);
  END IF;
  RETURN NEW;
END $$;

CREATE TABLE meta (
  key   TEXT COLLATE "C" PRIMARY KEY,
  value TEXT COLLATE "C" NOT NULL
);

CREATE TABLE people (
  id              BIGINT PRIMARY KEY,
  ref             TEXT COLLATE "C" NOT NULL GENERATED ALWAYS AS ('@' || id) STORED UNIQUE,
  uuid            BYTEA NOT NULL UNIQUE CHECK (length(uuid) = 16),  -- towards stations and files
  role            BIGINT NOT NULL CHECK (role BETWEEN 0 AND 6 AND role <> 5),
  password_hash   TEXT COLLATE "C",                        -- argon2id; NULL: cannot log in
  disabled        BIGINT NOT NULL DEFAULT 0 CHECK (disabled IN (0, 1)),
  created_unix_ns BIGINT NOT NULL,
  revision        BIGINT NOT NULL DEFAULT 1 CHECK (revision >= 1),
  changed_unix_ns BIGINT NOT NULL,
  changed_by      TEXT COLLATE "C" NOT NULL DEFAULT '',    -- '': as it was made
  code_hash       TEXT COLLATE "C",                        -- argon2id of a PIN, or of what a badge reader types; NULL: no code
  erased_unix_ns  BIGINT                      -- NULL: not erased
);

CREATE TRIGGER people_number BEFORE INSERT ON people FOR EACH ROW EXECUTE FUNCTION next_number('id', 'numbered');

-- What people are called: here, and nowhere else.
CREATE TABLE names (
  person    BIGINT PRIMARY KEY REFERENCES people (id),
  name      TEXT COLLATE "C" NOT NULL CHECK (length(name) BETWEEN 1 AND 64),   -- as it was typed
  folded    TEXT COLLATE "C" NOT NULL,                     -- nameKey(): two names with one key are one (person_name.h)
  full_name TEXT COLLATE "C" NOT NULL DEFAULT '',
  typed     BIGINT NOT NULL CHECK (typed IN (0, 1))               -- 1: at a station; people.role is 0
);
CREATE UNIQUE INDEX names_once ON names (folded, typed);
CREATE INDEX names_in_order ON names (name);
CREATE INDEX names_typed ON names (person) WHERE typed = 1;   -- few: names_taken reads them

-- People with an account, and what each `ref` is called: by an account, or as it was typed.
CREATE VIEW accounts AS
  SELECT p.id, p.ref, p.uuid, n.name, n.folded, n.full_name, p.role, p.password_hash, p.disabled, p.created_unix_ns, p.revision,
    p.changed_unix_ns, p.changed_by, p.code_hash
  FROM names n JOIN people p ON p.id = n.person WHERE n.typed = 0;
CREATE VIEW called AS
  SELECT p.ref, n.name, n.folded, n.full_name, n.typed FROM names n JOIN people p ON p.id = n.person;
-- Names that were typed at a station and are an account's by now: lists of trainees show the account.
CREATE VIEW names_taken AS
  SELECT p.ref FROM names n JOIN people p ON p.id = n.person
  WHERE n.typed = 1 AND EXISTS (SELECT 1 FROM names a WHERE a.folded = n.folded AND a.typed = 0);

CREATE TABLE stations (
  name            TEXT COLLATE "C" PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  key_hash        BYTEA NOT NULL CHECK (length(key_hash) = 32),  -- BLAKE2b-256 of the 32-byte key
  revoked         BIGINT NOT NULL DEFAULT 0 CHECK (revoked IN (0, 1)),
  created_unix_ns BIGINT NOT NULL
);

CREATE TABLE profiles (
  id              TEXT COLLATE "C" NOT NULL,
  revision        BIGINT NOT NULL CHECK (revision >= 1),
  name            TEXT COLLATE "C" NOT NULL,
  json            TEXT COLLATE "C" NOT NULL,               -- canonical (common/profile)
  author          TEXT COLLATE "C" NOT NULL,
  created_unix_ns BIGINT NOT NULL,
  PRIMARY KEY (id, revision)
);

CREATE TABLE curricula (
  id              TEXT COLLATE "C" NOT NULL,
  revision        BIGINT NOT NULL CHECK (revision >= 1),
  name            TEXT COLLATE "C" NOT NULL,
  json            TEXT COLLATE "C" NOT NULL,
  author          TEXT COLLATE "C" NOT NULL,
  created_unix_ns BIGINT NOT NULL,
  PRIMARY KEY (id, revision)
);

CREATE TABLE exercises (
  id            TEXT COLLATE "C" PRIMARY KEY,
  curriculum_id TEXT COLLATE "C" NOT NULL,
  position      BIGINT NOT NULL,              -- in its curriculum, from 0
  name          TEXT COLLATE "C" NOT NULL,
  profile_id    TEXT COLLATE "C" NOT NULL,
  json          TEXT COLLATE "C" NOT NULL,
  assigned_only BIGINT NOT NULL DEFAULT 0 CHECK (assigned_only IN (0, 1)),
  exam_attempts BIGINT CHECK (exam_attempts >= 1),         -- NULL: its course is no exam
  results_from_unix_ns BIGINT NOT NULL DEFAULT 0           -- of an exam: trainees see results from then on; 0: at once
);
CREATE INDEX exercises_by_curriculum ON exercises (curriculum_id, position);

CREATE TABLE sessions (
  number              BIGINT PRIMARY KEY,     -- small key for chunks
  id                  BYTEA NOT NULL UNIQUE CHECK (length(id) = 16),
  station             TEXT COLLATE "C" NOT NULL REFERENCES stations (name),
  trainee             TEXT COLLATE "C" NOT NULL,
  exercise_id         TEXT COLLATE "C" NOT NULL,
  profile_id          TEXT COLLATE "C" NOT NULL,
  profile_revision    BIGINT NOT NULL,
  profile_json        TEXT COLLATE "C" NOT NULL,
  engine_version      TEXT COLLATE "C" NOT NULL,
  rate_hz             DOUBLE PRECISION NOT NULL,
  started_unix_ns     BIGINT NOT NULL,        -- the station's clock
  description         BYTEA NOT NULL,           -- needlelab.pb.SessionDescription without profile_json
  state               BIGINT NOT NULL CHECK (state BETWEEN 1 AND 3),   -- needlelab.pb.SessionState
  chunks              BIGINT NOT NULL DEFAULT 0,
  samples             BIGINT NOT NULL DEFAULT 0,
  stored_bytes        BIGINT NOT NULL DEFAULT 0,
  safe_chunks         BIGINT NOT NULL DEFAULT 0,  -- chunks 0 ... n-1 are covered by a verified backup
  hash                BYTEA CHECK (hash IS NULL OR length(hash) = 32),   -- set when closed
  received_unix_ns    BIGINT NOT NULL,
  closed_unix_ns      BIGINT,
  score_json          TEXT COLLATE "C",
  clock_offset_ns     BIGINT,                 -- server's steady clock minus station's
  clock_round_trip_ns BIGINT,
  events              BIGINT CHECK (events IS NULL OR events >= 0),
  recording           BIGINT NOT NULL DEFAULT 1 CHECK (recording BETWEEN 1 AND 3),
  passed              BIGINT CHECK (passed IN (0, 1)),
  excused             BIGINT NOT NULL DEFAULT 0 CHECK (excused IN (0, 1, 2)),
  erased              BIGINT NOT NULL DEFAULT 0 CHECK (erased IN (0, 1))
);
CREATE INDEX sessions_by_station ON sessions (station, state);
CREATE INDEX sessions_by_trainee ON sessions (trainee);
CREATE INDEX sessions_by_start ON sessions (started_unix_ns);
CREATE INDEX sessions_by_age ON sessions (recording, exercise_id, closed_unix_ns);
CREATE INDEX sessions_by_attempt ON sessions (trainee, exercise_id, started_unix_ns);
CREATE INDEX sessions_by_verdict ON sessions (trainee, exercise_id, coalesce(passed, 0),
  ((length(replace(coalesce(score_json, ''), ' ', '')) -
    length(replace(replace(coalesce(score_json, ''), ' ', ''), '"passed":true', ''))) / 13), started_unix_ns, number)
  WHERE excused = 0 AND state <> 1;
CREATE TRIGGER sessions_number BEFORE INSERT ON sessions FOR EACH ROW EXECUTE FUNCTION next_number('number');

CREATE TABLE chunks (
  session BIGINT NOT NULL REFERENCES sessions (number),
  seq     BIGINT NOT NULL CHECK (seq >= 0),
  samples BIGINT NOT NULL CHECK (samples >= 1),
  crc     BIGINT NOT NULL,
  bytes   BYTEA NOT NULL,
  PRIMARY KEY (session, seq)
);
-- Chunks are compressed already.
ALTER TABLE chunks ALTER COLUMN bytes SET STORAGE EXTERNAL;

CREATE TABLE annotations (
  id              BIGINT PRIMARY KEY,
  session         BIGINT NOT NULL REFERENCES sessions (number),
  tick            BIGINT NOT NULL,
  text            TEXT COLLATE "C" NOT NULL,
  author          TEXT COLLATE "C" NOT NULL,
  created_unix_ns BIGINT NOT NULL
);
CREATE INDEX annotations_by_session ON annotations (session, tick);
CREATE TRIGGER annotations_number BEFORE INSERT ON annotations FOR EACH ROW EXECUTE FUNCTION next_number('id');

CREATE TABLE audit (
  id      BIGINT PRIMARY KEY,   -- a deleted row leaves a gap that shows
  unix_ns BIGINT NOT NULL,
  who     TEXT COLLATE "C" NOT NULL,
  action  TEXT COLLATE "C" NOT NULL,
  subject TEXT COLLATE "C" NOT NULL,
  detail  TEXT COLLATE "C" NOT NULL
);
CREATE TRIGGER audit_number BEFORE INSERT ON audit FOR EACH ROW EXECUTE FUNCTION next_number('id', 'numbered');

CREATE TABLE session_events (
  session                 BIGINT NOT NULL REFERENCES sessions (number),
  position                BIGINT NOT NULL CHECK (position >= 0),       -- in its session, from 0
  kind                    BIGINT NOT NULL CHECK (kind IN (1, 2)),      -- 1 aspiration, 2 injection
  begin_tick              BIGINT NOT NULL,
  end_tick                BIGINT NOT NULL CHECK (end_tick >= begin_tick),
  begin_s                 DOUBLE PRECISION NOT NULL,                                -- since the session's first sample
  end_s                   DOUBLE PRECISION NOT NULL,
  plunger_from            DOUBLE PRECISION NOT NULL,                                -- 0 drawn out, 1 pressed down
  plunger_to              DOUBLE PRECISION NOT NULL,
  in_tissue_share         DOUBLE PRECISION NOT NULL,
  in_target_share         DOUBLE PRECISION NOT NULL,
  begin_x_m               DOUBLE PRECISION NOT NULL,
  begin_y_m               DOUBLE PRECISION NOT NULL,
  begin_z_m               DOUBLE PRECISION NOT NULL,
  begin_layer             BIGINT NOT NULL CHECK (begin_layer >= -1),   -- from 0; -1 outside the tissue
  begin_tissue            TEXT COLLATE "C" NOT NULL,
  begin_insertion_m       DOUBLE PRECISION NOT NULL,
  begin_depth_m           DOUBLE PRECISION NOT NULL,
  begin_target            TEXT COLLATE "C" NOT NULL,                                -- the nearest; '' where there is none
  begin_target_distance_m DOUBLE PRECISION NOT NULL,                                -- from its edge, negative inside
  begin_hazard            TEXT COLLATE "C" NOT NULL,                                -- the one that it was in, or ''
  end_x_m                 DOUBLE PRECISION NOT NULL,
  end_y_m                 DOUBLE PRECISION NOT NULL,
  end_z_m                 DOUBLE PRECISION NOT NULL,
  end_layer               BIGINT NOT NULL CHECK (end_layer >= -1),
  end_tissue              TEXT COLLATE "C" NOT NULL,
  end_insertion_m         DOUBLE PRECISION NOT NULL,
  end_depth_m             DOUBLE PRECISION NOT NULL,
  end_target              TEXT COLLATE "C" NOT NULL,
  end_target_distance_m   DOUBLE PRECISION NOT NULL,
  end_hazard              TEXT COLLATE "C" NOT NULL,
  hazards                 TEXT COLLATE "C" NOT NULL,                                -- those met on the way, one a line
  PRIMARY KEY (session, position)
);

CREATE TABLE retention_policies (
  exercise_id       TEXT COLLATE "C" PRIMARY KEY,
  thin_after_days   BIGINT CHECK (thin_after_days BETWEEN 0 AND 36500),
  thin_rate_hz      DOUBLE PRECISION CHECK (thin_rate_hz > 0),     -- of the derived recording; set with thin_after_days
  thin_coarser      DOUBLE PRECISION NOT NULL DEFAULT 1 CHECK (thin_coarser BETWEEN 1 AND 1000),  -- its steps: so many times the original's
  delete_after_days BIGINT CHECK (delete_after_days BETWEEN 0 AND 36500),
  without_backup    BIGINT NOT NULL DEFAULT 0 CHECK (without_backup IN (0, 1)),  -- 1: also sessions that no verified backup covers
  by_whom           TEXT COLLATE "C" NOT NULL,
  changed_unix_ns   BIGINT NOT NULL,
  CHECK ((thin_after_days IS NULL) = (thin_rate_hz IS NULL))
);

CREATE TABLE derived_recordings (
  session         BIGINT PRIMARY KEY REFERENCES sessions (number),
  complete        BIGINT NOT NULL CHECK (complete IN (0, 1)),
  original_hash   BYTEA NOT NULL CHECK (length(original_hash) = 32),  -- sessions.hash of what it was made from
  method          TEXT COLLATE "C" NOT NULL,                       -- how, e.g. 'triangle mean' (common/gesture/thinning.h)
  rate_hz         DOUBLE PRECISION NOT NULL,
  chunks          BIGINT NOT NULL DEFAULT 0,
  samples         BIGINT NOT NULL DEFAULT 0,
  stored_bytes    BIGINT NOT NULL DEFAULT 0,
  hash            BYTEA CHECK (hash IS NULL OR length(hash) = 32),    -- over its own chunks in order; set when complete
  created_unix_ns BIGINT NOT NULL,
  CHECK (complete = 0 OR hash IS NOT NULL)
);

CREATE TABLE derived_chunks (
  session BIGINT NOT NULL REFERENCES derived_recordings (session),
  seq     BIGINT NOT NULL CHECK (seq >= 0),
  samples BIGINT NOT NULL CHECK (samples >= 1),
  crc     BIGINT NOT NULL,
  bytes   BYTEA NOT NULL,
  PRIMARY KEY (session, seq)
);
ALTER TABLE derived_chunks ALTER COLUMN bytes SET STORAGE EXTERNAL;

CREATE TABLE removed_originals (
  session         BIGINT PRIMARY KEY REFERENCES sessions (number),
  removed_unix_ns BIGINT NOT NULL,                    -- of the first step, from original to thinned or deleted
  deleted_unix_ns BIGINT,                             -- NULL while a thinned recording is there
  reason          TEXT COLLATE "C" NOT NULL,                       -- the policy in words, of the last step
  by_whom         TEXT COLLATE "C" NOT NULL,
  leftover        BIGINT NOT NULL CHECK (leftover IN (0, 1)),  -- 1: rows in chunks or derived_chunks are still to be removed
  crcs            BYTEA NOT NULL CHECK (length(crcs) % 4 = 0)
);
CREATE INDEX removed_originals_leftover ON removed_originals (session) WHERE leftover = 1;

CREATE TABLE assignments (
  id              BIGINT PRIMARY KEY,   -- never used again
  course_id       TEXT COLLATE "C",
  exercise_id     TEXT COLLATE "C",
  group_id        TEXT COLLATE "C",
  trainee         TEXT COLLATE "C",
  due_unix_ns     BIGINT,                             -- NULL: never
  by_whom         TEXT COLLATE "C" NOT NULL,
  created_unix_ns BIGINT NOT NULL,
  CHECK ((course_id IS NULL) <> (exercise_id IS NULL)),
  CHECK ((group_id IS NULL) <> (trainee IS NULL))
);
CREATE UNIQUE INDEX assignments_once ON assignments
  (coalesce(course_id, ''), coalesce(exercise_id, ''), coalesce(group_id, ''), coalesce(trainee, ''));
CREATE INDEX assignments_by_trainee ON assignments (trainee);
CREATE INDEX assignments_by_group ON assignments (group_id);
CREATE TRIGGER assignments_number BEFORE INSERT ON assignments FOR EACH ROW EXECUTE FUNCTION next_number('id', 'numbered');

CREATE TABLE groups (
  id              TEXT COLLATE "C" PRIMARY KEY CHECK (length(id) BETWEEN 1 AND 64),
  name            TEXT COLLATE "C" NOT NULL,
  revision        BIGINT NOT NULL CHECK (revision >= 1),
  changed_by      TEXT COLLATE "C" NOT NULL,
  changed_unix_ns BIGINT NOT NULL,
  removed         BIGINT NOT NULL DEFAULT 0 CHECK (removed IN (0, 1))   -- the row stays, so that its revision goes on
);

CREATE TABLE group_members (
  group_id TEXT COLLATE "C" NOT NULL REFERENCES groups (id),
  person   TEXT COLLATE "C" NOT NULL REFERENCES people (ref),
  PRIMARY KEY (group_id, person)
);
CREATE INDEX group_members_by_person ON group_members (person);

CREATE TABLE consents (
  id          BIGINT PRIMARY KEY,
  person      TEXT COLLATE "C" NOT NULL REFERENCES people (ref),
  given       BIGINT NOT NULL CHECK (given IN (0, 1)),
  unix_ns     BIGINT NOT NULL,
  recorded_by TEXT COLLATE "C" NOT NULL,
  note        TEXT COLLATE "C" NOT NULL
);
CREATE INDEX consents_by_person ON consents (person, id);
CREATE TRIGGER consents_number BEFORE INSERT ON consents FOR EACH ROW EXECUTE FUNCTION next_number('id');

CREATE TABLE scores (
  session            BIGINT NOT NULL REFERENCES sessions (number),
  definition_version BIGINT NOT NULL CHECK (definition_version >= 1),
  measures           TEXT COLLATE "C" NOT NULL,                     -- JSON rows: measure, value, unit, words, min, max, passed
  passed             BIGINT CHECK (passed IN (0, 1)),  -- all requirements met; NULL: there are none
  first              BIGINT NOT NULL CHECK (first IN (0, 1)),
  engine_version     TEXT COLLATE "C" NOT NULL,                     -- of the program that scored
  made_unix_ns       BIGINT NOT NULL,
  PRIMARY KEY (session, definition_version)
);
CREATE UNIQUE INDEX scores_first ON scores (session) WHERE first = 1;

CREATE TABLE exercise_references (
  exercise_id     TEXT COLLATE "C" NOT NULL,
  revision        BIGINT NOT NULL CHECK (revision >= 1),
  sessions        TEXT COLLATE "C" NOT NULL,               -- JSON list of session ids as text
  by_whom         TEXT COLLATE "C" NOT NULL,
  created_unix_ns BIGINT NOT NULL,
  PRIMARY KEY (exercise_id, revision)
);

CREATE TABLE erasures (
  uuid            BYTEA PRIMARY KEY CHECK (length(uuid) = 16),
  erased_unix_ns  BIGINT NOT NULL,
  by_whom         TEXT COLLATE "C" NOT NULL,
  reason          TEXT COLLATE "C" NOT NULL
);

CREATE TABLE erased_names (
  hash          BYTEA PRIMARY KEY CHECK (length(hash) = 32),
  until_unix_ns BIGINT NOT NULL
);

CREATE TABLE session_progress (
  session      BIGINT PRIMARY KEY REFERENCES sessions (number),
  chunks       BIGINT NOT NULL DEFAULT 0 CHECK (chunks >= 0),
  samples      BIGINT NOT NULL DEFAULT 0 CHECK (samples >= 0),
  stored_bytes BIGINT NOT NULL DEFAULT 0 CHECK (stored_bytes >= 0)
) WITH (fillfactor = 40);  -- rewritten with each group: room for it in the same page, so that the index stays

CREATE TABLE unknown_trainees (
  session          BIGINT PRIMARY KEY REFERENCES sessions (number),
  given            TEXT COLLATE "C" NOT NULL REFERENCES people (ref),   -- whom the station gave
  by_whom          TEXT COLLATE "C",            -- the manager who assigned it; NULL: it waits
  assigned_unix_ns BIGINT,
  code_unchecked   BIGINT NOT NULL DEFAULT 0 CHECK (code_unchecked IN (0, 1)),
  begin_unsure     BIGINT NOT NULL DEFAULT 0 CHECK (begin_unsure <= code_unchecked AND begin_unsure IN (0, 1)),
  not_assigned     BIGINT NOT NULL DEFAULT 0 CHECK (not_assigned <= code_unchecked AND not_assigned IN (0, 1)),
  CHECK ((by_whom IS NULL) = (assigned_unix_ns IS NULL))
);
CREATE INDEX unknown_trainees_waiting ON unknown_trainees (session) WHERE by_whom IS NULL;
CREATE INDEX unknown_trainees_by_given ON unknown_trainees (given);

CREATE TABLE quarantined_chunks (
  session BIGINT NOT NULL REFERENCES sessions (number),
  seq     BIGINT NOT NULL CHECK (seq >= 0),
  reason  TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (session, seq)
);

CREATE TABLE audit_chain (
  position   BIGINT PRIMARY KEY CHECK (position >= 1),
  line       BIGINT NOT NULL REFERENCES audit (id),
  key_id     BYTEA NOT NULL CHECK (length(key_id) = 8),
  mac        BYTEA NOT NULL CHECK (length(mac) = 32)
);
CREATE INDEX audit_chain_lines ON audit_chain (line);
CREATE TRIGGER audit_chain_number BEFORE INSERT ON audit_chain FOR EACH ROW EXECUTE FUNCTION next_number('position');

CREATE VIEW uncounted_sessions AS
  SELECT session FROM unknown_trainees WHERE by_whom IS NULL AND code_unchecked = 1;

CREATE FUNCTION sessions_opened() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO session_progress (session, chunks, samples, stored_bytes)
    VALUES (NEW.number, NEW.chunks, NEW.samples, NEW.stored_bytes);
  UPDATE sessions SET chunks = 0, samples = 0, stored_bytes = 0 WHERE number = NEW.number AND NEW.chunks > 0;
  RETURN NULL;
END $$;
CREATE TRIGGER sessions_opened AFTER INSERT ON sessions FOR EACH ROW WHEN (NEW.state = 1) EXECUTE FUNCTION sessions_opened();

CREATE FUNCTION sessions_ended() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  UPDATE sessions SET (chunks, samples, stored_bytes) =
      (SELECT p.chunks, p.samples, p.stored_bytes FROM session_progress p WHERE p.session = NEW.number)
    WHERE number = NEW.number AND EXISTS (SELECT 1 FROM session_progress WHERE session = NEW.number);
  DELETE FROM session_progress WHERE session = NEW.number;
  RETURN NULL;
END $$;
CREATE TRIGGER sessions_ended AFTER UPDATE OF state ON sessions FOR EACH ROW WHEN (OLD.state = 1 AND NEW.state <> 1)
  EXECUTE FUNCTION sessions_ended();

CREATE FUNCTION quarantine_ends() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  DELETE FROM quarantined_chunks WHERE session = OLD.session AND seq = OLD.seq;
  RETURN NULL;
END $$;
CREATE TRIGGER quarantine_ends AFTER DELETE ON chunks FOR EACH ROW EXECUTE FUNCTION quarantine_ends();

CREATE VIEW attempt_shares AS
  SELECT session, exercise_id, trainee, attempts, CASE WHEN excused = 0 THEN attempts ELSE 0 END AS counted,
    CASE WHEN excused = 0 AND passed IS NOT NULL THEN attempts ELSE 0 END AS judged,
    CASE WHEN excused = 0 THEN coalesce(passed, 0) * attempts ELSE 0 END AS passed
  FROM (SELECT s.number AS session, s.exercise_id, s.trainee, s.excused, s.passed, CASE WHEN u.session IS NULL THEN 1::bigint ELSE 0 END AS attempts
        FROM sessions s LEFT JOIN uncounted_sessions u ON u.session = s.number
        WHERE s.trainee <> '' AND s.erased = 0) AS shares;

CREATE TABLE attempt_sums (
  exercise_id TEXT COLLATE "C" NOT NULL,
  trainee     TEXT COLLATE "C" NOT NULL,
  sessions    BIGINT NOT NULL,
  attempts    BIGINT NOT NULL,   -- without those whose code nobody gave
  counted     BIGINT NOT NULL,   -- of these, not excused
  judged      BIGINT NOT NULL,   -- of the counted: with a verdict
  passed      BIGINT NOT NULL,
  PRIMARY KEY (exercise_id, trainee)
);
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);

-- Each change of a session's share subtracts the share from the sums before and adds it after: sign -1, then 1.
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

CREATE TABLE station_claims (
  station       TEXT COLLATE "C" PRIMARY KEY REFERENCES stations (name),
  epoch         BIGINT NOT NULL CHECK (epoch > 0),
  server        TEXT COLLATE "C" NOT NULL,
  since_unix_ns BIGINT NOT NULL
);

CREATE TABLE access_numbers (
  what   BIGINT NOT NULL CHECK (what BETWEEN 0 AND 4),
  name   TEXT COLLATE "C" NOT NULL,
  number BIGINT NOT NULL,
  how    TEXT COLLATE "C" NOT NULL,
  server TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (what, name)
);
CREATE INDEX access_by_number ON access_numbers (number);

CREATE TABLE login_tokens (
  hash            BYTEA PRIMARY KEY CHECK (length(hash) = 32),
  name            TEXT COLLATE "C" NOT NULL,
  role            BIGINT NOT NULL,
  access_number   BIGINT NOT NULL,
  password_ns     BIGINT NOT NULL,
  expires_ns      BIGINT NOT NULL
);
CREATE INDEX login_tokens_by_name ON login_tokens (name);
CREATE INDEX login_tokens_by_end ON login_tokens (expires_ns);

CREATE TABLE login_attempts (
  kind          BIGINT NOT NULL,
  key           BYTEA NOT NULL CHECK (length(key) = 32),
  failures      DOUBLE PRECISION NOT NULL,
  at_ns         BIGINT NOT NULL,
  wait_until_ns BIGINT NOT NULL,
  PRIMARY KEY (kind, key)
);
CREATE INDEX login_attempts_by_time ON login_attempts (kind, at_ns);

CREATE TABLE noted_reads (
  key   BYTEA PRIMARY KEY CHECK (length(key) = 32),
  at_ns BIGINT NOT NULL
);
CREATE INDEX noted_reads_by_time ON noted_reads (at_ns);

-- Names have their schema: a person who disables an account by psql has another search_path.

-- The row of the last number is held to the transaction's end, so numbers are committed in their order, also beside a writer that
-- does not hold the lock of the store: a reader that has seen a number has seen all earlier ones.
CREATE FUNCTION raise_access(of_what BIGINT, of_name TEXT, in_a_word TEXT) RETURNS VOID LANGUAGE plpgsql AS $$
DECLARE
  next BIGINT;
BEGIN
  INSERT INTO needlelab.access_numbers AS a (what, name, number, how, server) VALUES (0, '', 1, '', '')
    ON CONFLICT (what, name) DO UPDATE SET number = a.number + 1 RETURNING a.number INTO STRICT next;
  INSERT INTO needlelab.access_numbers (what, name, number, how, server)
    VALUES (of_what, of_name, next, in_a_word, coalesce(current_setting('needlelab.server', true), ''))
    ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, how = excluded.how, server = excluded.server;
END $$;

-- Conditions are in the functions, whose text is compared at each start (db/store/postgres_objects.cpp), and not in the triggers.

-- With the COMMIT: servers read then what has changed. Many of one transaction are one.
CREATE FUNCTION tell_access() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF NEW.what = 0 THEN
    PERFORM pg_notify('needlelab_access', '');
  END IF;
  RETURN NULL;
END $$;
CREATE TRIGGER access_told AFTER INSERT OR UPDATE ON access_numbers FOR EACH ROW EXECUTE FUNCTION tell_access();

CREATE FUNCTION people_access() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF NEW.erased_unix_ns IS NOT NULL THEN
    IF OLD.erased_unix_ns IS NOT NULL THEN
      RETURN NULL;
    END IF;
    PERFORM needlelab.raise_access(4, '', 'erased');
    DELETE FROM needlelab.access_numbers WHERE what IN (1, 3) AND name = OLD.ref;
  ELSIF OLD.role <> NEW.role OR OLD.password_hash IS DISTINCT FROM NEW.password_hash OR OLD.disabled <> NEW.disabled THEN
    PERFORM needlelab.raise_access(1, NEW.ref,
      CASE WHEN NEW.disabled <> 0 THEN 'disabled' WHEN OLD.role <> NEW.role THEN 'role' ELSE 'password' END);
  ELSE
    RETURN NULL;
  END IF;
  DELETE FROM needlelab.login_tokens WHERE name = OLD.ref;
  RETURN NULL;
END $$;
CREATE TRIGGER people_access AFTER UPDATE OF role, password_hash, disabled, erased_unix_ns ON people
  FOR EACH ROW EXECUTE FUNCTION people_access();

CREATE FUNCTION stations_access() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF OLD.key_hash <> NEW.key_hash OR OLD.revoked <> NEW.revoked THEN
    PERFORM needlelab.raise_access(2, NEW.name, CASE WHEN NEW.revoked <> 0 THEN 'revoked' ELSE 'key' END);
  END IF;
  RETURN NULL;
END $$;
CREATE TRIGGER stations_access AFTER UPDATE OF key_hash, revoked ON stations FOR EACH ROW EXECUTE FUNCTION stations_access();
