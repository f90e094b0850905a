#!/usr/bin/env python3
"""What is wrong with --store: one line that says what and what to do, exit code 2, nothing served; an outage is 1, so that systemd tries again.
While the server runs /healthz says the line, and the server goes on by itself when it is mended.

usage: bad_input_test.py BIN

Starts needlelab-server and needlelab-admin on a cluster of PostgreSQL, and on a program that speaks the beginning of its protocol and says
that it is version 14. No password is in what they say and write, nor in the list of processes. Without PostgreSQL 15 it exits with 77.
"""
import contextlib
import json
import os
import pathlib
import socket
import struct
import subprocess
import sys
import threading

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "faults"))
from clusters import Cluster, give, main_on_postgres, until  # noqa: E402
from programs import fetched  # noqa: E402

RIGHT, WRONG = "open sesame 17", "let me in 18"
ROLES = ("owner", "keeper", "plain", "banned", "unlisted")
ACCESS = """local  all   needlelab  trust
local  kept  keeper     scram-sha-256
local  all   banned     reject
local  all   owner      trust
local  all   plain      trust
"""


class OldServer:
    """Claims to be PostgreSQL 14 to every client."""

    def __init__(self):
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.port = self.listening.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                peer, _ = self.listening.accept()
            except OSError:
                return
            with peer, contextlib.suppress(OSError, struct.error):
                self._greet(peer)

    @staticmethod
    def _greet(peer):
        def message(kind, body):
            return kind + struct.pack(">I", len(body) + 4) + body

        while True:
            length, code = struct.unpack(">II", peer.recv(8, socket.MSG_WAITALL))
            if code not in (80877103, 80877104):  # requests TLS or GSSAPI
                break
            peer.sendall(b"N")
        peer.recv(length - 8, socket.MSG_WAITALL)
        peer.sendall(message(b"R", struct.pack(">I", 0)) + message(b"S", b"server_version\0" + b"14.9\0") +
                     message(b"S", b"client_encoding\0UTF8\0") + message(b"K", struct.pack(">II", 1, 1)) + message(b"Z", b"I"))
        while peer.recv(4096):
            pass


