#!/usr/bin/env python3
"""A faculty made of the files in deploy/faculty: two machines of PostgreSQL, a server that wants two disks, a verified backup, a promotion.

usage: faculty_test.py BIN

Only addresses, ports, paths and sizes of deploy/faculty's files are replaced (localised()); each replacement must find something to replace.
needlelab-load is the judge: its exit code is 0 only if nothing that it sent is lost, doubled or different, also across the promotion.
Without PostgreSQL 15 it says so and exits with 77.
"""
import json
import os
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from programs import PG, Monitored, free_port, main_on_postgres, run, start, stop, until  # noqa: E402

FACULTY = pathlib.Path(__file__).resolve().parents[2] / "deploy/faculty"
PASSWORDS = {"needlelab": "of the server 1", "needlelab_standby": "of the standbys 2"}
AS_POSTGRES = ["setpriv", "--reuid", "postgres", "--regid", "postgres", "--clear-groups"] if os.getuid() == 0 else []


def as_postgres(*arguments, environment=None, code=0):
    # not root's home: libpq looks for certificates there
    return run(*AS_POSTGRES, *arguments, environment={"HOME": "/", **(environment or {})}, code=code)


def localised(file, *replaced):
    """The text of a file from deploy/faculty, adapted to this machine."""
    text = (FACULTY / file).read_text()
    for pattern, value in replaced:
        text, found = re.subn(pattern, value, text, flags=re.MULTILINE)
        assert found, f"{file} has nothing like {pattern}"
    return text


class Machine:
    """One of the faculty's machines with PostgreSQL."""

    def __init__(self, name, scratch):
        self.name, self.scratch, self.port = name, scratch, free_port()
        self.data = scratch / name / "data"
        (scratch / name).mkdir()
        self.give(scratch / name)

    @staticmethod
    def give(path, mode=None):
        if mode is not None:
            path.chmod(mode)
        if os.getuid() == 0:
            shutil.chown(path, "postgres", "postgres")

    def write(self, name, text):
        file = self.data / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        self.give(file.parent)
        self.give(file, 0o600)

    def configure(self):
        """Common to all machines: needlelab.conf and pg_hba.conf. initdb has found out which shared memory is available."""
        config = self.data / "postgresql.conf"
        found = re.search(r"^dynamic_shared_memory_type = \w+", config.read_text() if config.exists() else "", re.M)
        self.write("postgresql.conf", f"""include_dir = 'conf.d'
{found[0] if found else ''}
port = {self.port}
unix_socket_directories = '{self.scratch}'
ssl_cert_file = '{self.scratch}/db.crt'
ssl_key_file = '{self.scratch}/db.key'
shared_buffers = '32MB'
""")
        self.write("conf.d/a-needlelab.conf", localised(
            "primary.conf", (r"^listen_addresses = .*", "listen_addresses = '127.0.0.1,127.0.1.1'"), (r"^shared_buffers.*", ""),
            ("/var/backups/needlelab-postgres", f"{self.scratch}/backups")))
        # there is not a system user for each role here, so the socket cannot use them
        self.write("pg_hba.conf", localised("pg_hba.conf", (r"192\.0\.2\.\d+/32", "127.0.0.1/32"), (r"^local +all +postgres +peer", "local all postgres trust")))

    def follow(self, other):
        self.write("conf.d/b-standby.conf", localised(
            "standby.conf", ("host=db-a.example,db-c.example port=5432", f"host=127.0.0.1 port={other.port}"), ("application_name=b", f"application_name={self.name}"),
            (r"^primary_slot_name = 'b'", f"primary_slot_name = '{self.name}'"), ("/etc/postgresql/needlelab-ca.crt", f"{self.scratch}/db.crt"),
            ("/var/lib/postgresql/needlelab-standby.pass", f"{self.scratch}/standby.pass")))
        self.write("standby.signal", "")

    def start(self):
        as_postgres(f"{PG}/pg_ctl", "-D", self.data, "-w", "-l", self.scratch / f"{self.name}.log", "start")

    def stop(self, mode="fast"):
        if (self.data / "postmaster.pid").exists():
            as_postgres(f"{PG}/pg_ctl", "-D", self.data, "-w", "-m", mode, "stop")

    def sql(self, text):
        """As the administrator; does not wait for a standby, as deploy/FACULTY.md says."""
        return run(f"{PG}/psql", "-XAtq", "-h", self.scratch, "-p", self.port, "-U", "postgres", "-v", "ON_ERROR_STOP=1", "-f", "-", text_in=text,
                   environment={"PGOPTIONS": "-c synchronous_commit=local"}).strip()

    def standby_conninfo(self, host="127.0.0.1"):
        return (f"host={host} port={self.port} user=needlelab_standby sslmode=verify-full sslrootcert={self.scratch}/db.crt"
                f" passfile={self.scratch}/standby.pass")

    def wait_for_standby(self, name):
        until(lambda: self.sql(f"SELECT sync_state FROM pg_stat_replication WHERE application_name = '{name}' AND state = 'streaming'") == "quorum",
              f"{name} follows {self.name}")


