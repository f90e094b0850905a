"""A lab on PostgreSQL under test: server, stations with ledgers, and the judge of tests/durability applied to PostgreSQL's data."""
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "durability" / part) for part in ("judge", "harness")]
from database import Database  # noqa: E402
from ledger import Ledgers  # noqa: E402
from verdict import Judgement, judge_all  # noqa: E402,F401  pylint: disable=unused-import
from clusters import PG, Cluster, Failed, run, until  # noqa: E402
from programs import LedgerFolder, Monitored, start, stop  # noqa: E402

__all__ = ["Judgement"]  # for modules that import them from here

PASSWORD = "correct horse battery 15"
STATIONS = 3
# a station's message about a server that lacks acknowledged data
LACKS = re.compile(r"^session .*: the server (?:lacks what it had acknowledged|no longer has all of it).*$", re.MULTILINE)

# the tables that the judge reads, with their columns; those in BYTES are written as hexadecimal digits
TABLES = {
    "sessions": "number, id, station, state, chunks, samples, stored_bytes, recording, hash, description",
    "session_progress": "session, chunks, samples, stored_bytes",
    "chunks": "session, seq, samples, crc, bytes",
    "quarantined_chunks": "session, seq",
}
BYTES = {"id", "hash", "description", "bytes"}


def rows_in(cluster, path):
    """Copies a cluster's data, as of one instant, to a file that the judge reads. Returns its Database."""
    def columns(table):
        return [name.strip() for name in TABLES[table].split(",")]

    def of(name):
        return f"encode({name}, 'hex')" if name in BYTES else f"{name}::text"

    marks = [f"SELECT '{table}'; SELECT {', '.join(map(of, columns(table)))} FROM needlelab.{table};" for table in TABLES]
    said = path.with_suffix(".tsv")
    run(PG / "psql", "-XAtq", "-F", "\t", "-h", cluster.folder, "-U", "needlelab", "-d", "lab", "-v", "ON_ERROR_STOP=1", "-o", said, "-f", "-",
        text_in="BEGIN ISOLATION LEVEL REPEATABLE READ;" + "".join(marks))
    path.unlink(missing_ok=True)
    copy = sqlite3.connect(path)
    for table in TABLES:
        copy.execute(f"CREATE TABLE {table} ({TABLES[table]})")
    table = None
    with open(said, encoding="utf-8") as lines:
        for line in map(lambda whole: whole.removesuffix("\n"), lines):
            if line in TABLES:
                table = line
                continue
            values = []
            for name, value in zip(columns(table), line.split("\t"), strict=True):
                if name in BYTES:
                    values.append(bytes.fromhex(value) if value or name != "hash" else None)
                else:
                    values.append(value if name == "station" else int(value))
            copy.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(values))})", values)
    copy.commit()
    copy.close()
    said.unlink()
    return Database(path)


class Template:
    """A cluster and a data folder with people and keys, copied by every lab."""

    def __init__(self, bin_folder, folder, stations=STATIONS):
        self.bin, self.folder = pathlib.Path(bin_folder).resolve(), folder
        self.cluster = Cluster(folder / "t")
        self.cluster.make()
        password = folder / "password"
        password.write_text(PASSWORD + "\n")
        password.chmod(0o600)
        data = folder / "lab"
        run(self.bin / "needlelab-admin", "--data", data, "--store", f"postgresql://needlelab@/lab?host={self.cluster.folder}", "user", "add", "ada",
            "--role", "administrator", "--password-file", password)
        self.stations = [f"station-{i}" for i in range(1, stations + 1)]
        for name in self.stations:
            run(self.bin / "needlelab-admin", "--data", data, "station", "add", name, "--out", folder / f"{name}.key")
        self.cluster.stop()


