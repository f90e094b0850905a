-- A database of schema version 2 (needlelab 0.1.0): version 1's with the syringe's events of one session, as sqlite3's .dump writes it. Never edit.
PRAGMA application_id=1852596578;
PRAGMA foreign_keys=OFF;
BEGIN TRANSACTION;
CREATE TABLE meta (
  key   TEXT PRIMARY KEY,
  value TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO meta VALUES('created_unix_ns','1764000000000000000');
INSERT INTO meta VALUES('engine_version','0.1.0');
CREATE TABLE people (
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  role            INTEGER NOT NULL CHECK (role BETWEEN 1 AND 4),
  password_hash   TEXT,                        -- argon2id; NULL: cannot log in
  disabled        INTEGER NOT NULL DEFAULT 0 CHECK (disabled IN (0, 1)),
  created_unix_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO people VALUES('anna',1,NULL,0,1764000000000000000);
INSERT INTO people VALUES('ina',2,'$argon2id$v=19$m=65536,t=2,p=1$c2FsdHNhbHRzYWx0c2FsdA$aGFzaGhhc2hoYXNoaGFzaGhhc2hoYXNoaGFzaGhhc2g',0,1764000000000000001);
INSERT INTO people VALUES('old',4,NULL,1,1764000000000000002);
CREATE TABLE stations (
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  key_hash        BLOB NOT NULL CHECK (length(key_hash) = 32),  -- BLAKE2b-256 of the 32-byte key
  revoked         INTEGER NOT NULL DEFAULT 0 CHECK (revoked IN (0, 1)),
  created_unix_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO stations VALUES('station-1',X'0000000000000000000000000000000000000000000000000000000000000000',0,1);
CREATE TABLE profiles (
  id              TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  name            TEXT NOT NULL,
  json            TEXT NOT NULL,               -- canonical (common/profile)
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (id, revision)
) STRICT, WITHOUT ROWID;
INSERT INTO profiles VALUES('knee-adult',1,'A knee','{"id":"knee-adult"}','ina',1764000000000000003);
INSERT INTO profiles VALUES('knee-adult',2,'A knee','{"id":"knee-adult","v":2}','ina',1764000000000000004);
CREATE TABLE curricula (
  id              TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  name            TEXT NOT NULL,
  json            TEXT NOT NULL,
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (id, revision)
) STRICT, WITHOUT ROWID;
INSERT INTO curricula VALUES('basics',1,'Basics','{"id":"basics"}','ina',1764000000000000005);
CREATE TABLE exercises (
  id            TEXT PRIMARY KEY,
  curriculum_id TEXT NOT NULL,
  position      INTEGER NOT NULL,              -- in its curriculum, from 0
  name          TEXT NOT NULL,
  profile_id    TEXT NOT NULL,
  json          TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO exercises VALUES('knee-1','basics',0,'First','knee-adult','{"id":"knee-1"}');
CREATE TABLE assignments (
  trainee         TEXT NOT NULL REFERENCES people (name),
  exercise_id     TEXT NOT NULL,
  by_whom         TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (trainee, exercise_id)
) STRICT, WITHOUT ROWID;
INSERT INTO assignments VALUES('anna','knee-1','ina',1764000000000000006);
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
, events INTEGER CHECK (events IS NULL OR events >= 0)) STRICT;
INSERT INTO sessions VALUES(1,X'010000000000000000000000000000aa','station-1','anna','knee-1','knee-adult',1,'{"id":"knee-adult"}','0.1.0',1000.0,1700000000000000000,X'0a10010000000000000000000000000000aa120973746174696f6e2d311a04616e6e6122066b6e65652d312a0a6b6e65652d6164756c7430014205302e312e30490000000000408f405209098dedb5a0f7c6b03e588080a8b1e39fe7cb176a0973696d756c6174656472389a9999999999b93f00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f',2,3,9,266,2,X'647c3e1587dfb86ad87234bc02d924cc947e7fd6ac69fac35e447eab13de3656',1764000000000000007,1764000000000000008,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',-5,1000,2);
INSERT INTO sessions VALUES(2,X'02000000000000000000000000000000','station-1','anna','knee-1','knee-adult',1,'{"id":"knee-adult"}','0.1.0',1000.0,1700000000000000000,X'0a1002000000000000000000000000000000120973746174696f6e2d311a04616e6e6122066b6e65652d312a0a6b6e65652d6164756c7430014205302e312e30490000000000408f405209098dedb5a0f7c6b03e588080a8b1e39fe7cb176a0973696d756c6174656472389a9999999999b93f00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f',1,1,2,87,0,NULL,1764000000000000007,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE chunks (
  session INTEGER NOT NULL REFERENCES sessions (number),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  samples INTEGER NOT NULL CHECK (samples >= 1),
  crc     INTEGER NOT NULL,
  bytes   BLOB NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT;
INSERT INTO chunks VALUES(1,0,3,2591312642,X'4e4c47430101020000000000000000000200000000000000000000000000000040420f000000000000000000000000000000808004000000000000000000000000000000000000010000000410000040c8014014024b749a');
INSERT INTO chunks VALUES(1,1,3,2782914328,X'4e4c47430101020003000000000000000500000000000000c0c62d000000000040420f000000000000000000d80400000000008080040000003c0000000000000000000000000000010000000410000040c801401418e7dfa5');
INSERT INTO chunks VALUES(1,2,3,2531659246,X'4e4c47430101020006000000000000000800000000000000808d5b000000000040420f000000000000000000b0090000000000808004000000780000000000000000000000000000010000000410000040c8014014ee0de696');
INSERT INTO chunks VALUES(2,0,2,1701907999,X'4e4c47430101010000000000000000000100000000000000000000000000000040420f000000000000000000000000000000808004000000000000000000000000000000000000010000000410000088c800141f0e7165');
CREATE TABLE annotations (
  id              INTEGER PRIMARY KEY,
  session         INTEGER NOT NULL REFERENCES sessions (number),
  tick            INTEGER NOT NULL,
  text            TEXT NOT NULL,
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL
) STRICT;
INSERT INTO annotations VALUES(1,1,4,'good angle','ina',1764000000000000009);
CREATE TABLE audit (
  id      INTEGER PRIMARY KEY AUTOINCREMENT,   -- a deleted row leaves a gap that shows
  unix_ns INTEGER NOT NULL,
  who     TEXT NOT NULL,
  action  TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail  TEXT NOT NULL
) STRICT;
INSERT INTO audit VALUES(1,1764000000000000000,'ina','user add','anna','trainee');
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
INSERT INTO session_events VALUES(1,0,1,1,3,0.0010000000000000000208,0.0030000000000000000624,0.2000000000000000111,0.10000000000000000555,1.0,0.5,0.0010000000000000000208,0.0,-0.021000000000000001304,3,'BURSA',0.021000000000000001304,0.02050000000000000086,'subacromial bursa',-0.00040000000000000001916,'',0.0010000000000000000208,0.0,-0.021999999999999998723,3,'BURSA',0.021999999999999998723,0.021499999999999998279,'subacromial bursa',-0.00010000000000000000479,'humeral head',replace('humeral head\naxillary nerve','\n',char(10)));
INSERT INTO session_events VALUES(1,1,2,4,8,0.0040000000000000000832,0.0080000000000000001665,0.10000000000000000555,0.9000000000000000222,0.0,0.0,0.0,0.0,0.010000000000000000208,-1,'',0.0,-0.010000000000000000208,'',0.0,'',0.0,0.0,0.010000000000000000208,-1,'',0.0,-0.010000000000000000208,'',0.0,'','');
DELETE FROM sqlite_sequence;
INSERT INTO sqlite_sequence VALUES('audit',1);
CREATE INDEX exercises_by_curriculum ON exercises (curriculum_id, position);
CREATE INDEX sessions_by_station ON sessions (station, state);
CREATE INDEX sessions_by_trainee ON sessions (trainee);
CREATE INDEX sessions_by_start ON sessions (started_unix_ns);
CREATE INDEX annotations_by_session ON annotations (session, tick);
COMMIT;
PRAGMA user_version=2;
