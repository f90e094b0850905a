-- Schema version 1. Times are ns since 1970 (UTC). Texts are UTF-8. Once it is released, a change of the schema is a file of its own,
-- with the next number; on PostgreSQL, too (postgres/).

-- Facts about the database itself: engine_version, created_unix_ns, backup_unix_ns, backup_path.
CREATE TABLE meta (
  key   TEXT PRIMARY KEY,
  value TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- A person is an id, which is never used again; `ref`, '@' and the id, stands wherever a row says who. role: needlelab.pb.Role
-- (1 trainee, 2 instructor, 3 curriculum manager, 4 administrator, 6 researcher; 5 is the stations'); 0: no account, but a name that
-- was typed at a station; its sessions wait under it. An erased person's row stays, without its name.
-- revision: of what can be changed of a person; password and consent are not part of it.
CREATE TABLE people (
  id              INTEGER PRIMARY KEY AUTOINCREMENT,
  ref             TEXT NOT NULL GENERATED ALWAYS AS ('@' || id) STORED UNIQUE,
  uuid            BLOB NOT NULL UNIQUE CHECK (length(uuid) = 16),  -- towards stations and files
  role            INTEGER NOT NULL CHECK (role BETWEEN 0 AND 6 AND role <> 5),
  password_hash   TEXT,                        -- argon2id; NULL: cannot log in
  disabled        INTEGER NOT NULL DEFAULT 0 CHECK (disabled IN (0, 1)),
  created_unix_ns INTEGER NOT NULL,
  revision        INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1),
  changed_unix_ns INTEGER NOT NULL,
  changed_by      TEXT NOT NULL DEFAULT '',    -- '': as it was made
  code_hash       TEXT,                        -- argon2id of a PIN, or of what a badge reader types; NULL: no code
  erased_unix_ns  INTEGER                      -- NULL: not erased
) STRICT;

-- What people are called: here, and nowhere else.
CREATE TABLE names (
  person    INTEGER PRIMARY KEY REFERENCES people (id),
  name      TEXT NOT NULL CHECK (length(name) BETWEEN 1 AND 64),   -- as it was typed
  folded    TEXT NOT NULL,                     -- nameKey(): two names with one key are one (person_name.h)
  full_name TEXT NOT NULL DEFAULT '',
  typed     INTEGER NOT NULL CHECK (typed IN (0, 1))               -- 1: at a station; people.role is 0
) STRICT;
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
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  key_hash        BLOB NOT NULL CHECK (length(key_hash) = 32),  -- BLAKE2b-256 of the 32-byte key
  revoked         INTEGER NOT NULL DEFAULT 0 CHECK (revoked IN (0, 1)),
  created_unix_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Revisions are never overwritten: sessions refer to them.
CREATE TABLE profiles (
  id              TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  name            TEXT NOT NULL,
  json            TEXT NOT NULL,               -- canonical (common/profile)
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (id, revision)
) STRICT, WITHOUT ROWID;

CREATE TABLE curricula (
  id              TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  name            TEXT NOT NULL,
  json            TEXT NOT NULL,
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (id, revision)
) STRICT, WITHOUT ROWID;

-- What can be practised now: the exercises of the newest revision of each curriculum.
CREATE TABLE exercises (
  id            TEXT PRIMARY KEY,
  curriculum_id TEXT NOT NULL,
  position      INTEGER NOT NULL,              -- in its curriculum, from 0
  name          TEXT NOT NULL,
  profile_id    TEXT NOT NULL,
  json          TEXT NOT NULL,
  assigned_only INTEGER NOT NULL DEFAULT 0 CHECK (assigned_only IN (0, 1)),
  exam_attempts INTEGER CHECK (exam_attempts >= 1),     -- NULL: its course is no exam
  results_from_unix_ns INTEGER NOT NULL DEFAULT 0       -- of an exam: trainees see results from then on; 0: at once
) STRICT, WITHOUT ROWID;
CREATE INDEX exercises_by_curriculum ON exercises (curriculum_id, position);

-- Exactly one of course and exercise, and one of group and trainee; each pair once, also where columns are NULL. A due date
-- has no time zone.
CREATE TABLE assignments (
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
CREATE UNIQUE INDEX assignments_once ON assignments
  (coalesce(course_id, ''), coalesce(exercise_id, ''), coalesce(group_id, ''), coalesce(trainee, ''));
CREATE INDEX assignments_by_trainee ON assignments (trainee);
CREATE INDEX assignments_by_group ON assignments (group_id);

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
  person   TEXT NOT NULL REFERENCES people (ref),
  PRIMARY KEY (group_id, person)
) STRICT, WITHOUT ROWID;
CREATE INDEX group_members_by_person ON group_members (person);

-- What a person said to studies, each time; the last one counts. Never updated.
CREATE TABLE consents (
  id          INTEGER PRIMARY KEY,
  person      TEXT NOT NULL REFERENCES people (ref),
  given       INTEGER NOT NULL CHECK (given IN (0, 1)),
  unix_ns     INTEGER NOT NULL,
  recorded_by TEXT NOT NULL,
  note        TEXT NOT NULL
) STRICT;
CREATE INDEX consents_by_person ON consents (person, id);

-- Exercise and profile are not foreign keys: a station that was offline, or that outlived a restored backup, may
-- bring sessions of what this database does not know, and none of them may be lost. The profile's text is kept.
-- An attempt is a session of its trainee at its exercise; its number is its place by started_unix_ns. What a station still sends of an
-- erased session is acknowledged and not kept.
CREATE TABLE sessions (
  number              INTEGER PRIMARY KEY,     -- small key for chunks
  id                  BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  station             TEXT NOT NULL REFERENCES stations (name),
  trainee             TEXT NOT NULL,           -- people.ref; 'guest'; '': nobody's
  exercise_id         TEXT NOT NULL,
  profile_id          TEXT NOT NULL,
  profile_revision    INTEGER NOT NULL,
  profile_json        TEXT NOT NULL,
  engine_version      TEXT NOT NULL,
  rate_hz             REAL NOT NULL,
  started_unix_ns     INTEGER NOT NULL,        -- the station's clock
  description         BLOB NOT NULL,           -- needlelab.pb.SessionDescription without trainee and profile_json
  state               INTEGER NOT NULL CHECK (state BETWEEN 1 AND 3),   -- needlelab.pb.SessionState
  chunks              INTEGER NOT NULL DEFAULT 0,
  samples             INTEGER NOT NULL DEFAULT 0,
  stored_bytes        INTEGER NOT NULL DEFAULT 0,
  safe_chunks         INTEGER NOT NULL DEFAULT 0,  -- chunks 0 ... n-1 are covered by a verified backup
  hash                BLOB CHECK (hash IS NULL OR length(hash) = 32),   -- set when closed
  received_unix_ns    INTEGER NOT NULL,
  closed_unix_ns      INTEGER,
  score_json          TEXT,
  clock_offset_ns     INTEGER,                 -- server's steady clock minus station's
  clock_round_trip_ns INTEGER,
  events              INTEGER CHECK (events IS NULL OR events >= 0),    -- rows in session_events; NULL: not worked out
  recording           INTEGER NOT NULL DEFAULT 1 CHECK (recording BETWEEN 1 AND 3),  -- see retention_policies
  passed              INTEGER CHECK (passed IN (0, 1)),                 -- of the first score
  excused             INTEGER NOT NULL DEFAULT 0 CHECK (excused IN (0, 1, 2)),  -- it does not count against the attempts: 1: somebody excused it; 2: it is beyond those of an exam
  erased              INTEGER NOT NULL DEFAULT 0 CHECK (erased IN (0, 1))    -- 1: of an erased person
) STRICT;
CREATE INDEX sessions_by_station ON sessions (station, state);
CREATE INDEX sessions_by_trainee ON sessions (trainee);
CREATE INDEX sessions_by_start ON sessions (started_unix_ns);
-- The candidates of a policy, without reading every session.
CREATE INDEX sessions_by_age ON sessions (recording, exercise_id, closed_unix_ns);
CREATE INDEX sessions_by_attempt ON sessions (trainee, exercise_id, started_unix_ns);
-- The best of a trainee's attempts at an exercise is its last entry: passed, then most requirements met, then newest (AttemptStore::best
-- has the same words). 13 is the length of "passed":true.
CREATE INDEX sessions_by_verdict ON sessions (trainee, exercise_id, coalesce(passed, 0),
  (length(replace(coalesce(score_json, ''), ' ', '')) -
   length(replace(replace(coalesce(score_json, ''), ' ', ''), '"passed":true', ''))) / 13, started_unix_ns)
  WHERE excused = 0 AND state <> 1;