class Programs:
    """needlelab-server and needlelab-admin, and what they must not do."""

    def __init__(self, bin_folder, scratch):
        self.bin, self.scratch = bin_folder, scratch
        self.environment = {name: value for name, value in os.environ.items() if not name.startswith("PG")}
        (scratch / "password").write_text("correct horse battery 15\n")
        (scratch / "password").chmod(0o600)

    def server(self, data, url):
        return [self.bin / "needlelab-server", "--data", data, "--store", url, "--listen", "127.0.0.1:0", "--port-file", self.scratch / "port", "--metrics", "0",
                "--metrics-port-file", self.scratch / "metrics", "--web", "off"]

    def add_user(self, data, url):
        return [self.bin / "needlelab-admin", "--data", data, "--store", url, "user", "add", "ada", "--role", "administrator", "--password-file",
                self.scratch / "password"]

    def run(self, command, environment=None):
        return subprocess.run([str(a) for a in command], capture_output=True, text=True, timeout=90, check=False, env={**self.environment, **(environment or {})})

    def refused(self, what, data, url, words, code=2, environment=None):
        """Both programs end with this code and one line with these words."""
        for command in (self.server(data, url), self.add_user(data, url)):
            done = self.run(command, environment)
            said = done.stdout + done.stderr
            name = pathlib.Path(command[0]).name
            assert done.returncode == code, f"{what}: {name} ended with {done.returncode}, wanted {code}: {said}"
            assert said.startswith(f"{name}: ") and said.count("\n") == 1 and said.endswith("\n"), f"{what}: not one line: {said}"
            for word in words:
                assert word in said, f"{what}: {name} does not say '{word}': {said}"
            for secret in (RIGHT, WRONG):
                assert secret not in said, f"{what}: a password is in: {said}"
            for port in ("port", "metrics"):
                assert not (self.scratch / port).exists(), f"{what}: it served"
        print(f"{what}: {code}, {said.strip()}")

    @contextlib.contextmanager
    def serving(self, data, url, environment=None):
        """The server starts, and ends cleanly."""
        log = self.scratch / "server.log"
        with open(log, "w", encoding="utf-8") as out, subprocess.Popen([str(a) for a in self.server(data, url)], stdout=out, stderr=out,
                                                                       env={**self.environment, **(environment or {})}) as server:
            try:
                until(lambda: all((self.scratch / port).exists() for port in ("port", "metrics")) or server.poll() is not None, "the server starts")
                assert server.poll() is None, log.read_text()
                yield server
            finally:
                server.terminate()
            assert server.wait(60) == 0, log.read_text()
        for port in ("port", "metrics"):
            (self.scratch / port).unlink()

    def works(self, data, url, environment=None):
        """The server starts and ends cleanly; no password is visible to others or in a file of the data folder."""
        with self.serving(data, url, environment) as server:
            places = {name: (pathlib.Path("/proc") / str(server.pid) / name).read_bytes() for name in ("cmdline", "environ")}
        log = self.scratch / "server.log"
        places[log] = log.read_bytes()
        places.update((path, path.read_bytes()) for path in data.rglob("*") if path.is_file())
        for place, content in places.items():
            assert RIGHT.encode() not in content, f"{place} has the password"

    def health(self):
        """Code and problems of the running server."""
        status, text = fetched(self.scratch / "metrics", "/healthz")
        return status, json.loads(text)["problems"]

    def is_told(self, what, words):
        """/healthz soon returns 503 with a problem that has these words."""
        found = []

        def told():
            code, problems = self.health()
            found[:] = [problem for problem in problems if code == 503 and all(word in problem for word in words)]
            return found

        until(told, f"{what}: /healthz says {words}")
        print(f"{what}: while it runs, {found[0]}")

    def goes_on(self, what):
        until(lambda: self.health() == (200, []), f"{what}: /healthz is 200 again", 120)

    @contextlib.contextmanager
    def station_at_work(self, data):
        """A station records, and retries what is refused."""
        command = [self.bin / "needlelab-load", "--stations", "1", "--seconds", "600", "--viewers", "0", "--server",
                   f"127.0.0.1:{(self.scratch / 'port').read_text().strip()}", "--ca", data / "tls/ca.crt", "--user", "ada", "--password-file",
                   self.scratch / "password", "--quiet"]
        with open(self.scratch / "load.log", "w", encoding="utf-8") as out, subprocess.Popen([str(a) for a in command], stdout=out, stderr=out,
                                                                                             env=self.environment) as load:
            try:
                yield load
            finally:
                load.kill()


def prepare(cluster):
    """A database for each role that may have one: `own` for `owner`, `kept` for `keeper`, who has a password; `closed` for neither."""
    cluster.make()
    cluster.sql("".join(f"CREATE ROLE {role} LOGIN;" for role in ROLES) + f"ALTER ROLE keeper PASSWORD '{RIGHT}'", "postgres")
    like = "TEMPLATE template0 ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C'"
    for name, owner in (("own", "owner"), ("other", "owner"), ("kept", "keeper"), ("closed", "needlelab")):
        cluster.sql(f"CREATE DATABASE {name} OWNER {owner} {like}", "postgres")
    cluster.sql("CREATE DATABASE bytes OWNER owner TEMPLATE template0 ENCODING 'SQL_ASCII' LC_COLLATE 'C' LC_CTYPE 'C'", "postgres")
    access = cluster.data / "pg_hba.conf"
    access.write_text(ACCESS)
    give(access)
    cluster.sql("SELECT pg_reload_conf()", "postgres")


def addresses(programs, scratch):
    new = scratch / "new"
    for url, words in (("mysql://lab", ["is not a PostgreSQL address", "postgresql://USER@HOST:5432/DATABASE"]),
                       (f"postgresql://anna:{WRONG.replace(' ', '%20')}@127.0.0.1:1/lab", ["has a password", "passfile=FILE"]),
                       ("postgresql://anna@127.0.0.1:1/lab?sslmode=very", ["invalid sslmode value", "Look at the address"])):
        programs.refused("a wrong URL", new, url, words)
    # no resolver is available everywhere; by the C library's own answer
    name = "no-such-host.invalid"
    try:
        socket.getaddrinfo(name, 5432)
        raise AssertionError(f"{name} exists")
    except socket.gaierror as error:
        code = 1 if error.errno == socket.EAI_AGAIN else 2
    programs.refused("a host that does not exist", new, f"postgresql://anna@{name}/lab", [name], code)
    with socket.socket() as bound:  # but not listening: no other program gets the port
        bound.bind(("127.0.0.1", 0))
        closed = bound.getsockname()[1]
        programs.refused("a host that is down", new, f"postgresql://anna@127.0.0.1:{closed}/lab", ["Connection refused"], 1)
        programs.refused("one of two hosts may come back", new, f"postgresql://anna@127.0.0.1:{closed},{name}:5432/lab", ["Connection refused"], 1)
    old = OldServer()
    programs.refused("an old server", new, f"postgresql://anna@127.0.0.1:{old.port}/lab", ["is PostgreSQL 14", "needs 15 or later", "upgrade"])


