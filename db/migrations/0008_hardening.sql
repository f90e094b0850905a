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