-- The counters of open sessions have a table of their own: a chunk that comes in changes a row of some bytes
-- beside its own, and not the session's row, whose profile makes it two pages long.
--
-- Exactly the sessions with state 1 (open) have a row here; sessions.chunks, samples and stored_bytes are 0 meanwhile. The
-- triggers keep it so, for every program that opens or ends a session: the final numbers go into its row as its state changes.
CREATE TABLE session_progress (
  session      INTEGER PRIMARY KEY REFERENCES sessions (number),
  chunks       INTEGER NOT NULL DEFAULT 0 CHECK (chunks >= 0),
  samples      INTEGER NOT NULL DEFAULT 0 CHECK (samples >= 0),
  stored_bytes INTEGER NOT NULL DEFAULT 0 CHECK (stored_bytes >= 0)
) STRICT;

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

-- Never updated; deleted by retention alone. crc: the CRC-32C that the station made, i.e. the last four bytes of `bytes`, kept here as well;
-- on every read it must agree with both the bytes and this column.
CREATE TABLE chunks (
  session INTEGER NOT NULL REFERENCES sessions (number),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  samples INTEGER NOT NULL CHECK (samples >= 1),
  crc     INTEGER NOT NULL,
  bytes   BLOB NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT;

-- Chunks that cannot be decoded although their CRC is right. The bytes stand in `chunks` as they came, so that numbers and hash are the
-- station's; a row here says why they cannot be decoded. No backup makes such a chunk Safe, nor any chunk behind it.
CREATE TABLE quarantined_chunks (
  session INTEGER NOT NULL REFERENCES sessions (number),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  reason  TEXT NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT, WITHOUT ROWID;
CREATE TRIGGER quarantine_ends AFTER DELETE ON chunks BEGIN
  DELETE FROM quarantined_chunks WHERE session = OLD.session AND seq = OLD.seq;
END;

CREATE TABLE annotations (
  id              INTEGER PRIMARY KEY,
  session         INTEGER NOT NULL REFERENCES sessions (number),
  tick            INTEGER NOT NULL,
  text            TEXT NOT NULL,
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX annotations_by_session ON annotations (session, tick);

CREATE TABLE audit (
  id      INTEGER PRIMARY KEY AUTOINCREMENT,   -- a deleted row leaves a gap that shows
  unix_ns INTEGER NOT NULL,
  who     TEXT NOT NULL,
  action  TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail  TEXT NOT NULL
) STRICT;

-- Tamper evidence of the audit log (db/audit/audit_chain.h): an entry for each line. mac is keyed by DIR/audit.key, which is in
-- no backup, and covers the entry before. Nothing changes or deletes lines.
CREATE TABLE audit_chain (
  position   INTEGER PRIMARY KEY CHECK (position >= 1),
  line       INTEGER NOT NULL REFERENCES audit (id),
  key_id     BLOB NOT NULL CHECK (length(key_id) = 8),
  mac        BLOB NOT NULL CHECK (length(mac) = 32)
) STRICT;
CREATE INDEX audit_chain_lines ON audit_chain (line);

-- The use of the syringe in each closed session: needlelab.pb.SyringeEvent, one row each, in order
-- of time. Worked out by the server from the committed samples; a place is that of the needle's opening, in W.
CREATE TABLE session_events (
  session                 INTEGER NOT NULL REFERENCES sessions (number),
  position                INTEGER NOT NULL CHECK (position >= 0),       -- in its session, from 0
  kind                    INTEGER NOT NULL CHECK (kind IN (1, 2)),      -- 1 aspiration, 2 injection
  begin_tick              INTEGER NOT NULL,
  end_tick                INTEGER NOT NULL CHECK (end_tick >= begin_tick),
  begin_s                 REAL NOT NULL,                                -- since the session's first sample
  end_s                   REAL NOT NULL,
  plunger_from            REAL NOT NULL,                                -- 0 drawn out, 1 pressed down
  plunger_to              REAL NOT NULL,
  in_tissue_share         REAL NOT NULL,
  in_target_share         REAL NOT NULL,
  begin_x_m               REAL NOT NULL,
  begin_y_m               REAL NOT NULL,
  begin_z_m               REAL NOT NULL,
  begin_layer             INTEGER NOT NULL CHECK (begin_layer >= -1),   -- from 0; -1 outside the tissue
  begin_tissue            TEXT NOT NULL,
  begin_insertion_m       REAL NOT NULL,
  begin_depth_m           REAL NOT NULL,
  begin_target            TEXT NOT NULL,                                -- the nearest; '' where there is none
  begin_target_distance_m REAL NOT NULL,                                -- from its edge, negative inside
  begin_hazard            TEXT NOT NULL,                                -- the one that it was in, or ''
  end_x_m                 REAL NOT NULL,
  end_y_m                 REAL NOT NULL,
  end_z_m                 REAL NOT NULL,
  end_layer               INTEGER NOT NULL CHECK (end_layer >= -1),
  end_tissue              TEXT NOT NULL,
  end_insertion_m         REAL NOT NULL,
  end_depth_m             REAL NOT NULL,
  end_target              TEXT NOT NULL,
  end_target_distance_m   REAL NOT NULL,
  end_hazard              TEXT NOT NULL,
  hazards                 TEXT NOT NULL,                                -- those met on the way, one a line
  PRIMARY KEY (session, position)
) STRICT, WITHOUT ROWID;

-- Retention: recordings may be thinned into derived ones, or deleted, by a policy. Default: nothing is.
--
-- How to read a recording (sessions.recording):
--   1 original: `chunks` of the session, seq 0 ... sessions.chunks - 1.
--   2 thinned:  `derived_chunks` of the session, seq 0 ... derived_recordings.chunks - 1.
--   3 deleted:  nothing is left to read.
-- sessions.chunks, samples, stored_bytes, hash, score_json and events are those of the original for ever, and so are the rows of
-- session_events and annotations. For 2 and 3 there is exactly one row in removed_originals, for 1 there is none.
-- No other change of chunks is legal: a session's rows are there from 0 on without a gap, or, once `recording` is not 1, they are
-- on their way out, from the last to the first, in pieces (removed_originals.leftover = 1 until none is left).

-- What happens to closed sessions of an exercise, by the time since closed_unix_ns. exercise_id '': those of exercises without a
-- row of their own. No row at all, or both ages NULL: kept for ever.
CREATE TABLE retention_policies (
  exercise_id       TEXT PRIMARY KEY,
  thin_after_days   INTEGER CHECK (thin_after_days BETWEEN 0 AND 36500),
  thin_rate_hz      REAL CHECK (thin_rate_hz > 0),     -- of the derived recording; set with thin_after_days
  thin_coarser      REAL NOT NULL DEFAULT 1 CHECK (thin_coarser BETWEEN 1 AND 1000),  -- its steps: so many times the original's
  delete_after_days INTEGER CHECK (delete_after_days BETWEEN 0 AND 36500),
  without_backup    INTEGER NOT NULL DEFAULT 0 CHECK (without_backup IN (0, 1)),  -- 1: also sessions that no verified backup covers
  by_whom           TEXT NOT NULL,
  changed_unix_ns   INTEGER NOT NULL,
  CHECK ((thin_after_days IS NULL) = (thin_rate_hz IS NULL))
) STRICT, WITHOUT ROWID;

-- The thinned recording of a session. complete = 0: it is being written, and of no account (a crash may leave it: it is
-- removed and begun again). It is complete exactly when sessions.recording = 2.
CREATE TABLE derived_recordings (
  session         INTEGER PRIMARY KEY REFERENCES sessions (number),
  complete        INTEGER NOT NULL CHECK (complete IN (0, 1)),
  original_hash   BLOB NOT NULL CHECK (length(original_hash) = 32),  -- sessions.hash of what it was made from
  method          TEXT NOT NULL,                       -- how, e.g. 'triangle mean' (common/gesture/thinning.h)
  rate_hz         REAL NOT NULL,
  chunks          INTEGER NOT NULL DEFAULT 0,
  samples         INTEGER NOT NULL DEFAULT 0,
  stored_bytes    INTEGER NOT NULL DEFAULT 0,
  hash            BLOB CHECK (hash IS NULL OR length(hash) = 32),    -- over its own chunks in order; set when complete
  created_unix_ns INTEGER NOT NULL,
  CHECK (complete = 0 OR hash IS NOT NULL)
) STRICT;

-- As `chunks`: bytes and CRC of common/gesture/FORMAT.md. Ticks and times of the samples are those of samples of the original.
CREATE TABLE derived_chunks (
  session INTEGER NOT NULL REFERENCES derived_recordings (session),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  samples INTEGER NOT NULL CHECK (samples >= 1),
  crc     INTEGER NOT NULL,
  bytes   BLOB NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT;

-- The facts about an original that retention has taken away. crcs: the CRC of each of its chunks in order, u32 little-endian,
-- so that a station that sends one again can still be told "known" from "contradiction".
CREATE TABLE removed_originals (
  session         INTEGER PRIMARY KEY REFERENCES sessions (number),
  removed_unix_ns INTEGER NOT NULL,                    -- of the first step, from original to thinned or deleted
  deleted_unix_ns INTEGER,                             -- NULL while a thinned recording is there
  reason          TEXT NOT NULL,                       -- the policy in words, of the last step
  by_whom         TEXT NOT NULL,
  leftover        INTEGER NOT NULL CHECK (leftover IN (0, 1)),  -- 1: rows in chunks or derived_chunks are still to be removed
  crcs            BLOB NOT NULL CHECK (length(crcs) % 4 = 0)
) STRICT;
CREATE INDEX removed_originals_leftover ON removed_originals (session) WHERE leftover = 1;

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

-- Sessions of experts whose measures make the bands of an exercise. Revisions are never overwritten.
CREATE TABLE exercise_references (
  exercise_id     TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  sessions        TEXT NOT NULL,               -- JSON list of session ids as text
  by_whom         TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (exercise_id, revision)
) STRICT, WITHOUT ROWID;

-- The erased people. DIR/erasures holds the same, so that a restored backup, which knows the person again, can be told from this one
-- (erasure.h).
CREATE TABLE erasures (
  uuid            BLOB PRIMARY KEY CHECK (length(uuid) = 16),
  erased_unix_ns  INTEGER NOT NULL,
  by_whom         TEXT NOT NULL,
  reason          TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- Keyed hashes (DIR/pseudonym.key, which is in no backup) of the names that erased people had: a session that began before the
-- erasure and that a station brings under such a typed name waits, also if another account has the name now.
CREATE TABLE erased_names (
  hash          BLOB PRIMARY KEY CHECK (length(hash) = 32),
  until_unix_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Sessions that wait, or waited, for a manager to assign them to the right person: a station without its server takes any name. A
-- session has no trainee (no row) with an empty name or as 'guest'.
-- code_unchecked: why it waits: 0: no account had its trainee's name when it came; 1: the account existed, but its code was not given; or,
-- with begin_unsure, the station's clock was wrong, and whose attempt it is cannot be said before somebody says when it began; or, with
-- not_assigned, it came of an exercise that is assigned only, and was not assigned to the trainee then.
CREATE TABLE unknown_trainees (
  session          INTEGER PRIMARY KEY REFERENCES sessions (number),
  given            TEXT NOT NULL REFERENCES people (ref),   -- whom the station gave
  by_whom          TEXT,            -- the manager who assigned it; NULL: it waits
  assigned_unix_ns INTEGER,
  code_unchecked   INTEGER NOT NULL DEFAULT 0 CHECK (code_unchecked IN (0, 1)),
  begin_unsure     INTEGER NOT NULL DEFAULT 0 CHECK (begin_unsure <= code_unchecked AND begin_unsure IN (0, 1)),
  not_assigned     INTEGER NOT NULL DEFAULT 0 CHECK (not_assigned <= code_unchecked AND not_assigned IN (0, 1)),
  CHECK ((by_whom IS NULL) = (assigned_unix_ns IS NULL))
) STRICT;
CREATE INDEX unknown_trainees_waiting ON unknown_trainees (session) WHERE by_whom IS NULL;
CREATE INDEX unknown_trainees_by_given ON unknown_trainees (given);
-- The sessions that count for no one until a manager assigns them: a session without its trainee's code is not the trainee's. Others
-- that wait are listed under their typed name.
CREATE VIEW uncounted_sessions AS
  SELECT session FROM unknown_trainees WHERE by_whom IS NULL AND code_unchecked = 1;

-- What the lists of results need, so that they read what they show and not all sessions.
--
-- What a session adds to the sums of its trainee and exercise. One without its code adds itself alone: its trainee is
-- still listed.
CREATE VIEW attempt_shares AS
  SELECT session, exercise_id, trainee, attempts, CASE WHEN excused = 0 THEN attempts ELSE 0 END AS counted,
    CASE WHEN excused = 0 AND passed IS NOT NULL THEN attempts ELSE 0 END AS judged,
    CASE WHEN excused = 0 THEN coalesce(passed, 0) * attempts ELSE 0 END AS passed
  FROM (SELECT s.number AS session, s.exercise_id, s.trainee, s.excused, s.passed, CASE WHEN u.session IS NULL THEN 1 ELSE 0 END AS attempts
        FROM sessions s LEFT JOIN uncounted_sessions u ON u.session = s.number
        WHERE s.trainee <> '' AND s.erased = 0) AS shares;

CREATE TABLE attempt_sums (
  exercise_id TEXT NOT NULL,
  trainee     TEXT NOT NULL,
  sessions    INTEGER NOT NULL,
  attempts    INTEGER NOT NULL,   -- without those whose code nobody gave
  counted     INTEGER NOT NULL,   -- of these, not excused
  judged      INTEGER NOT NULL,   -- of the counted: with a verdict
  passed      INTEGER NOT NULL,
  PRIMARY KEY (exercise_id, trainee)
) STRICT, WITHOUT ROWID;
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);

-- Each change of a session's share subtracts the share from the sums before and adds it after: sign -1, then 1.
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

-- Which server has a station, where several work on one database: each log-in of the station raises its epoch, and
-- every transaction that stores something of its sessions asks whether its epoch is still the newest. Without other servers
-- no row is written.
CREATE TABLE station_claims (
  station       TEXT PRIMARY KEY REFERENCES stations (name),
  epoch         INTEGER NOT NULL CHECK (epoch > 0),
  server        TEXT NOT NULL,                        -- its name among the servers
  since_unix_ns INTEGER NOT NULL                      -- by that server's clock
) STRICT, WITHOUT ROWID;

-- What servers that work on one database at a time know of each other's log-ins (db/login/login_store.h), and
-- numbers of changes of access (db/login/access_numbers.h). One server alone keeps log-ins in its memory, and nothing here.

-- Of each account whose access changed, the number of its last change; of all of them each gets the next one. `what`: 0 the last
-- number given; of a person (people.ref) 1 role, password, disabled, 3 a log-out; 2 of a station its key; 4 that somebody was
-- erased.
CREATE TABLE access_numbers (
  what   INTEGER NOT NULL CHECK (what BETWEEN 0 AND 4),
  name   TEXT NOT NULL,
  number INTEGER NOT NULL,
  how    TEXT NOT NULL,          -- in a word, for a message
  server TEXT NOT NULL,          -- whose program changed it; '': another one
  PRIMARY KEY (what, name)
) STRICT, WITHOUT ROWID;
CREATE INDEX access_by_number ON access_numbers (number);

-- Times are of the database's clock, in ns.
CREATE TABLE login_tokens (
  hash            BLOB PRIMARY KEY CHECK (length(hash) = 32),   -- BLAKE2b-256 of the token
  name            TEXT NOT NULL,             -- people.ref
  role            INTEGER NOT NULL,
  access_number   INTEGER NOT NULL,          -- of the person, then
  password_ns     INTEGER NOT NULL,          -- the log-in with the password behind it
  expires_ns      INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX login_tokens_by_name ON login_tokens (name);
CREATE INDEX login_tokens_by_end ON login_tokens (expires_ns);

-- Failures, and addresses with a log-in. The keys are keyed hashes: a typed name may be a password.
CREATE TABLE login_attempts (
  kind          INTEGER NOT NULL,            -- LoginRow::Kind
  key           BLOB NOT NULL CHECK (length(key) = 32),
  failures      REAL NOT NULL,
  at_ns         INTEGER NOT NULL,
  wait_until_ns INTEGER NOT NULL,
  PRIMARY KEY (kind, key)
) STRICT, WITHOUT ROWID;
CREATE INDEX login_attempts_by_time ON login_attempts (kind, at_ns);

-- Who read what within the last hour, so that it has one line of the audit log. Keyed hashes.
CREATE TABLE noted_reads (
  key   BLOB PRIMARY KEY CHECK (length(key) = 32),
  at_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX noted_reads_by_time ON noted_reads (at_ns);

CREATE TRIGGER people_access AFTER UPDATE OF role, password_hash, disabled ON people WHEN NEW.erased_unix_ns IS NULL AND
  (OLD.role <> NEW.role OR OLD.password_hash IS NOT NEW.password_hash OR OLD.disabled <> NEW.disabled) BEGIN
  INSERT INTO access_numbers (what, name, number, how, server) VALUES (0, '', 1, '', '')
    ON CONFLICT (what, name) DO UPDATE SET number = number + 1;
  INSERT INTO access_numbers (what, name, number, how, server)
    SELECT 1, NEW.ref, number,
      CASE WHEN NEW.disabled <> 0 THEN 'disabled' WHEN OLD.role <> NEW.role THEN 'role' ELSE 'password' END, ''
    FROM access_numbers WHERE what = 0
    ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, how = excluded.how, server = excluded.server;
  DELETE FROM login_tokens WHERE name = NEW.ref;
END;

CREATE TRIGGER people_access_ends AFTER UPDATE OF erased_unix_ns ON people
  WHEN OLD.erased_unix_ns IS NULL AND NEW.erased_unix_ns IS NOT NULL BEGIN
  INSERT INTO access_numbers (what, name, number, how, server) VALUES (0, '', 1, '', '')
    ON CONFLICT (what, name) DO UPDATE SET number = number + 1;
  INSERT INTO access_numbers (what, name, number, how, server)
    SELECT 4, '', number, 'erased', '' FROM access_numbers WHERE what = 0
    ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, server = excluded.server;
  DELETE FROM access_numbers WHERE what IN (1, 3) AND name = OLD.ref;
  DELETE FROM login_tokens WHERE name = OLD.ref;
END;

CREATE TRIGGER stations_access AFTER UPDATE OF key_hash, revoked ON stations
  WHEN OLD.key_hash <> NEW.key_hash OR OLD.revoked <> NEW.revoked BEGIN
  INSERT INTO access_numbers (what, name, number, how, server) VALUES (0, '', 1, '', '')
    ON CONFLICT (what, name) DO UPDATE SET number = number + 1;
  INSERT INTO access_numbers (what, name, number, how, server)
    SELECT 2, NEW.name, number, CASE WHEN NEW.revoked <> 0 THEN 'revoked' ELSE 'key' END, ''
    FROM access_numbers WHERE what = 0
    ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, how = excluded.how, server = excluded.server;
END;
