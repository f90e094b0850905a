"""PostgreSQL clusters that keep their promises (fsync), with standbys, and what can happen to them."""
import os
import pathlib
import shutil
import signal
import socket
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
from programs import PG, Failed, main_on_postgres, run, until  # noqa: E402,F401  pylint: disable=unused-import

__all__ = ["Failed", "main_on_postgres"]  # for modules that import them from here

AS_POSTGRES = ["setpriv", "--reuid", "postgres", "--regid", "postgres", "--clear-groups"] if os.getuid() == 0 else []
MOST_CONNECTIONS = 24


def give(path):
    if os.getuid() == 0:
        shutil.chown(path, "postgres", "postgres")


class Cluster:
    """One PostgreSQL server; FOLDER/data, reached through a socket in FOLDER, whose name is also its standby name. `environment`: for its processes.
    With `address` it also listens there, in the network that `enter` (a command before its own) leads to."""

    def __init__(self, folder):
        self.folder, self.data = pathlib.Path(folder), pathlib.Path(folder) / "data"
        self.folder.mkdir(mode=0o755)
        give(self.folder)
        self.environment, self.enter, self.address = {}, [], ""

    def make(self):
        """An empty one with the lab's database."""
        run(*AS_POSTGRES, PG / "initdb", "-D", self.data, "-U", "needlelab", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync", "--wal-segsize=1")
        with open(self.data / "postgresql.conf", "a", encoding="ascii") as settings:
            # everything that may differ between two of them is passed at the start
            settings.write(f"listen_addresses = ''\nmax_connections = {MOST_CONNECTIONS}\nshared_buffers = 16MB\nmin_wal_size = 2MB\n"
                           "max_wal_size = 8MB\nwal_keep_size = 16MB\nwal_receiver_status_interval = 1s\nwal_retrieve_retry_interval = 100ms\n")
        self.start()
        self.sql("CREATE DATABASE lab TEMPLATE template0 ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C'", "postgres")

    def copy_of(self, other):
        """Copies the data of one that is not running, for the same role."""
        run("cp", "-a", other.data, self.folder)
        return self

    def follow(self, primary):
        """Becomes a standby of `primary`, synchronous under the name of its folder. Both are running afterwards."""
        shutil.rmtree(self.data, ignore_errors=True)
        run(*AS_POSTGRES, PG / "pg_basebackup", "-h", primary.folder, "-U", "needlelab", "-D", self.data, "-R", "--checkpoint=fast", "--no-sync")
        with open(self.data / "postgresql.auto.conf", "a", encoding="ascii") as settings:
            settings.write(f"primary_conninfo = 'host={primary.folder} user=needlelab application_name={self.folder.name}'\n")
        self.start()
        primary.setting("synchronous_standby_names", f"ANY 1 ({self.folder.name})")
        until(lambda: primary.sql("SELECT count(*) FROM pg_stat_replication WHERE sync_state = 'quorum'", "postgres") == "1",
              f"{self.folder.name} follows {primary.folder.name}")

    def start(self):
        # it may have been killed a moment ago, and its children must notice that
        until(lambda: not self.everybody(), "the earlier processes end")
        # only for PostgreSQL: not for a program that is still root's
        added = [f"{name}={value}" for name, value in self.environment.items()]
        listens = f"-k {self.folder}" + (f" -h {self.address}" if self.address else "")
        run(*self.enter, *AS_POSTGRES, "env", *added, PG / "pg_ctl", "-D", self.data, "-w", "-l", self.folder / "log", "-o", listens, "start")

    def stop(self, mode="fast"):
        if (self.data / "postmaster.pid").exists():
            run(*AS_POSTGRES, PG / "pg_ctl", "-D", self.data, "-w", "-m", mode, "stop")

    def everybody(self):
        """The processes with this data folder: the postmaster and its children."""
        found = []
        for process in pathlib.Path("/proc").iterdir():
            try:
                if process.name.isdigit() and os.readlink(process / "cwd") == str(self.data) and (process / "comm").read_text() == "postgres\n":
                    found.append(int(process.name))
            except OSError:
                pass
        return found

    def signal_all(self, number):
        for pid in self.everybody():
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                pass

    def kill(self):
        """Kills everything at once, as if the machine were lost."""
        self.signal_all(signal.SIGSTOP)  # so that no child sees another one's end
        gone = self.everybody()
        self.signal_all(signal.SIGKILL)
        # also those waiting for their parent: PostgreSQL does not start while the old postmaster's number is in use
        until(lambda: not any(pathlib.Path(f"/proc/{pid}").exists() for pid in gone), "all processes end")

    def promote(self):
        run(*AS_POSTGRES, PG / "pg_ctl", "-D", self.data, "-w", "promote")

    def sql(self, text, database="lab"):
        """As the administrator, without waiting for a standby."""
        return run(PG / "psql", "-XAtq", "-h", self.folder, "-U", "needlelab", "-d", database, "-v", "ON_ERROR_STOP=1", "-f", "-", text_in=text,
                   environment={"PGOPTIONS": "-c synchronous_commit=local"}).strip()

    def setting(self, name, value):
        """For the whole cluster, at once."""
        self.sql(f"ALTER SYSTEM SET {name} = '{value}'", "postgres")
        self.sql("SELECT pg_reload_conf()", "postgres")
        until(lambda: self.sql(f"SELECT current_setting('{name}')", "postgres") == value, f"{name} = {value}")

    def caught_up(self, primary):
        """Whether it has replayed everything that the primary has."""
        at = primary.sql("SELECT pg_current_wal_lsn()")
        until(lambda: self.sql(f"SELECT pg_last_wal_replay_lsn() >= '{at}'") == "t", "the standby has replayed all")

    def replayed(self):
        """For a standby: everything on its disk can be read, except the beginning of a record whose rest the primary never sent: PostgreSQL's startup
        process then waits for it; checked twice."""
        look = ("SELECT pg_last_wal_receive_lsn(), pg_last_wal_replay_lsn() >= pg_last_wal_receive_lsn(), "
                "(SELECT wait_event FROM pg_stat_activity WHERE backend_type = 'startup') = 'RecoveryWalStream'")

        def has_all():
            first = self.sql(look)
            time.sleep(0.2)
            return first.split("|")[1] == "t" or first.endswith("|t") and self.sql(look) == first
        until(has_all, "the standby has replayed what it has")


class Session:
    """One connection to a cluster, using only the protocol: it occupies a slot, and runs queries."""

    def __init__(self, cluster):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(60)
        try:
            self.socket.connect(str(cluster.folder / ".s.PGSQL.5432"))
            body = struct.pack(">I", 196608) + b"user\0needlelab\0database\0postgres\0application_name\0hog\0\0"
            self.socket.sendall(struct.pack(">I", len(body) + 4) + body)
            self.refused = self._until_ready()
        except OSError as error:
            self.refused = str(error)

    def _take(self, count):
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                raise ConnectionError("closed")
            data += more
        return data

    def _until_ready(self):
        error = ""
        while True:
            kind, length = struct.unpack(">cI", self._take(5))
            body = self._take(length - 4)
            if kind == b"E":
                error = body.decode(errors="replace").replace("\0", " ")
                if " FATAL " in f" {error}":
                    return error
            if kind == b"Z":
                return error

    def ask(self, sql):
        body = sql.encode() + b"\0"
        self.socket.sendall(b"Q" + struct.pack(">I", len(body) + 4) + body)
        self._until_ready()

    def close(self):
        self.socket.close()