class Lab(Monitored):
    """needlelab-server with the options of deploy/faculty's drop-in."""

    def __init__(self, bin_folder, scratch, machines):
        self.bin, self.scratch, self.data = bin_folder, scratch, scratch / "lab"
        unit = (FACULTY / "needlelab-server.conf").read_text().replace("\\\n", " ")
        command = re.findall(r"^ExecStart=(\S.*)$", unit, re.MULTILINE)[-1]
        ports = ",".join(str(m.port) for m in machines)
        self.url = re.search(r'--store "([^"]*)"', command)[1].replace(
            "db-a.example,db-b.example", ",".join(f"127.0.0.1:{m.port}" for m in machines))
        assert ports.count(",") == 1 and str(machines[1].port) in self.url, self.url
        self.durability = re.search(r"--durability (\S+)", command)[1]
        assert "Environment=PGPASSFILE=" in unit and "Environment=PGSSLROOTCERT=" in unit
        self.environment = {"PGPASSFILE": str(scratch / "db.pass"), "PGSSLROOTCERT": str(scratch / "db.crt")}
        self.password = scratch / "admin.password"
        self.password.write_text("correct horse battery 15\n")
        self.password.chmod(0o644)
        run(bin_folder / "needlelab-admin", "--data", self.data, "--store", self.url, "user", "add", "ada", "--role", "administrator",
            "--password-file", self.password, environment=self.environment)
        self.server, self.metrics_file = None, scratch / "metrics"

    def start(self, durability=None):
        scratch = self.scratch
        files = [scratch / "port", self.metrics_file]
        with open(scratch / "server.log", "a", encoding="utf-8") as log:
            self.server = start(
                [self.bin / "needlelab-server", "--data", self.data, "--store", self.url, "--durability", durability or self.durability, "--listen",
                 "127.0.0.1:0", "--port-file", files[0], "--metrics", "0", "--metrics-port-file", files[1], "--web", "off"],
                files, log, {**os.environ, **self.environment})
        self.port = files[0].read_text().strip()
        shutil.copy(self.data / "tls/ca.crt", scratch / "ca.crt")
        (scratch / "ca.crt").chmod(0o644)

    def stop(self):
        stop(self.server)

    def acks_of_a_station(self, name):
        """A station of this name records and delivers two short sessions; returns each ack's (committed, Safe)."""
        key, ledger = self.scratch / f"{name}.key", self.scratch / f"{name}.jsonl"
        self.admin("station", "add", name, "--out", key)
        run(self.bin / "needlelab-durability-station", "--server", f"127.0.0.1:{self.port}", "--ca", self.scratch / "ca.crt", "--key", key, "--spool",
            self.scratch / f"spool-{name}", "--ledger", ledger, "--seed", "7", "--sessions", "2", "--rate", "100", "--push", "2000", "--samples", "1600")
        events = [json.loads(line) for line in ledger.read_text(encoding="ascii").splitlines() if '"e":"ack"' in line]
        return [(event["committed"], event["safe"]) for event in events]

    def login(self):
        return ["--server", f"127.0.0.1:{self.port}", "--ca", str(self.scratch / "ca.crt"), "--user", "ada", "--password-file", str(self.password)]

    def load(self, seconds):
        return subprocess.Popen([self.bin / "needlelab-load", "--stations", "6", "--seconds", str(seconds), "--viewers", "0", "--quiet", "--json",
                                 *self.login()], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    @staticmethod
    def judge(load):
        out, err = load.communicate(timeout=600)
        assert load.returncode == 0, f"needlelab-load: {load.returncode}\n{out[-2000:]}\n{err[-2000:]}"

    def admin(self, *arguments, code=0):
        return run(self.bin / "needlelab-admin", *self.login(), *arguments, code=code)


def make_backup(lab, machine, scratch, *options, host="127.0.0.1", bin_folder=None, code=0):
    """Runs deploy/faculty/backup as its timer does; the server reaches the restored cluster over TCP."""
    port = free_port()
    settings = scratch / "restored.conf"
    settings.write_text(f"listen_addresses = '127.0.0.1'\nport = {port}\n")
    settings.chmod(0o644)
    admin = " ".join([str(lab.bin / "needlelab-admin"), *lab.login()])
    return as_postgres(FACULTY / "backup", "--to", scratch / "backups", "--archive", scratch / "backups/wal", "--from", machine.standby_conninfo(host),
                       "--scratch", scratch / "restored", "--admin", admin, "--settings", settings, *options, "--url",
                       f"postgresql://needlelab@127.0.0.1:{port}/needlelab", environment={"NEEDLELAB_BIN": str(bin_folder or lab.bin), "NEEDLELAB_PG_BIN": PG}, code=code)


def prepare(scratch):
    """Certificate, passwords, and the backup folders."""
    run("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2", "-subj", "/CN=db",
        "-addext", "subjectAltName=IP:127.0.0.1,IP:127.0.1.1", "-keyout", scratch / "db.key", "-out", scratch / "db.crt")
    (scratch / "standby.pass").write_text(f"*:*:*:needlelab_standby:{PASSWORDS['needlelab_standby']}\n")
    (scratch / "db.pass").write_text(f"*:*:*:needlelab:{PASSWORDS['needlelab']}\n")
    (scratch / "db.pass").chmod(0o600)
    for name in ("backups", "backups/wal", "restored"):
        (scratch / name).mkdir()
        Machine.give(scratch / name, 0o700)
    for name in ("db.key", "standby.pass"):
        Machine.give(scratch / name, 0o600)
    (scratch / "db.crt").chmod(0o644)


def start_both(a, b):
    as_postgres(f"{PG}/initdb", "-D", a.data, "-U", "postgres", "-A", "trust", "-E", "UTF8", "--locale=C", "--data-checksums", "--no-sync")
    a.configure()
    a.start()
    a.sql((FACULTY / "database.sql").read_text() + "".join(f"ALTER ROLE {role} PASSWORD '{word}';\n" for role, word in PASSWORDS.items()))
    as_postgres(f"{PG}/pg_basebackup", "--dbname", a.standby_conninfo(), "--pgdata", b.data, "--slot", "b", "--checkpoint=fast")
    b.configure()
    b.follow(a)
    b.start()
    a.wait_for_standby("b")


def acks_without_two_disks(lab, machines):
    """The same machines, but the lab did not request two disks: an ack makes nothing Safe, and there is no backup."""
    lab.start("power-cut")
    acks = lab.acks_of_a_station("one-disk")
    assert max(committed for committed, _ in acks) > 1 and all(safe == 0 for _, safe in acks), acks
    stored = int(machines[0].sql("\\connect needlelab\nSELECT count(*) FROM needlelab.chunks"))
    until(lambda: lab.metric("needlelab_unsafe_chunks") == stored, "all chunks are unsafe")
    lab.stop()


def acks_of_two_disks(lab):
    """Safe = ack, without a backup: for data stored now, and for earlier data."""
    until(lambda: lab.metric("needlelab_unsafe_chunks") == 0, "no chunk is unsafe")
    acks = lab.acks_of_a_station("two-disks")
    assert max(committed for committed, _ in acks) > 1 and all(safe == committed for committed, safe in acks), acks
    assert lab.health()["backup_age_s"] is None
    assert lab.metric("needlelab_unsafe_chunks") == 0


def lesson(lab, scratch, a, b):
    # a busy machine may take longer for the first trial write than /healthz waits
    until(lambda: lab.health()["healthy"], "/healthz is content")
    found = lab.health()
    assert found["ack_survives"] == "the loss of a disk", found
    assert lab.metric("needlelab_ack_survives") == 3
    # neither without a password nor without TLS, and the server's role has no more rights than needed
    for conninfo in (f"host=127.0.0.1 port={a.port} user=needlelab dbname=needlelab sslmode=disable",
                     f"host=127.0.0.1 port={a.port} user=needlelab dbname=needlelab sslmode=require"):
        run(f"{PG}/psql", "-w", "-XAtqc", "SELECT 1", conninfo, code=2, environment={"PGPASSFILE": "/dev/null"})
    assert a.sql("SELECT rolsuper OR rolcreaterole OR rolcreatedb OR rolreplication FROM pg_roles WHERE rolname = 'needlelab'") == "f"

    acks_of_two_disks(lab)
    load = lab.load(4)
    until(lambda: lab.metric("needlelab_sessions_open") == 6, "all stations send")
    # while stations send; the folder is on the cluster's disk, or on an unknown one, also if the machine's name resolves to 127.0.1.1
    said = make_backup(lab, a, scratch, host="127.0.1.1")
    assert "made and verified" in said and re.search(r"^Safe +no$", said, re.MULTILINE), said
    lab.judge(load)
    assert lab.health()["backup_age_s"] is not None
    in_no_backup = "\\connect needlelab\nSELECT count(*) FROM needlelab.sessions WHERE safe_chunks < chunks"
    assert int(a.sql(in_no_backup)) > 0 and lab.metric("needlelab_unsafe_chunks") == 0
    # on the standby: the primary is not held up. Every session was closed before
    until(lambda: a.sql("SELECT replay_lsn >= pg_current_wal_lsn() FROM pg_stat_replication") == "t", "b has replayed all")
    # the clock was ahead for a moment: its backup is still the older one
    ahead = scratch / "backups/base-20991231T235959Z"
    next((scratch / "backups").glob("base-*")).rename(ahead)
    said = make_backup(lab, b, scratch, "--keep", "1", "--counts-as-safe")
    assert a.sql(in_no_backup) == "0", said
    assert said.count("removed the old backup") == 1, said
    kept, = (scratch / "backups").glob("base-*")
    assert kept != ahead, said
    first = re.search(r"^START WAL LOCATION: .*\(file (\w+)\)", (kept / "backup_label").read_text(), re.MULTILINE)[1]
    older = [p.name for p in (scratch / "backups/wal").iterdir() if re.fullmatch(r"\w{24}", p.name) and p.name < first]
    assert not older, f"{older} in the archive, needed is {first}"
    # the lab's own database proves nothing
    assert "own database" in lab.admin("backup", "verified", "--restored", f"postgresql://needlelab@127.0.0.1:{a.port}/needlelab", "--counts-as-safe", code=2)


def crc32c(data):
    value = 0xFFFFFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0x82F63B78 if value & 1 else 0)
    return value ^ 0xFFFFFFFF


