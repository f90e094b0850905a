#!/usr/bin/env python3
"""A server that starts on a database which lacks what was acknowledged says so, though nobody has it in memory; once.

usage: lack_test.py BIN

The database is an older copy of the cluster, or a standby that lagged and was promoted, in which others' transactions have taken the numbers
of those that are missing. Without PostgreSQL 15 it says so and exits with 77.
"""
import pathlib
import re
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "faults"))
from clusters import Cluster, main_on_postgres, run, until  # noqa: E402
from programs import Monitored, start, stop  # noqa: E402

LACKS = "does not have all that was acknowledged"


class Lab(Monitored):
    """A data folder whose server is started on one cluster or another. Its exit ends the server and the clusters."""

    def __init__(self, bin_folder, scratch):
        self.bin, self.scratch, self.data, self.server = bin_folder, scratch, scratch / "lab", None
        self.log, self.password, self.stations = scratch / "server.log", scratch / "password", 0
        self.clusters, self.metrics_file = [], scratch / "metrics"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.server is not None and self.server.poll() is None:
            self.server.kill()
            self.server.wait()
        for cluster in self.clusters:
            cluster.kill()

    def cluster(self, name):
        self.clusters.append(Cluster(self.scratch / name))
        return self.clusters[-1]

    def start(self, cluster):
        """Returns whether the log of this start reports missing data."""
        files = [self.scratch / "port", self.metrics_file]
        with open(self.log, "w", encoding="utf-8") as log:
            self.server = start(
                [self.bin / "needlelab-server", "--data", self.data, "--store", f"postgresql://needlelab@/lab?host={cluster.folder}", "--listen",
                 "127.0.0.1:0", "--port-file", files[0], "--metrics", "0", "--metrics-port-file", files[1], "--web", "off"], files, log)
        said = re.findall(r"^.*acknowledged_missing.*$", self.log.read_text(), re.MULTILINE)
        assert all(LACKS in line for line in said) and len(said) < 2, said
        return bool(said)

    def number(self):
        """The folder's number; 0: nothing yet."""
        file = self.data / "acknowledged"
        if not file.exists():
            return 0
        text = file.read_text(encoding="ascii")
        found = re.fullmatch(r"lab = [0-9a-f-]{36}\nnumber = (\d+)\n", text)
        assert found, text
        return int(found[1])

    def make_administrator(self, cluster):
        self.password.write_text("correct horse battery 15\n", encoding="ascii")
        self.password.chmod(0o600)
        run(self.bin / "needlelab-admin", "--data", self.data, "--store", f"postgresql://needlelab@/lab?host={cluster.folder}", "user", "add", "ada", "--role",
            "administrator", "--password-file", self.password)

    def wait_for_acks(self):
        """Waits until something is stored and the folder has recorded it."""
        before = self.number()
        self.stations += 1
        run(self.bin / "needlelab-admin", "--server", f"127.0.0.1:{(self.scratch / 'port').read_text().strip()}", "--ca", self.data / "tls/ca.crt", "--user",
            "ada", "--password-file", self.password, "station", "add", f"s{self.stations}", "--out", self.scratch / f"s{self.stations}.key")
        until(lambda: self.number() > before, "the folder knows what was acknowledged")

    def kill(self):
        self.server.kill()
        self.server.wait()

    def stop(self):
        stop(self.server)

    def says(self, wanted, what):
        """Also checks /healthz and the metrics."""
        problems = [text for text in self.health()["problems"] if LACKS in text]
        assert bool(problems) == wanted, f"{what}: {problems}"
        said = self.metric("needlelab_acknowledged_missing")
        assert bool(said) == wanted, f"{what}: the metric says {said}"


def older_copy(lab, a):
    lab.make_administrator(a)
    assert not lab.start(a), "a new database lacks nothing"
    lab.wait_for_acks()
    lab.stop()
    at_copy = lab.number()
    a.stop()
    older = lab.cluster("o").copy_of(a)
    a.start()
    assert not lab.start(a), "it has all"
    lab.wait_for_acks()
    lab.kill()
    assert lab.number() > at_copy
    # also after a kill between the commit and the file, the database has at least what the folder says
    stored = int(a.sql("SELECT value FROM needlelab.meta WHERE key = 'acknowledged'"))
    assert stored >= lab.number(), (stored, lab.number())
    a.stop()
    older.start()
    assert lab.start(older), "an older copy lacks what came since"
    lab.says(True, "the older copy")
    lab.wait_for_acks()
    lab.says(True, "it stays said until the server's end")
    lab.stop()
    assert not lab.start(older), "it is reported once"
    lab.says(False, "started again")
    lab.stop()
    older.stop()


def lagging_standby(lab, a):
    """`a` is stopped, and the folder has recorded more than it has: also reported once."""
    a.start()
    assert lab.start(a), "data of the older copy are not here"
    b = lab.cluster("b")
    b.follow(a)
    a.setting("synchronous_standby_names", "")
    lab.wait_for_acks()
    lab.kill()
    b.caught_up(a)
    b.stop()
    assert not lab.start(a)
    lab.wait_for_acks()
    lab.kill()
    last = int(a.sql("SELECT pg_current_xact_id()"))
    a.kill()
    b.start()
    b.promote()
    b.sql("CREATE TABLE public.others (id BIGINT)")
    while int(b.sql("INSERT INTO public.others VALUES (1); SELECT pg_current_xact_id()")) <= last:
        pass
    assert lab.start(b), "others' transactions have taken the numbers"
    lab.says(True, "the lagging standby")
    lab.stop()
    assert not lab.start(b)
    lab.stop()
    # an invalid file is not silently ignored
    (lab.data / "acknowledged").write_text("lab = x\nnumber = many\n", encoding="ascii")
    said = subprocess.run([lab.bin / "needlelab-admin", "--data", lab.data, "check"], capture_output=True, text=True, timeout=60, check=False)
    assert said.returncode == 2 and "acknowledged: is not as needlelab-server writes it" in said.stderr, said
    (lab.data / "acknowledged").unlink()
    assert not lab.start(b)
    lab.stop()


def play(bin_folder, scratch):
    with Lab(bin_folder, scratch) as lab:
        a = lab.cluster("a")
        a.make()
        older_copy(lab, a)
        lagging_standby(lab, a)


if __name__ == "__main__":
    sys.exit(main_on_postgres(__doc__, "nl-lack-", play))
