-- Roles and database of a faculty, once, on the primary, as the user postgres:
--   psql --set=ON_ERROR_STOP=1 --file=deploy/faculty/database.sql
-- Then their passwords, which are typed twice and stored in no file and no log (psql sends the SCRAM hash):
--   psql --command='\password needlelab'   psql --command='\password needlelab_standby'

-- The server's: not a superuser, cannot create databases or roles, does not replicate. It owns only its database.
-- The standbys are not there yet, so nothing here waits for them.
SET synchronous_commit = local;

CREATE ROLE needlelab LOGIN NOSUPERUSER NOCREATEDB NOCREATEROLE NOREPLICATION NOBYPASSRLS CONNECTION LIMIT 60;
-- The standbys' and base backups': reads the whole cluster's files and log, and no tables.
CREATE ROLE needlelab_standby LOGIN REPLICATION NOSUPERUSER NOCREATEDB NOCREATEROLE CONNECTION LIMIT 10;
-- Lets deploy/faculty/backup see on which disks the cluster and its primary are.
GRANT pg_monitor TO needlelab_standby;
-- The functions that pg_rewind calls without being a superuser (PostgreSQL's documentation of pg_rewind).
GRANT EXECUTE ON FUNCTION pg_catalog.pg_ls_dir(text, boolean, boolean) TO needlelab_standby;
GRANT EXECUTE ON FUNCTION pg_catalog.pg_stat_file(text, boolean) TO needlelab_standby;
GRANT EXECUTE ON FUNCTION pg_catalog.pg_read_binary_file(text) TO needlelab_standby;
GRANT EXECUTE ON FUNCTION pg_catalog.pg_read_binary_file(text, bigint, bigint, boolean) TO needlelab_standby;

-- Texts sort by their bytes, as on SQLite.
CREATE DATABASE needlelab OWNER needlelab TEMPLATE template0 ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C';
-- As in primary.conf, also if a machine has only this file: no values of rows in the message log.
ALTER DATABASE needlelab SET log_error_verbosity = terse;
REVOKE CONNECT, TEMPORARY ON DATABASE needlelab FROM PUBLIC;
GRANT CONNECT ON DATABASE needlelab TO needlelab;

-- One slot for each machine's standby; a machine's own slot stays unused until another machine is primary. Slots are not
-- copied to standbys: after a promotion, make them at the new primary.
SELECT pg_create_physical_replication_slot(name) FROM unnest(ARRAY['b', 'c']) AS name
 WHERE NOT EXISTS (SELECT FROM pg_replication_slots WHERE slot_name = name);
