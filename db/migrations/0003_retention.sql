-- Schema version 3. Retention: recordings may be thinned into derived ones, or deleted, by a policy. Default: nothing is.
--
-- How to read a recording (sessions.recording):
--   1 original: `chunks` of the session, seq 0 ... sessions.chunks - 1.
--   2 thinned:  `derived_chunks` of the session, seq 0 ... derived_recordings.chunks - 1.
--   3 deleted:  nothing is left to read.
-- sessions.chunks, samples, stored_bytes, hash, score_json and events are those of the original for ever, and so are the rows of
-- session_events and annotations. For 2 and 3 there is exactly one row in removed_originals, for 1 there is none.
-- No other change of chunks is legal: a session's rows are there from 0 on without a gap, or, once `recording` is not 1, they are
-- on their way out, from the last to the first, in pieces (removed_originals.leftover = 1 until none is left).
ALTER TABLE sessions ADD COLUMN recording INTEGER NOT NULL DEFAULT 1 CHECK (recording BETWEEN 1 AND 3);

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
-- removed and begun anew). It is complete exactly when sessions.recording = 2.
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

-- What is known of an original that retention has taken away. crcs: the CRC of each of its chunks in order, u32 little-endian,
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

-- The candidates of a policy, without reading every session.
CREATE INDEX sessions_by_age ON sessions (recording, exercise_id, closed_unix_ns);