def damaged_chunk(a):
    """An open session with a sealed but undecodable chunk (common/gesture/FORMAT.md), as the server stores it."""
    sealed = b"NLGC" + bytes([1, 2]) + struct.pack("<HQQqqI", 9, 0, 9, 0, 1_000_000, 0) + bytes(range(200))
    sealed += struct.pack("<I", crc32c(sealed))
    columns = a.sql("\\connect needlelab\nSELECT string_agg(column_name, ', ') FROM information_schema.columns WHERE table_schema = 'needlelab'"
                    " AND table_name = 'sessions' AND column_name NOT IN ('number', 'id', 'state', 'hash', 'closed_unix_ns', 'score_json', 'events', 'passed',"
                    " 'chunks', 'samples', 'stored_bytes', 'safe_chunks')")
    a.sql(f"""\\connect needlelab
SET search_path = needlelab;
INSERT INTO sessions (id, state, {columns}) SELECT decode(md5('damaged'), 'hex'), 1, {columns} FROM sessions ORDER BY number LIMIT 1;
INSERT INTO chunks SELECT number, 0, 10, {crc32c(sealed[:-4])}, '\\x{sealed.hex()}' FROM sessions WHERE state = 1;
UPDATE session_progress SET chunks = 1, samples = 10, stored_bytes = {len(sealed)};
INSERT INTO quarantined_chunks SELECT number, 0, 'test' FROM sessions WHERE state = 1;""")