def access_and_rights(programs, scratch, cluster):
    def url(role, database, more=""):
        return f"postgresql://{role}@/{database}?host={cluster.folder}{more}"

    new = scratch / "new"
    programs.refused("no such database", new, url("owner", "none"), ["database \"none\" does not exist", "Look at the address"])
    programs.refused("no such user", new, url("nobody", "own"), ["nobody", "pg_hba.conf"])
    programs.refused("a rule that rejects", new, url("banned", "own"), ["pg_hba.conf rejects connection"])
    programs.refused("no rule", new, url("unlisted", "own"), ["no pg_hba.conf entry"])
    programs.refused("no right to the database", new, url("plain", "closed"),
                     ["may not make the schema needlelab", "GRANT CREATE ON DATABASE closed TO plain"])
    cluster.sql("REVOKE CONNECT ON DATABASE closed FROM PUBLIC", "postgres")
    programs.refused("no right to connect", new, url("plain", "closed"), ["permission denied for database \"closed\""])
    programs.refused("an encoding without order", new, url("owner", "bytes"), ["SQL_ASCII", "create it again"])

    right, wrong = scratch / "right", scratch / "wrong"
    for file, word in ((right, RIGHT), (wrong, WRONG)):
        file.write_text(f"*:*:*:keeper:{word}\n")
        file.chmod(0o600)
    kept = scratch / "kept"
    programs.refused("no password", new, url("keeper", "kept"), ["no password supplied", "PGPASSFILE; mode 0600"])
    programs.refused("a wrong password", new, url("keeper", "kept", f"&passfile={wrong}"), ["password authentication failed", "PGPASSFILE; mode 0600"])
    programs.works(kept, url("keeper", "kept", f"&passfile={right}"))
    programs.works(kept, url("keeper", "kept"), {"PGPASSFILE": str(right)})
    programs.refused("a wrong password of a lab in use", kept, url("keeper", "kept"), ["password authentication failed"], environment={"PGPASSFILE": str(wrong)})
    # the server's own connection slot is blocked for now
    cluster.sql("ALTER ROLE keeper CONNECTION LIMIT 0", "postgres")
    programs.refused("too many connections", kept, url("keeper", "kept"), ["too many connections for role"], 1, {"PGPASSFILE": str(right)})
    cluster.sql("ALTER ROLE keeper CONNECTION LIMIT -1", "postgres")


