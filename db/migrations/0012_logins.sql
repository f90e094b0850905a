-- Schema version 12. What servers that work on one database at a time know of each other's log-ins (db/login_store.h), and
-- numbers of changes of access (db/access_numbers.h). One server alone keeps log-ins in its memory, and nothing here.

-- Of each account whose access changed, the number of its last change; of all of them each gets the next one. `what`: 0 the last
-- number given; of a person 1 role, password, disabled, 3 a log-out; 2 of a station its key; 4 that somebody was erased, whose
-- name nobody may know afterwards.
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
  name            TEXT NOT NULL,
  role            INTEGER NOT NULL,
  account_unix_ns INTEGER NOT NULL,          -- created_unix_ns of the person who logged in
  access_number   INTEGER NOT NULL,          -- of the person, then
  password_ns     INTEGER NOT NULL,          -- the log-in with the password behind it
  expires_ns      INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX login_tokens_by_name ON login_tokens (name);
CREATE INDEX login_tokens_by_end ON login_tokens (expires_ns);

-- Failures, and where somebody has logged in. The keys are keyed hashes: what is typed as a name may be a password.
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
