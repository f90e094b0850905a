-- The schema of version 12 on PostgreSQL: as db/migrations/0012_logins.sql, which has the reasons.
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
  account_unix_ns BIGINT NOT NULL,
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

-- Names have their schema: whoever disables somebody by psql has another search_path.

-- The row of the last number is held to the transaction's end, so numbers are committed in their order, also beside a writer that
-- does not hold the lock of the store: who has seen a number has seen all before it.
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

-- Conditions are in the functions, whose text is compared at each start (db/postgres_objects.cpp), and not in the triggers.

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
  IF TG_OP = 'DELETE' THEN
    PERFORM needlelab.raise_access(4, '', 'erased');
    DELETE FROM needlelab.access_numbers WHERE what IN (1, 3) AND name = OLD.name;
  ELSIF OLD.role <> NEW.role OR OLD.password_hash IS DISTINCT FROM NEW.password_hash OR OLD.disabled <> NEW.disabled THEN
    PERFORM needlelab.raise_access(1, NEW.name,
      CASE WHEN NEW.disabled <> 0 THEN 'disabled' WHEN OLD.role <> NEW.role THEN 'role' ELSE 'password' END);
  ELSE
    RETURN NULL;
  END IF;
  DELETE FROM needlelab.login_tokens WHERE name = OLD.name;
  RETURN NULL;
END $$;
CREATE TRIGGER people_access AFTER UPDATE OF role, password_hash, disabled ON people FOR EACH ROW EXECUTE FUNCTION people_access();
CREATE TRIGGER people_access_ends AFTER DELETE ON people FOR EACH ROW EXECUTE FUNCTION people_access();

CREATE FUNCTION stations_access() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  IF OLD.key_hash <> NEW.key_hash OR OLD.revoked <> NEW.revoked THEN
    PERFORM needlelab.raise_access(2, NEW.name, CASE WHEN NEW.revoked <> 0 THEN 'revoked' ELSE 'key' END);
  END IF;
  RETURN NULL;
END $$;
CREATE TRIGGER stations_access AFTER UPDATE OF key_hash, revoked ON stations FOR EACH ROW EXECUTE FUNCTION stations_access();