def backups_go_on(lab, scratch, a):
    """A station's damaged chunk and an erasure do not prevent backups; the next one removes the leftovers of a killed one."""
    damaged_chunk(a)
    lab.admin("user", "add", "otto", "--role", "trainee")
    lab.admin("person", "erase", "otto", "--confirm", "otto")
    killer = scratch / "killer"
    killer.mkdir()
    (killer / "needlelab-admin").write_text("#!/bin/sh\nexec kill -KILL $PPID\n")
    (killer / "needlelab-admin").chmod(0o755)
    killer.chmod(0o755)
    make_backup(lab, a, scratch, bin_folder=killer, code=-signal.SIGKILL)
    left, = (scratch / "restored").iterdir()
    server = int((left / "data/postmaster.pid").read_text().split()[0])
    assert os.path.exists(f"/proc/{server}"), "the restored cluster runs"
    said = make_backup(lab, a, scratch, "--keep", "1", "--counts-as-safe")
    assert "made and verified" in said and re.search(r"^as in its original: .*chunk 0", said, re.MULTILINE), said
    assert not os.path.exists(f"/proc/{server}") and not list((scratch / "restored").iterdir())
    assert "otto" not in a.sql("\\connect needlelab\nSELECT string_agg(name, ' ') FROM needlelab.people")
    a.sql("""\\connect needlelab
SET search_path = needlelab;
DELETE FROM quarantined_chunks;
DELETE FROM chunks WHERE session IN (SELECT number FROM sessions WHERE state = 1);
DELETE FROM session_progress;
DELETE FROM sessions WHERE state = 1;""")
    assert a.sql("SHOW log_error_verbosity") == "terse"


