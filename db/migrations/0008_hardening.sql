-- Schema version 8. What an attacker, and a second reader of the format, showed (issue 18): one block for each subject.

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

-- Tamper evidence of the audit log (db/audit_chain.h): an entry for each line, and one more for each erasure that replaced its texts, which
-- takes the salts of the earlier ones away. mac is keyed by DIR/audit.key, which is in no backup, and covers the entry before. Nothing deletes
-- lines. Lines of before this version, up to the one that meta names, get the first entries when the chain begins.
CREATE TABLE audit_chain (
  position   INTEGER PRIMARY KEY CHECK (position >= 1),
  line       INTEGER NOT NULL REFERENCES audit (id),
  salt       BLOB CHECK (length(salt) = 32),           -- NULL: a later entry of the line has its text
  commitment BLOB NOT NULL CHECK (length(commitment) = 32),
  key_id     BLOB NOT NULL CHECK (length(key_id) = 8),
  mac        BLOB NOT NULL CHECK (length(mac) = 32)
) STRICT;
CREATE INDEX audit_chain_lines ON audit_chain (line, position);
INSERT INTO meta (key, value) SELECT 'audit_before_chain', CAST(coalesce(max(id), 0) AS TEXT) FROM audit;
-- Of a line that came by import-all: who imported it, and the import with the line's number there. NULL: it was written here.
ALTER TABLE audit ADD COLUMN imported_by TEXT;
ALTER TABLE audit ADD COLUMN imported_from TEXT;