class FaultLab(LedgerFolder, Monitored):
    """Use it as a context manager: its exit ends all processes. cluster() and standby_of() create its clusters."""

    def __init__(self, template, folder, plant=None):
        self.template_of, self.folder, self.plant = template, folder, plant
        self.programs, self.template = self, template.folder  # as the rude client expects
        folder.mkdir(mode=0o755)
        super().__init__()
        self.metrics_file = folder / "metrics"
        shutil.copytree(template.folder / "lab", folder / "data")
        self.clusters, self.server, self.stations, self.port = [], None, {}, 0
        self.expect_lacks = False  # that the server lacks acknowledged data
        self.weakened = False
        self.faults_played = 0
        self.mounted = None
        self._log = open(folder / "log", "ab")  # pylint: disable=consider-using-with
        self._environment = dict(os.environ)
        self._environment.pop("NEEDLELAB_PLANT", None)
        if plant is not None:
            self._environment["NEEDLELAB_PLANT"] = plant

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [self.server, *self.stations.values()]:
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait()
        for cluster in self.clusters:
            cluster.signal_all(signal.SIGCONT)
            cluster.kill()
        self._log.close()
        if self.mounted is not None:
            run("umount", self.mounted)

    def said(self):
        texts = [(self.folder / "log").read_text(errors="replace")[-3000:]]
        for cluster in self.clusters:
            if (cluster.folder / "log").exists():
                texts.append(f"--- {cluster.folder.name}\n" + (cluster.folder / "log").read_text(errors="replace")[-1500:])
        return "\n".join(texts)

    # --- PostgreSQL ---
    def new_cluster(self, name, environment=None):
        """A cluster that is not created yet."""
        made = Cluster(self.folder / name)
        self.clusters.append(made)
        made.environment = environment or {}
        return made

    def cluster(self, name, environment=None):
        """A running primary with the lab's empty database."""
        made = self.new_cluster(name, environment)
        made.copy_of(self.template_of.cluster).start()
        return made

    def standby_of(self, primary, name, environment=None):
        made = self.new_cluster(name, environment)
        made.follow(primary)
        return made

    def small_disk(self, name, mebibytes):
        """A cluster that is not created yet, on its own disk."""
        made = self.new_cluster(name)
        run("mount", "-t", "tmpfs", "-o", f"size={mebibytes}m,mode=0755", "tmpfs", made.folder)
        self.mounted = made.folder
        run("chown", "--reference", self.template_of.cluster.data, made.folder)
        return made

    def room_for(self, name, mebibytes):
        """A running primary on a small disk."""
        made = self.small_disk(name, mebibytes)
        made.copy_of(self.template_of.cluster).start()
        return made

    def copy_of_stopped(self, other, name):
        """Keeps the data of a standby that is not running, for later."""
        made = Cluster(self.folder / name).copy_of(other)
        self.clusters.append(made)
        return made

    @staticmethod
    def kill_clusters(*clusters):
        for cluster in clusters:
            cluster.kill()

    @staticmethod
    def url(*clusters):
        hosts = ",".join(str(cluster.folder) for cluster in clusters)
        return f"postgresql://needlelab@/lab?host={hosts}&target_session_attrs=read-write"

    # --- the server ---
    def start_server(self, url, durability="power-cut"):
        store = self.folder / "data/store"
        store.write_text(re.sub(r"^url = .*$", f"url = {url}", store.read_text(), flags=re.MULTILINE))
        files = [self.folder / "port", self.metrics_file]
        self.server = start([self.template_of.bin / "needlelab-durability-server", "--data", self.folder / "data", "--listen", f"127.0.0.1:{self.port}",
                             "--port-file", files[0], "--metrics", "0", "--metrics-port-file", files[1], "--web", "off", "--durability", durability],
                            files, self._log, self._environment)
        self.port = int(files[0].read_text())

    def kill_server(self):
        self.server.kill()
        self.server.wait()

    def stop_server(self):
        stop(self.server)

    # --- stations ---
    def start_stations(self, seed, names=None, sessions=1000, samples=2000):
        for i, name in enumerate(names or self.template_of.stations):
            self._start_station(name, seed * 100 + i, sessions, samples)

    def _start_station(self, name, seed, sessions, samples):
        self.stations[name] = subprocess.Popen(  # pylint: disable=consider-using-with
            [self.template_of.bin / "needlelab-durability-station", "--server", f"127.0.0.1:{self.port}", "--ca", self.folder / "data/tls/ca.crt",
             "--key", self.template / f"{name}.key", "--spool", self.folder / f"spool-{name}", "--ledger", self.folder / "ledger" / f"{name}.jsonl",
             "--seed", str(seed), "--sessions", str(sessions), "--samples", str(samples), "--drain", "240"],
            env=self._environment, stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log)

    def end_stations(self):
        """They stop recording, and the server gets everything in their spools: some minutes' work on a busy machine."""
        for process in self.stations.values():
            process.terminate()
        for again in (False, True):
            for name in self.stations:
                if again:  # also what a station gave up at its end
                    self._start_station(name, 0, 0, 1)
            for name, process in self.stations.items():
                if (code := process.wait(300)) not in (0, -signal.SIGTERM):
                    raise Failed(f"{name} ended with {code}")

    def start_load(self, stations, seconds):
        return subprocess.Popen(
            [self.template_of.bin / "needlelab-load", "--stations", str(stations), "--seconds", str(seconds), "--viewers", "0", "--server",
             f"127.0.0.1:{self.port}", "--ca", self.folder / "data/tls/ca.crt", "--user", "ada", "--password-file", self.template / "password",
             "--quiet", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    # --- ledgers ---
    def silent_for(self, seconds):
        """Raises Failed if anything is acknowledged within this time."""
        before = self.count("ack")
        time.sleep(seconds)
        if (more := self.count("ack") - before) > 0:
            raise Failed(f"{more} acks that may not be")

    def lines(self, event):
        """How often the server's log contains it."""
        return len(re.findall(rf"\b{event}\b", (self.folder / "log").read_text(errors="replace")))

    # --- the judge ---
    def judge(self, cluster, at_end, others=()):
        """The judgement of the cluster's data; data reported as Safe must be in each of `others`, too. Nothing may be acknowledged meanwhile."""
        rows = rows_in(cluster, self.folder / "judged.db")
        covered = [{s.id: len(s.chunks) for s in rows_in(other, self.folder / "other.db").sessions.values()} for other in others]
        time.sleep(0.05)  # acks are still on their way to the ledgers
        judgement = judge_all(rows, Ledgers(self.folder / "ledger", 100e6), covered, at_end)
        log = (self.folder / "log").read_text(errors="replace")
        if not self.expect_lacks:
            judgement.faults += [("acknowledged-but-missing", line) for line in LACKS.findall(log)]
        return judgement

    def finish(self, cluster, *others):
        """Waits until everything is delivered; the server must be healthy and end cleanly. Returns the final judgement."""
        self.end_stations()
        until(lambda: self.health()["healthy"] or self.expect_lacks, "the server is healthy")
        self.stop_server()
        for other in others:
            other.caught_up(cluster)
        return self.judge(cluster, True, others)