def standby_lost(lab, a, b):
    b.stop("immediate")
    until(lambda: "a trial write was not committed in time" in lab.health()["problems"], "/healthz says that nothing is stored", 120)
    b.start()
    a.wait_for_standby("b")
    until(lambda: lab.health()["healthy"], "the server continues with the standby", 120)


def promoted(lab, a, b):
    """deploy/FACULTY.md, "The primary is lost", step by step, while stations send."""
    load = lab.load(8)
    until(lambda: lab.metric("needlelab_sessions_open") == 6, "all stations send")
    a.stop("immediate")
    as_postgres(f"{PG}/pg_ctl", "-D", b.data, "-w", "promote")
    # before its first checkpoint pg_rewind finds nothing to do
    b.sql("CHECKPOINT; SELECT pg_create_physical_replication_slot('a')")
    # the old primary may have data that were never acknowledged
    said = as_postgres(f"{PG}/pg_rewind", "--target-pgdata", a.data, "--source-server", b.standby_conninfo() + " dbname=postgres")
    assert "no rewind required" not in said, said
    a.configure()
    a.follow(b)
    a.start()
    b.wait_for_standby("a")
    lab.judge(load)
    until(lambda: lab.health()["healthy"], "the server is healthy after the promotion", 120)
    assert lab.health()["ack_survives"] == "the loss of a disk"
    lab.admin("check")


def restored(b, scratch):
    """deploy/FACULTY.md, "Restore": the base backup from before the promotion, and the archive across it."""
    wal = b.sql("SELECT pg_walfile_name(pg_switch_wal())")
    until(lambda: b.sql(f"SELECT coalesce(max(last_archived_wal), '') >= '{wal}' FROM pg_stat_archiver") == "t", "the log is archived")
    r = Machine("r", scratch)
    base, = (scratch / "backups").glob("base-*")
    as_postgres("cp", "-a", base, r.data)
    r.configure()
    (r.data / "conf.d/b-standby.conf").unlink(missing_ok=True)
    (r.data / "standby.signal").unlink(missing_ok=True)
    r.write("conf.d/restore.conf", f"restore_command = 'cp {scratch}/backups/wal/%f %p'\narchive_mode = off\n")
    r.write("recovery.signal", "")
    try:
        r.start()
        until(lambda: r.sql("SELECT pg_is_in_recovery()") == "f", "the restored machine has read the archive")
        everything = "\\connect needlelab\nSELECT count(*), sum(length(bytes)), sum(crc) FROM needlelab.chunks"
        found = r.sql(everything)
        assert found == b.sql(everything) and not found.startswith("0|"), found
    finally:
        r.stop("immediate")


def play(bin_folder, scratch):
    Machine.give(scratch)
    lab, machines = None, ()
    try:
        prepare(scratch)
        machines = Machine("a", scratch), Machine("b", scratch)
        start_both(*machines)
        lab = Lab(bin_folder, scratch, machines)
        acks_without_two_disks(lab, machines)
        lab.start()
        for step in (lambda: lesson(lab, scratch, *machines), lambda: backups_go_on(lab, scratch, machines[0]), lambda: standby_lost(lab, *machines), lambda: promoted(lab, *machines),
                     lambda: restored(machines[1], scratch)):
            begun = time.monotonic()
            step()
            print(f"{time.monotonic() - begun:.1f} s")
        lab.stop()
    finally:
        if lab is not None and lab.server is not None and lab.server.poll() is None:
            lab.server.kill()
            lab.server.wait()
        for machine in machines:
            machine.stop("immediate")


if __name__ == "__main__":
    sys.exit(main_on_postgres(__doc__, "nl-fac-", play))