def schemas(programs, scratch, cluster):
    own, url = scratch / "own", f"postgresql://owner@/own?host={cluster.folder}"
    programs.works(own, url)
    version = cluster.sql("SELECT version FROM needlelab.schema_version", "own")
    for changed, words, code in (("99", ["its schema has version 99", "use the newer program"], 2), ("0", ["has 0, and not one version"], 1)):
        cluster.sql(f"UPDATE needlelab.schema_version SET version = {changed}", "own")
        programs.refused(f"schema {changed}", own, url, words, code)
    cluster.sql(f"UPDATE needlelab.schema_version SET version = {version}", "own")
    cluster.sql("REVOKE ALL ON SCHEMA needlelab FROM owner", "own")
    programs.refused("no right to the schema", own, url, ["may not use the schema needlelab", "GRANT ALL ON SCHEMA needlelab TO owner"])
    cluster.sql("GRANT ALL ON SCHEMA needlelab TO owner; REVOKE INSERT ON needlelab.chunks FROM owner", "own")
    programs.refused("no right to a table", own, url, ["needlelab.chunks", "GRANT ALL ON ALL TABLES IN SCHEMA needlelab TO owner"])
    notify = "EXECUTE ON FUNCTION pg_catalog.pg_notify(text, text)"
    cluster.sql(f"GRANT ALL ON needlelab.chunks TO owner; REVOKE {notify} FROM PUBLIC", "own")
    programs.refused("no right to tell of changes of access", own, url, ["may not call pg_notify", f"GRANT {notify} TO owner"])
    cluster.sql(f"GRANT {notify} TO PUBLIC", "own")
    cluster.sql("GRANT ALL ON needlelab.chunks TO owner; GRANT ALL ON SCHEMA needlelab TO plain; GRANT ALL ON ALL TABLES IN SCHEMA needlelab TO plain", "own")
    programs.refused("somebody else's schema", own, url.replace("owner@", "plain@"), ["belongs to 'owner'", "OWNER TO"])
    programs.refused("a lab's database for a new folder", scratch / "new", url, ["in use by a lab whose keys are in another folder"])
    other, other_url = scratch / "other", f"postgresql://owner@/other?host={cluster.folder}"
    programs.works(other, other_url)
    programs.refused("another lab's store", own, other_url, ["belongs to the lab", "check the address"])
    programs.works(own, url)


def exchange(cluster, name, other):
    """Swaps the names of two databases, and makes their clients reconnect."""
    both = f"('{name}', '{other}')"
    cluster.sql(f"ALTER DATABASE {name} ALLOW_CONNECTIONS false; ALTER DATABASE {other} ALLOW_CONNECTIONS false", "postgres")
    end(cluster, both)
    for old, new in ((name, "between"), (other, name), ("between", other)):
        cluster.sql(f"ALTER DATABASE {old} RENAME TO {new}", "postgres")
    cluster.sql(f"ALTER DATABASE {name} ALLOW_CONNECTIONS true; ALTER DATABASE {other} ALLOW_CONNECTIONS true", "postgres")


def end(cluster, databases):
    cluster.sql(f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname IN {databases}", "postgres")
    until(lambda: cluster.sql(f"SELECT count(*) FROM pg_stat_activity WHERE datname IN {databases}", "postgres") == "0", "no one is connected")


def while_it_runs(programs, scratch, cluster):
    """Faults that begin while a server runs: it does not end, and neither stores nor reads anything that is not the lab's."""
    own, url = scratch / "own", f"postgresql://owner@/own?host={cluster.folder}"
    done = programs.run(programs.add_user(own, url))
    assert done.returncode == 0, done.stderr
    with programs.serving(own, url):
        programs.goes_on("a lab in use")
        with programs.station_at_work(own) as load:
            def chunks():
                assert load.poll() is None, (scratch / "load.log").read_text()
                return int(cluster.sql("SELECT count(*) FROM needlelab.chunks", "own"))

            until(lambda: chunks() > 0, "a station sends chunks")
            cluster.sql("REVOKE INSERT ON needlelab.chunks FROM owner", "own")
            programs.is_told("no right to a table any more", ["not all is stored: ", "permission denied for table chunks", "42501"])
            before = chunks()
            cluster.sql("GRANT INSERT ON needlelab.chunks TO owner", "own")
            until(lambda: chunks() > before, "the station sends them again")
        programs.goes_on("the right is back")

        exchange(cluster, "own", "other")
        programs.is_told("another lab's database", ["the last change was refused: ", "the database that answers here now belongs to the lab "])
        programs.is_told("another lab's database", ["the database cannot be read: ", "the database that answers here now belongs to the lab "])
        exchange(cluster, "own", "other")
        programs.goes_on("the lab's database is back")


def play(bin_folder, scratch):
    cluster = Cluster(scratch / "pg")
    try:
        programs = Programs(bin_folder, scratch)
        addresses(programs, scratch)
        prepare(cluster)
        access_and_rights(programs, scratch, cluster)
        schemas(programs, scratch, cluster)
        while_it_runs(programs, scratch, cluster)
        said = "".join(path.read_text(errors="replace") for path in scratch.glob("*.log"))
        assert RIGHT not in said and WRONG not in said, "a password is in a log"
    finally:
        cluster.kill()


if __name__ == "__main__":
    sys.exit(main_on_postgres(__doc__, "nl-bad-", play))
