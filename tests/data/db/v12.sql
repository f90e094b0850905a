-- A database of schema version 12 (needlelab 0.1.0): version 11's, with the log-in state of several servers. As sqlite3's .dump writes it.
-- Never edit.
PRAGMA application_id=1852596578;
PRAGMA foreign_keys=OFF;
BEGIN TRANSACTION;
CREATE TABLE annotations (
  id              INTEGER PRIMARY KEY,
  session         INTEGER NOT NULL REFERENCES sessions (number),
  tick            INTEGER NOT NULL,
  text            TEXT NOT NULL,
  author          TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL
) STRICT;
INSERT INTO annotations VALUES(1,1,4,'good angle','ina',1764000000000000009);
INSERT INTO annotations VALUES(2,4,1,'kept','ina',1764000000000000106);
CREATE TABLE audit (
  id      INTEGER PRIMARY KEY AUTOINCREMENT,   -- a deleted row leaves a gap that shows
  unix_ns INTEGER NOT NULL,
  who     TEXT NOT NULL,
  action  TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail  TEXT NOT NULL
, imported_by TEXT, imported_from TEXT) STRICT;
INSERT INTO audit VALUES(1,1764000000000000000,'ina','user add','anna','trainee',NULL,NULL);
INSERT INTO audit VALUES(2,1764000000000000107,'retention','retention thin','03000000-0000-0000-0000-000000000000','',NULL,NULL);
INSERT INTO audit VALUES(3,1764000000000000300,'ada','user add','erased-0001','trainee',NULL,NULL);
INSERT INTO audit VALUES(4,1764000000000000301,'bea','backup','/b','','ada','import-1, line 1');
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
INSERT INTO chunks VALUES(2,1,40,1054887215,X'4e4c47430101270064000000000000008b00000000000000404b4c000000000040420f0000000000000000000000000000008080040000000000000000000000000000000000000100001000000000000000002f4de03e');
INSERT INTO chunks VALUES(3,0,3,2591312642,X'4e4c47430101020000000000000000000200000000000000000000000000000040420f000000000000000000000000000000808004000000000000000000000000000000000000010000000410000040c8014014024b749a');
INSERT INTO chunks VALUES(3,1,3,2782914328,X'4e4c47430101020003000000000000000500000000000000c0c62d000000000040420f000000000000000000d80400000000008080040000003c0000000000000000000000000000010000000410000040c801401418e7dfa5');
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
CREATE TABLE derived_chunks (
  session INTEGER NOT NULL REFERENCES derived_recordings (session),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  samples INTEGER NOT NULL CHECK (samples >= 1),
  crc     INTEGER NOT NULL,
  bytes   BLOB NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT;
INSERT INTO derived_chunks VALUES(3,0,3,2591312642,X'4e4c47430101020000000000000000000200000000000000000000000000000040420f000000000000000000000000000000808004000000000000000000000000000000000000010000000410000040c8014014024b749a');
INSERT INTO derived_chunks VALUES(1,0,3,2591312642,X'4e4c47430101020000000000000000000200000000000000000000000000000040420f000000000000000000000000000000808004000000000000000000000000000000000000010000000410000040c8014014024b749a');
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
INSERT INTO derived_recordings VALUES(1,0,X'647c3e1587dfb86ad87234bc02d924cc947e7fd6ac69fac35e447eab13de3656','triangle mean',333.0,1,3,88,NULL,1764000000000000105);
INSERT INTO derived_recordings VALUES(3,1,X'647c3e1587dfb86ad87234bc02d924cc947e7fd6ac69fac35e447eab13de3656','triangle mean',333.0,1,3,88,X'9dda5335f0b3c5b9fbd83f6c565f540d30a6cb8e05877c2a9673c5809c20263e',1764000000000000102);
CREATE TABLE exercises (
  id            TEXT PRIMARY KEY,
  curriculum_id TEXT NOT NULL,
  position      INTEGER NOT NULL,              -- in its curriculum, from 0
  name          TEXT NOT NULL,
  profile_id    TEXT NOT NULL,
  json          TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO exercises VALUES('knee-1','basics',0,'First','knee-adult','{"id":"knee-1"}');
CREATE TABLE meta (
  key   TEXT PRIMARY KEY,
  value TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO meta VALUES('audit_before_chain','2');
INSERT INTO meta VALUES('codes_required','1');
INSERT INTO meta VALUES('created_unix_ns','1764000000000000000');
INSERT INTO meta VALUES('engine_version','0.1.0');
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
CREATE TABLE removed_originals (
  session         INTEGER PRIMARY KEY REFERENCES sessions (number),
  removed_unix_ns INTEGER NOT NULL,                    -- of the first step, from original to thinned or deleted
  deleted_unix_ns INTEGER,                             -- NULL while a thinned recording is there
  reason          TEXT NOT NULL,                       -- the policy in words, of the last step
  by_whom         TEXT NOT NULL,
  leftover        INTEGER NOT NULL CHECK (leftover IN (0, 1)),  -- 1: rows in chunks or derived_chunks are still to be removed
  crcs            BLOB NOT NULL CHECK (length(crcs) % 4 = 0)
) STRICT;
INSERT INTO removed_originals VALUES(3,1764000000000000103,NULL,'thinned to 333 Hz after 30 days','retention',1,X'024b749a18e7dfa5ee0de696');
INSERT INTO removed_originals VALUES(4,1764000000000000104,1764000000000000104,'deleted after 365 days','retention',0,X'024b749a18e7dfa5ee0de696');
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
INSERT INTO retention_policies VALUES('',NULL,NULL,1.0,NULL,0,'ada',1764000000000000100);
INSERT INTO retention_policies VALUES('knee-1',30,333.0,1.0,365,0,'mia',1764000000000000101);
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
, events INTEGER CHECK (events IS NULL OR events >= 0), recording INTEGER NOT NULL DEFAULT 1 CHECK (recording BETWEEN 1 AND 3), passed INTEGER CHECK (passed IN (0, 1)), excused INTEGER NOT NULL DEFAULT 0 CHECK (excused IN (0, 1)), erased INTEGER NOT NULL DEFAULT 0 CHECK (erased IN (0, 1))) STRICT;
INSERT INTO sessions VALUES(1,X'010000000000000000000000000000aa','station-1','anna','knee-1','knee-adult',1,'{"id":"knee-adult"}','0.1.0',1000.0,1700000000000000000,X'0a10010000000000000000000000000000aa120973746174696f6e2d311a04616e6e6122066b6e65652d312a0a6b6e65652d6164756c7430014205302e312e30490000000000408f405209098dedb5a0f7c6b03e588080a8b1e39fe7cb176a0973696d756c6174656472389a9999999999b93f00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f',2,3,9,266,2,X'647c3e1587dfb86ad87234bc02d924cc947e7fd6ac69fac35e447eab13de3656',1764000000000000007,1764000000000000008,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',-5,1000,2,1,1,0,0);
INSERT INTO sessions VALUES(2,X'02000000000000000000000000000000','station-1','anna','knee-1','knee-adult',1,'{"id":"knee-adult"}','0.1.0',1000.0,1700000000000000000,X'0a1002000000000000000000000000000000120973746174696f6e2d311a04616e6e6122066b6e65652d312a0a6b6e65652d6164756c7430014205302e312e30490000000000408f405209098dedb5a0f7c6b03e588080a8b1e39fe7cb176a0973696d756c6174656472389a9999999999b93f00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f',1,0,0,0,0,NULL,1764000000000000007,NULL,NULL,NULL,NULL,NULL,1,NULL,1,0);
INSERT INTO sessions VALUES(3,X'03000000000000000000000000000000','station-1','anna','knee-1','knee-adult',1,'{"id":"knee-adult"}','0.1.0',1000.0,1700000000000000000,X'0a1003000000000000000000000000000000120973746174696f6e2d311a04616e6e6122066b6e65652d312a0a6b6e65652d6164756c7430014205302e312e30490000000000408f405209098dedb5a0f7c6b03e588080a8b1e39fe7cb176a0973696d756c6174656472389a9999999999b93f00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f',2,3,9,266,3,X'647c3e1587dfb86ad87234bc02d924cc947e7fd6ac69fac35e447eab13de3656',1764000000000000007,1764000000000000008,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',-5,1000,NULL,2,NULL,0,0);
INSERT INTO sessions VALUES(4,X'04000000000000000000000000000000','station-1','anna','knee-1','knee-adult',1,'{"id":"knee-adult"}','0.1.0',1000.0,1700000000000000000,X'0a1004000000000000000000000000000000120973746174696f6e2d311a04616e6e6122066b6e65652d312a0a6b6e65652d6164756c7430014205302e312e30490000000000408f405209098dedb5a0f7c6b03e588080a8b1e39fe7cb176a0973696d756c6174656472389a9999999999b93f00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000f03f',3,3,9,266,3,X'647c3e1587dfb86ad87234bc02d924cc947e7fd6ac69fac35e447eab13de3656',1764000000000000007,1764000000000000008,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',-5,1000,0,3,NULL,0,1);
CREATE TABLE stations (
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  key_hash        BLOB NOT NULL CHECK (length(key_hash) = 32),  -- BLAKE2b-256 of the 32-byte key
  revoked         INTEGER NOT NULL DEFAULT 0 CHECK (revoked IN (0, 1)),
  created_unix_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO stations VALUES('station-1',X'0000000000000000000000000000000000000000000000000000000000000000',0,1);
CREATE TABLE IF NOT EXISTS "assignments" (
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
INSERT INTO assignments VALUES(1,NULL,'knee-1',NULL,'anna',NULL,'ina',1764000000000000006);
INSERT INTO assignments VALUES(2,'basics',NULL,'class-a',NULL,1765000000000000000,'mia',1764000000000000205);
CREATE TABLE IF NOT EXISTS "people" (
  name            TEXT PRIMARY KEY CHECK (length(name) BETWEEN 1 AND 64),
  role            INTEGER NOT NULL CHECK (role BETWEEN 1 AND 6 AND role <> 5),
  password_hash   TEXT,                        -- argon2id; NULL: cannot log in
  disabled        INTEGER NOT NULL DEFAULT 0 CHECK (disabled IN (0, 1)),
  created_unix_ns INTEGER NOT NULL,
  full_name       TEXT NOT NULL DEFAULT '',
  revision        INTEGER NOT NULL DEFAULT 1 CHECK (revision >= 1),
  changed_unix_ns INTEGER NOT NULL,
  changed_by      TEXT NOT NULL DEFAULT ''     -- '': as it was made
, code_hash TEXT) STRICT, WITHOUT ROWID;
INSERT INTO people VALUES('anna',1,NULL,0,1764000000000000000,'Anna A.',3,1764000000000000202,'mia','$argon2id$v=19$m=65536,t=2,p=1$Y29kZXNhbHRjb2Rlc2FsdA$Y29kZWhhc2hjb2RlaGFzaGNvZGVoYXNoY29kZWhhc2g');
INSERT INTO people VALUES('ina',2,'$argon2id$v=19$m=65536,t=2,p=1$c2FsdHNhbHRzYWx0c2FsdA$aGFzaGhhc2hoYXNoaGFzaGhhc2hoYXNoaGFzaGhhc2g',0,1764000000000000001,'',1,1764000000000000001,'',NULL);
INSERT INTO people VALUES('old',4,NULL,1,1764000000000000002,'',1,1764000000000000002,'',NULL);
INSERT INTO people VALUES('rea',6,NULL,0,1764000000000000200,'Rea Searcher',2,1764000000000000201,'ada',NULL);
CREATE TABLE groups (
  id              TEXT PRIMARY KEY CHECK (length(id) BETWEEN 1 AND 64),
  name            TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  changed_by      TEXT NOT NULL,
  changed_unix_ns INTEGER NOT NULL,
  removed         INTEGER NOT NULL DEFAULT 0 CHECK (removed IN (0, 1))   -- the row stays, so that its revision goes on
) STRICT, WITHOUT ROWID;
INSERT INTO "groups" VALUES('class-a','Class A',2,'mia',1764000000000000203,0);
INSERT INTO "groups" VALUES('gone','Gone',4,'mia',1764000000000000204,1);
CREATE TABLE group_members (
  group_id TEXT NOT NULL REFERENCES groups (id),
  person   TEXT NOT NULL REFERENCES people (name),
  PRIMARY KEY (group_id, person)
) STRICT, WITHOUT ROWID;
INSERT INTO group_members VALUES('class-a','anna');
CREATE TABLE consents (
  id          INTEGER PRIMARY KEY,
  person      TEXT NOT NULL REFERENCES people (name),
  given       INTEGER NOT NULL CHECK (given IN (0, 1)),
  unix_ns     INTEGER NOT NULL,
  recorded_by TEXT NOT NULL,
  note        TEXT NOT NULL
) STRICT;
INSERT INTO consents VALUES(1,'anna',1,1764000000000000206,'ina','paper 7');
INSERT INTO consents VALUES(2,'anna',0,1764000000000000207,'anna','');
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
INSERT INTO scores VALUES(1,1,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',1,1,'0.1.0',1764000000000000008);
INSERT INTO scores VALUES(1,2,'[]',NULL,0,'0.2.0',1764000000000000208);
INSERT INTO scores VALUES(3,1,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',NULL,1,'0.1.0',1764000000000000008);
INSERT INTO scores VALUES(4,1,'[{"measure":"elapsed_s","value":1,"unit":"s"}]',NULL,1,'0.1.0',1764000000000000008);
CREATE TABLE exercise_references (
  exercise_id     TEXT NOT NULL,
  revision        INTEGER NOT NULL CHECK (revision >= 1),
  sessions        TEXT NOT NULL,               -- JSON list of session ids as text
  by_whom         TEXT NOT NULL,
  created_unix_ns INTEGER NOT NULL,
  PRIMARY KEY (exercise_id, revision)
) STRICT, WITHOUT ROWID;
INSERT INTO exercise_references VALUES('knee-1',1,'["03000000-0000-0000-0000-000000000000"]','mia',1764000000000000209);
CREATE TABLE erasures (
  pseudonym       TEXT PRIMARY KEY,
  name_hash       BLOB NOT NULL CHECK (length(name_hash) = 32),
  erased_unix_ns  INTEGER NOT NULL,
  by_whom         TEXT NOT NULL,
  reason          TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO erasures VALUES('erased-0001',X'0000000000000000000000000000000000000000000000000000000000000000',1764000000000000210,'ada','asked for it');
CREATE TABLE import_pieces (
  import_id   TEXT NOT NULL,
  position    INTEGER NOT NULL,
  records     TEXT NOT NULL,                   -- one a line
  by_whom     TEXT NOT NULL,
  unix_ns     INTEGER NOT NULL,
  PRIMARY KEY (import_id, position)
) STRICT;
INSERT INTO import_pieces VALUES('i1',0,'{"kind":"header"}','ada',1764000000000000211);
CREATE TABLE session_progress (
  session      INTEGER PRIMARY KEY REFERENCES sessions (number),
  chunks       INTEGER NOT NULL DEFAULT 0 CHECK (chunks >= 0),
  samples      INTEGER NOT NULL DEFAULT 0 CHECK (samples >= 0),
  stored_bytes INTEGER NOT NULL DEFAULT 0 CHECK (stored_bytes >= 0)
) STRICT;
INSERT INTO session_progress VALUES(2,2,42,174);
CREATE TABLE unknown_trainees (
  session          INTEGER PRIMARY KEY REFERENCES sessions (number),
  given            TEXT NOT NULL,   -- the name that the station gave; a station that asks again still gives it
  by_whom          TEXT,            -- the manager who assigned it; NULL: it waits
  assigned_unix_ns INTEGER, code_unchecked INTEGER NOT NULL DEFAULT 0 CHECK (code_unchecked IN (0, 1)),
  CHECK ((by_whom IS NULL) = (assigned_unix_ns IS NULL))
) STRICT;
INSERT INTO unknown_trainees VALUES(1,'anna',NULL,NULL,1);
INSERT INTO unknown_trainees VALUES(2,'anna',NULL,NULL,0);
INSERT INTO unknown_trainees VALUES(3,'ana','mia',1764000000000000212,0);
CREATE TABLE quarantined_chunks (
  session INTEGER NOT NULL REFERENCES sessions (number),
  seq     INTEGER NOT NULL CHECK (seq >= 0),
  reason  TEXT NOT NULL,
  PRIMARY KEY (session, seq)
) STRICT, WITHOUT ROWID;
INSERT INTO quarantined_chunks VALUES(2,1,'gesture chunk: its columns end early or hold impossible values, though the CRC agrees');
CREATE TABLE audit_chain (
  position   INTEGER PRIMARY KEY CHECK (position >= 1),
  line       INTEGER NOT NULL REFERENCES audit (id),
  salt       BLOB CHECK (length(salt) = 32),           -- NULL: a later entry of the line has its text
  commitment BLOB NOT NULL CHECK (length(commitment) = 32),
  key_id     BLOB NOT NULL CHECK (length(key_id) = 8),
  mac        BLOB NOT NULL CHECK (length(mac) = 32)
) STRICT;
INSERT INTO audit_chain VALUES(1,3,NULL,X'c65155c8a721bbb54592ee5982abe176415199145679e16d652e6078c4c0fe63',X'c1019f455ac71485',X'f796268eff5de369547061cbd7f0a7e45629db16415c66035f0947edcf0819ba');
INSERT INTO audit_chain VALUES(2,4,X'0404040404040404040404040404040404040404040404040404040404040404',X'39bca6f515145469fee24aab3e6805f469fb2c70821e29f611596d05a223e9c1',X'c1019f455ac71485',X'939d2e3b1f2474dace843a55dcdb71716defecc3bdbb08efd829f35802ccfee1');
INSERT INTO audit_chain VALUES(3,3,X'0505050505050505050505050505050505050505050505050505050505050505',X'26839e8ce921526e8250e4c2fb321a79a654543eb3beac82b2eae0b9462c1327',X'c1019f455ac71485',X'83f32f4ce93e2ccc9ca7a2a4a0bad845a01ad01abfcddb723c550bd6ecfdd748');
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
INSERT INTO attempt_sums VALUES('knee-1','anna',3,1,1,0,0,1,0,0,0);
CREATE TABLE station_claims (
  station       TEXT PRIMARY KEY REFERENCES stations (name),
  epoch         INTEGER NOT NULL CHECK (epoch > 0),
  server        TEXT NOT NULL,                        -- its name among the servers
  since_unix_ns INTEGER NOT NULL                      -- by that server's clock
) STRICT, WITHOUT ROWID;
INSERT INTO station_claims VALUES('station-1',3,'b',1700000000000000000);
CREATE TABLE access_numbers (
  what   INTEGER NOT NULL CHECK (what BETWEEN 0 AND 4),
  name   TEXT NOT NULL,
  number INTEGER NOT NULL,
  how    TEXT NOT NULL,          -- in a word, for a message
  server TEXT NOT NULL,          -- whose program changed it; '': another one
  PRIMARY KEY (what, name)
) STRICT, WITHOUT ROWID;
INSERT INTO access_numbers VALUES(0,'',3,'','');
INSERT INTO access_numbers VALUES(1,'ina',2,'password','');
INSERT INTO access_numbers VALUES(3,'ina',3,'log-out','server-a');
CREATE TABLE login_tokens (
  hash            BLOB PRIMARY KEY CHECK (length(hash) = 32),   -- BLAKE2b-256 of the token
  name            TEXT NOT NULL,
  role            INTEGER NOT NULL,
  account_unix_ns INTEGER NOT NULL,          -- created_unix_ns of the person who logged in
  access_number   INTEGER NOT NULL,          -- of the person, then
  password_ns     INTEGER NOT NULL,          -- the log-in with the password behind it
  expires_ns      INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO login_tokens VALUES(X'4242424242424242424242424242424242424242424242424242424242424242','ina',2,1764000000000000001,2,1764000000000000400,1764000900000000400);
CREATE TABLE login_attempts (
  kind          INTEGER NOT NULL,            -- LoginRow::Kind
  key           BLOB NOT NULL CHECK (length(key) = 32),
  failures      REAL NOT NULL,
  at_ns         INTEGER NOT NULL,
  wait_until_ns INTEGER NOT NULL,
  PRIMARY KEY (kind, key)
) STRICT, WITHOUT ROWID;
INSERT INTO login_attempts VALUES(1,X'4343434343434343434343434343434343434343434343434343434343434343',2.5,1764000000000000500,0);
CREATE TABLE noted_reads (
  key   BLOB PRIMARY KEY CHECK (length(key) = 32),
  at_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO noted_reads VALUES(X'4444444444444444444444444444444444444444444444444444444444444444',1764000000000000600);
DELETE FROM sqlite_sequence;
INSERT INTO sqlite_sequence VALUES('audit',4);
INSERT INTO sqlite_sequence VALUES('assignments',2);
CREATE INDEX exercises_by_curriculum ON exercises (curriculum_id, position);
CREATE INDEX sessions_by_station ON sessions (station, state);
CREATE INDEX sessions_by_trainee ON sessions (trainee);
CREATE INDEX sessions_by_start ON sessions (started_unix_ns);
CREATE INDEX annotations_by_session ON annotations (session, tick);
CREATE INDEX removed_originals_leftover ON removed_originals (session) WHERE leftover = 1;
CREATE INDEX sessions_by_age ON sessions (recording, exercise_id, closed_unix_ns);
CREATE UNIQUE INDEX assignments_once ON assignments
  (coalesce(course_id, ''), coalesce(exercise_id, ''), coalesce(group_id, ''), coalesce(trainee, ''));
CREATE INDEX assignments_by_trainee ON assignments (trainee);
CREATE INDEX assignments_by_group ON assignments (group_id);
CREATE INDEX group_members_by_person ON group_members (person);
CREATE INDEX consents_by_person ON consents (person, id);
CREATE UNIQUE INDEX scores_first ON scores (session) WHERE first = 1;
CREATE INDEX sessions_by_attempt ON sessions (trainee, exercise_id, started_unix_ns);
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
CREATE INDEX unknown_trainees_waiting ON unknown_trainees (session) WHERE by_whom IS NULL;
CREATE VIEW uncounted_sessions AS
  SELECT u.session FROM unknown_trainees u JOIN sessions s ON s.number = u.session
  WHERE u.by_whom IS NULL AND (u.code_unchecked = 1 OR EXISTS (SELECT 1 FROM people WHERE name = s.trainee));
CREATE TRIGGER quarantine_ends AFTER DELETE ON chunks BEGIN
  DELETE FROM quarantined_chunks WHERE session = OLD.session AND seq = OLD.seq;
END;
CREATE INDEX audit_chain_lines ON audit_chain (line, position);
CREATE VIEW attempt_steps AS SELECT 0 AS session, 0 AS sign;
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
CREATE INDEX sessions_by_verdict ON sessions (trainee, exercise_id, coalesce(passed, 0),
  (length(replace(coalesce(score_json, ''), ' ', '')) -
   length(replace(replace(coalesce(score_json, ''), ' ', ''), '"passed":true', ''))) / 13, started_unix_ns)
  WHERE excused = 0 AND state <> 1;
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
CREATE INDEX attempt_sums_by_trainee ON attempt_sums (trainee);
CREATE VIEW attempt_counts AS
  SELECT exercise_id, trainee, sessions, attempts + nobodys * waiting_attempts AS attempts,
    counted + nobodys * waiting_counted AS counted, judged + nobodys * waiting_judged AS judged,
    passed + nobodys * waiting_passed AS passed
  FROM (SELECT a.*, CASE WHEN a.waiting_attempts > 0 AND NOT EXISTS (SELECT 1 FROM people p WHERE p.name = a.trainee) THEN 1 ELSE 0 END
          AS nobodys FROM attempt_sums a) AS sums;
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
CREATE INDEX access_by_number ON access_numbers (number);
CREATE INDEX login_tokens_by_name ON login_tokens (name);
CREATE INDEX login_tokens_by_end ON login_tokens (expires_ns);
CREATE INDEX login_attempts_by_time ON login_attempts (kind, at_ns);
CREATE INDEX noted_reads_by_time ON noted_reads (at_ns);
CREATE TRIGGER people_access AFTER UPDATE OF role, password_hash, disabled ON people
  WHEN OLD.role <> NEW.role OR OLD.password_hash IS NOT NEW.password_hash OR OLD.disabled <> NEW.disabled BEGIN
  INSERT INTO access_numbers (what, name, number, how, server) VALUES (0, '', 1, '', '')
    ON CONFLICT (what, name) DO UPDATE SET number = number + 1;
  INSERT INTO access_numbers (what, name, number, how, server)
    SELECT 1, NEW.name, number,
      CASE WHEN NEW.disabled <> 0 THEN 'disabled' WHEN OLD.role <> NEW.role THEN 'role' ELSE 'password' END, ''
    FROM access_numbers WHERE what = 0
    ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, how = excluded.how, server = excluded.server;
  DELETE FROM login_tokens WHERE name = NEW.name;
END;
CREATE TRIGGER people_access_ends AFTER DELETE ON people BEGIN
  INSERT INTO access_numbers (what, name, number, how, server) VALUES (0, '', 1, '', '')
    ON CONFLICT (what, name) DO UPDATE SET number = number + 1;
  INSERT INTO access_numbers (what, name, number, how, server)
    SELECT 4, '', number, 'erased', '' FROM access_numbers WHERE what = 0
    ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, server = excluded.server;
  DELETE FROM access_numbers WHERE what IN (1, 3) AND name = OLD.name;
  DELETE FROM login_tokens WHERE name = OLD.name;
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
COMMIT;
PRAGMA user_version=12;