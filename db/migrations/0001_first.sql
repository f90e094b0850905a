-- Schema version 1. Times are ns since 1970 (UTC). Texts are UTF-8. Never edit a migration that has been released:
-- write the next one.

-- Facts about the database itself: engine_version, created_unix_ns, backup_unix_ns, backup_path.
CREATE TABLE meta (
  key   TEXT PRIMARY KEY,
  value TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- role: needlelab.pb.Role (1 trainee, 2 instructor, 3 curriculum manager, 4 administrator)
CREATE TABLE people (
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  role            INTEGER NOT NULL CHECK (role BETWEEN 1 AND 4),
  password_hash   TEXT,                        -- argon2id; NULL: cannot log in
  disabled        INTEGER NOT NULL DEFAULT 0 CHECK (disabled IN (0, 1)),
  created_unix_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

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
  json          TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX exercises_by_curriculum ON exercises (curriculum_id, position);

CREATE TABLE assignments (
  trainee         TEXT NOT NULL REFERENCES people (name),
  exercise_id     TEXT NOT NULL,
  by_whom         TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (trainee, exercise_id)
) STRICT, WITHOUT ROWID;

-- Trainee, exercise and profile are not foreign keys: a station that was offline, or that outlived a restored backup, may
-- bring sessions of names that this database does not know, and none of them may be lost. The profile's text is kept.
CREATE TABLE sessions (
  number              INTEGER PRIMARY KEY,     -- small key for chunks
  id                  BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  station             TEXT NOT NULL REFERENCES stations (name),
  trainee             TEXT NOT NULL,
  exercise_id         TEXT NOT NULL,
  profile_id          TEXT NOT NULL,
  profile_revision    INTEGER NOT NULL,
  profile_json        TEXT NOT NULL,
  engine_version      TEXT NOT NULL,
  rate_hz             REAL NOT NULL,
  started_unix_ns     INTEGER NOT NULL,        -- the station's clock
  description         BLOB NOT NULL,           -- needlelab.pb.SessionDescription without profile_json
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
  clock_round_trip_ns INTEGER
) STRICT;
CREATE INDEX sessions_by_station ON sessions (station, state);
CREATE INDEX sessions_by_trainee ON sessions (trainee);
CREATE INDEX sessions_by_start ON sessions (started_unix_ns);

-- Never updated, never deleted. crc: the CRC-32C that the station made, i.e. the last four bytes of `bytes`, kept here as well;
-- on every read it must agree with both the bytes and this column.
CREATE TABLE chunks (
  session INTEGER NOT NULL REFERENCES sessions (number),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  samples INTEGER NOT NULL CHECK (samples >= 1),
  crc     INTEGER NOT NULL,
  bytes   BLOB NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT;

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
