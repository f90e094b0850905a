"""A skills lab under test: one server, stations with ledgers, backups, kills; and the judge of the result."""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[1] / "judge"), str(pathlib.Path(__file__).resolve().parents[2] / "support")]
from crash_page import CrashPage  # noqa: E402
from stalls import Witnesses, real_time_allowed  # noqa: E402
from database import Database, chunks_in  # noqa: E402
from ledger import Ledgers  # noqa: E402
from programs import PATIENCE_S, Failed, LedgerFolder, run, start, stop, until  # noqa: E402,F401
from verdict import judge_all  # noqa: E402

__all__ = ["until"]  # for modules that import them from here

LOSS_MS = 20  # allowed loss of a killed station if its writer may have real-time priority (client/net/README.md)
REACH_NS = 60_000_000  # a stall of the machine up to this long before a kill may matter


def loss_ms(given):
    """As given; otherwise the promise, which the short form stretches by 50 ms because it runs beside others, or five times the promise if the writer
    is an ordinary thread."""
    if given is not None:
        return given
    if real_time_allowed():
        return LOSS_MS if os.environ.get("NEEDLELAB_LONG") else LOSS_MS + 50
    print(f"no real-time priority here: a killed station may lose {5 * LOSS_MS} ms")
    return 5 * LOSS_MS


class Programs:
    """Paths of the programs, and a prepared data folder; each lab starts with a copy of it."""

    def __init__(self, bin_folder, stations=4):
        self.bin = pathlib.Path(bin_folder).resolve()
        self._folder = tempfile.TemporaryDirectory(prefix="durability-")
        self.template = pathlib.Path(self._folder.name)
        data, password = self.template / "data", self.template / "password"
        password.write_text("correct horse battery\n")
        password.chmod(0o600)
        self.admin("--data", data, "user", "add", "ada", "--role", "administrator", "--password-file", password)
        self.stations = [f"station-{i}" for i in range(1, stations + 1)]
        for name in self.stations:
            self.admin("--data", data, "station", "add", name, "--out", self.template / f"{name}.key")

    def admin(self, *arguments):
        run(self.bin / "needlelab-admin", *arguments)


class Lab(LedgerFolder):
    """Use it as a context manager: its exit ends all processes. `plant`: the planted bug of server and stations."""

    def __init__(self, programs, plant=None, loss=LOSS_MS):
        self.programs, self.plant, self.loss_ns = programs, plant, loss * 1e6
        self.witnesses, self.most_held_up_ns = Witnesses(), 0
        self._folder = tempfile.TemporaryDirectory(prefix="durability-lab-")
        self.folder = pathlib.Path(self._folder.name)
        shutil.copytree(programs.template / "data", self.folder / "data")
        super().__init__()
        self.page = CrashPage(self.folder / "crash-page")
        self.server, self.stations, self.backups, self.port = None, {}, [], 0
        self._log = open(self.folder / "log", "ab")  # pylint: disable=consider-using-with
        self._environment = dict(os.environ, NEEDLELAB_CRASH_PAGE=str(self.page.path))
        self._environment.pop("NEEDLELAB_PLANT", None)
        if plant is not None:
            self._environment["NEEDLELAB_PLANT"] = plant

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [self.server, *self.stations.values()]:
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
        self.witnesses.end()
        self._log.close()
        self._folder.cleanup()

    def said(self):
        return (self.folder / "log").read_text(errors="replace")[-3000:]

    # --- the server ---
    def start_server(self):
        self.page.disarm()
        port_file = self.folder / "port"
        self.server = start([self.programs.bin / "needlelab-durability-server", "--data", self.folder / "data", "--listen", f"127.0.0.1:{self.port}",
                             "--port-file", port_file, "--log-level", "warning"], [port_file], self._log, self._environment)
        self.port = int(port_file.read_text())

    def kill_server(self):
        """Kills the server now. Returns its phase."""
        self.server.kill()
        return self.server_died()

    def server_died(self):
        self.server.wait(PATIENCE_S)
        if self.server.returncode != -signal.SIGKILL:
            raise Failed(f"the server ended with {self.server.returncode}")
        return self.page.get("phase")

    def stop_server(self):
        stop(self.server)

    # --- stations ---
    def start_station(self, name, seed=1, sessions=1, samples=300):
        if name in self.stations and self.stations[name].poll() is None:
            raise Failed(f"{name} runs already")
        self.stations[name] = subprocess.Popen(  # pylint: disable=consider-using-with
            [self.programs.bin / "needlelab-durability-station", "--server", f"127.0.0.1:{self.port}",
             "--ca", self.folder / "data" / "tls" / "ca.crt", "--key", self.programs.template / f"{name}.key",
             "--spool", self.folder / f"spool-{name}", "--ledger", self.folder / "ledger" / f"{name}.jsonl",
             "--seed", str(seed), "--sessions", str(sessions), "--samples", str(samples), "--drain", str(PATIENCE_S)],
            env=self._environment, stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log)

    def kill_station(self, name):
        process = self.stations[name]
        at = time.monotonic_ns()
        process.kill()
        process.wait()
        if process.returncode == -signal.SIGKILL:  # it may just have ended by itself
            held_up = self.witnesses.held_up_ns(at - REACH_NS, at)
            self.most_held_up_ns = max(self.most_held_up_ns, held_up)
            self.note(e="kill", station=name, t=at, held_up=held_up)

    def stop_station(self, name):
        """Sends SIGTERM: the station stops recording and drains its spool."""
        self.stations[name].terminate()

    def end_station(self, name):
        """Waits until the station has finished."""
        try:
            code = self.stations[name].wait(PATIENCE_S + 30)
        except subprocess.TimeoutExpired as error:
            raise Failed(f"{name} does not end") from error
        if code not in (0, -signal.SIGTERM):  # it may not have begun when it was told to stop
            raise Failed(f"{name} ended with {code}")

    def drain(self, names):
        """Uploads all spools to the server."""
        for name in names:
            if name in self.stations:
                self.end_station(name)
        for name in names:
            self.start_station(name, sessions=0)
        for name in names:
            self.end_station(name)

    # --- backups ---
    def backup(self):
        """Online."""
        path = self.folder / f"backup-{len(self.backups)}.db"
        self.programs.admin("--server", f"127.0.0.1:{self.port}", "--ca", self.folder / "data" / "tls" / "ca.crt", "--user", "ada",
                            "--password-file", self.programs.template / "password", "backup", path, "--counts-as-safe")
        self.backups.append(path)

    def restore(self, backup):
        """Replaces the database of the stopped server, as db/README.md describes."""
        database = self.folder / "data" / "needlelab.db"
        shutil.copy(backup, database)
        for suffix in ("-wal", "-shm"):
            pathlib.Path(str(database) + suffix).unlink(missing_ok=True)
        self.note(e="restore", t=time.time_ns())

    # --- the judge ---
    def judge(self, at_end):
        """Returns the faults, as (name, text). The server must not be running."""
        if self.server is not None and self.server.poll() is None:
            raise Failed("a running server's database cannot be judged")
        time.sleep(0.03)  # the server's last messages are still on their way to the ledgers
        ledgers = Ledgers(self.folder / "ledger", self.loss_ns)
        return judge_all(Database(self.folder / "data" / "needlelab.db"), ledgers, [chunks_in(b) for b in self.backups], at_end)
