"""A faculty under test: two servers on one database with a synchronous standby, NATS between them, stations that know both servers, and viewers."""
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "postgres" / "faults"))
import clusters  # noqa: E402
from clusters import Failed, run, until  # noqa: E402
from fault_lab import FaultLab, Template  # noqa: E402
from programs import PATIENCE_S, fetched, free_port, metric_in, start, stop  # noqa: E402
from scenarios import POWER_CUT, TWO_DISKS, CannotPlay, sound  # noqa: E402,F401  pylint: disable=unused-import

__all__ = ["sound"]  # for modules that import them from here
import measures  # noqa: E402
from cables import Here, NoNamespaces, Switch  # noqa: E402
from viewers import Viewer  # noqa: E402

clusters.MOST_CONNECTIONS = 80  # for two servers
NATS = "nats-server"
# name -> how the servers are distinguished: in station_claims (serverNameOf: the folder that created the database is "first"), and by --live-name
SERVERS = {"a": "first", "b": "b"}
OTHER = {"a": "b", "b": "a"}
GROUPS = ("stations-1", "stations-2")  # every second station; those in the first group ask server a first
MACHINES = ("a", "b", "db-a", "db-b", "db-c", "nats", *GROUPS, "viewers")
PORT, NATS_PORT = 7750, 4222  # if they are separate machines
# Two chunks per second from each station: the cost of 1 kHz does not matter here, and two cores must not cause delays.
RATE_HZ, PUSH_HZ, SAMPLES = 20, 40, 600
VIEW_HZ, OVERVIEW_HZ = 5, 2
GUARD_NS = 150_000_000  # what is in transit at the moment of a fault still arrives
SETTLE_S = 1.5
ROOM_FOR_SPOOLS = 1 << 30
CLOCK_SHIM = "needlelab_clock_shim"
# like deploy/faculty/nats-server.conf, except for TLS and users
NATS_CONF = """max_payload: 256KB
max_pending: 16MB
write_deadline: "2s"
ping_interval: "5s"
ping_max: 2
"""


def nats_is_here():
    return shutil.which(NATS) is not None


def faculty_template(bin_folder, folder, stations):
    """Like Template, with servers that may be on other machines of the lab's network."""
    template = Template(bin_folder, folder, stations)
    with open(template.cluster.data / "pg_hba.conf", "a", encoding="ascii") as rules:
        rules.write("host all needlelab 10.77.1.0/24 trust\n")
    return template


class FacultyLab(FaultLab):
    """`separate`: each part is a separate machine (cables.py); otherwise all are on this one. `stations`: their number. `ahead_s`: how far the clock
    of a server or a station is ahead. Use it as a context manager."""

    def __init__(self, template, folder, stations, plant=None, separate=False, ahead_s=None):
        super().__init__(template, folder, plant)
        self.names = template.stations[:stations]
        self.ahead_s = ahead_s or {}
        self.acks = measures.AckTimes(folder / "ledger", {name: seconds * 10**9 for name, seconds in self.ahead_s.items()})
        self.stations_away, self.viewers_away = measures.Away(), measures.Away()
        self.is_timed = True  # within()
        self.findings = []  # (name, text), like the judge's
        self.notes = []  # further measurements of a scenario
        self.servers, self.ports, self.viewers, self.nats = {}, {}, [], None
        self.primary = self.standby = self.spare = None
        self.servers_of_stations, self.durability = None, TWO_DISKS
        self.ca = folder / "data/tls/ca.crt"
        self.viewers_log = open(folder / "viewers.log", "ab")  # pylint: disable=consider-using-with
        shared = pathlib.Path("/dev/shm")
        room = shutil.disk_usage(shared).free if shared.is_dir() and os.access(shared, os.W_OK) else 0
        # a station's spool syncs every few milliseconds; its power is never cut here
        self.spools = pathlib.Path(tempfile.mkdtemp(prefix="nl-spools-", dir=shared if room > ROOM_FOR_SPOOLS else folder))
        try:
            self.cables = Switch(MACHINES) if separate else None
        except NoNamespaces as why:
            self._clean_up()
            raise CannotPlay(str(why)) from why

    def _clean_up(self):
        self.viewers_log.close()
        shutil.rmtree(self.spools, ignore_errors=True)

    def __exit__(self, *error):
        self.end_viewers()
        for process in [*self.servers.values(), self.nats]:
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait()
        try:
            return super().__exit__(*error)
        finally:
            if self.cables is not None:
                self.cables.close()
            self._clean_up()

    def within(self, seconds):
        """The time limit for something that must happen. In the short form, beside all other tests, it must only happen; the long form also judges
        how soon."""
        return seconds if self.is_timed else PATIENCE_S

    def said(self):
        logs = [self.folder / "log", self.folder / "viewers.log", self.folder / "nats.log", *(self.folder / f"log-{name}" for name in SERVERS)]
        logs += [cluster.folder / "log" for cluster in self.clusters]
        return "\n".join(f"--- {path.relative_to(self.folder)}\n" + path.read_text(errors="replace")[-2000:] for path in logs if path.exists())

    def place(self, name):
        return Here if self.cables is None else self.cables.machines[name]

    def environment_of(self, name):
        """For a server's or a station's program."""
        if name not in self.ahead_s:
            return self._environment
        shim = self.template_of.bin / CLOCK_SHIM
        if not shim.exists():
            raise CannotPlay(f"{shim} is not built")
        return {**self._environment, "LD_PRELOAD": str(shim), "NEEDLELAB_CLOCK_AHEAD_S": str(self.ahead_s[name])}

    # --- PostgreSQL ---
    def new_cluster(self, name, environment=None):
        made = super().new_cluster(name, environment)
        if self.cables is not None:
            made.enter, made.address = self.place(f"db-{name}").enter, self.place(f"db-{name}").address
        return made

    def url(self, *hosts):  # pylint: disable=arguments-differ
        if self.cables is None:
            return super().url(*hosts)
        return (f"postgresql://needlelab@{','.join(cluster.address for cluster in hosts)}/lab?sslmode=disable&target_session_attrs=read-write"
                "&connect_timeout=5")

    def is_followed(self):
        return self.primary.sql("SELECT count(*) FROM pg_stat_replication WHERE sync_state = 'quorum'", "postgres") == "1"

    # --- NATS ---
    def start_nats(self):
        if self.nats is None:
            self.ports["nats"] = NATS_PORT if self.cables is not None else free_port()
            (self.folder / "nats.conf").write_text(NATS_CONF)
        place = self.place("nats")
        with open(self.folder / "nats.log", "ab") as log:
            self.nats = subprocess.Popen([*place.enter, NATS, "-c", self.folder / "nats.conf", "-a", place.address, "-p", str(self.ports["nats"])],
                                         stdin=subprocess.DEVNULL, stdout=log, stderr=log)  # pylint: disable=consider-using-with

        def answers():
            if self.nats.poll() is not None:
                raise Failed(f"nats-server ended with {self.nats.returncode}")
            try:
                socket.create_connection((place.address, self.ports["nats"]), 1).close()
                return True
            except OSError:
                return False
        until(lambda: place.call(answers), "NATS answers")

    # --- the servers ---
    def data(self, name):
        return self.folder / ("data" if name == "a" else f"data-{name}")

    def host_names(self, _name):
        """The names in a server's certificate."""
        return [word for one in SERVERS for word in ("--host-name", self.place(one).address)]

    def served(self, name):
        """A server's options for what it serves besides the protocol's port."""
        # the first one's authority may sign only the names known at its first start
        return [*([] if self.cables is None else self.host_names(name)), "--metrics", "0", "--web", "off"]

    def monitored_at(self, _name):
        """The address of a server's --metrics."""
        return "127.0.0.1"

    def start(self, name):
        """Starts a server, and waits until it serves."""
        files = [self.folder / f"{what}-{name}" for what in ("port", "metrics")]
        place = self.place(name)
        port = self.ports.setdefault(name, PORT if self.cables is not None else free_port())
        with open(self.folder / f"log-{name}", "ab") as log:
            self.servers[name] = start(
                [*place.enter, self.template_of.bin / "needlelab-durability-server", "--data", self.data(name), "--together", "--durability", self.durability,
                 "--live", f"nats://{self.place('nats').address}:{self.ports['nats']}", "--live-name", SERVERS[name], *self.served(name),
                 "--listen", f"{place.address}:{port}", "--port-file", files[0], "--metrics-port-file", files[1]],
                files, log, self.environment_of(name), f"server {name}")

    def _get(self, name, path):
        return self.place(name).call(lambda: fetched(self.folder / f"metrics-{name}", path, self.monitored_at(name)))[1]

    def health(self, name="a"):  # pylint: disable=arguments-differ
        return json.loads(self._get(name, "/healthz"))

    def metric(self, metric, name="a"):  # pylint: disable=arguments-differ,arguments-renamed
        return metric_in(self._get(name, "/metrics"), metric)

    def chunks(self, name, result):
        return int(self.metric(f'needlelab_chunks_total{{result="{result}"}}', name))

    def hear_each_other(self):
        for name in SERVERS:
            until(lambda: self.metric("needlelab_live_link_up", name) == 1 and self.metric("needlelab_live_servers", name) == 1,  # pylint: disable=cell-var-from-loop
                  f"server {name} hears the other one", 60, 0.1)

    def kill(self, name):
        self.servers[name].kill()
        self.servers[name].wait()

    def open(self, standby=True, spare=False):
        """Starts everything except stations and viewers."""
        self.primary = self.cluster("a")
        self.durability = TWO_DISKS if standby else POWER_CUT
        if standby:
            self.standby = self.standby_of(self.primary, "b")
        if spare:
            self.spare = self.new_cluster("c")
        store = self.data("a") / "store"
        store.write_text(re.sub(r"^url = .*$", f"url = {self.url(*self.clusters)}", store.read_text(), flags=re.MULTILINE))
        if self.ahead_s:
            shutil.rmtree(self.data("a") / "tls", ignore_errors=True)  # the wrong clock must also create the authority
        self.start_nats()
        self.start("a")
        run(self.template_of.bin / "needlelab-admin", "--data", self.data("b"), "server", "join", "--from", self.data("a"), "--name", SERVERS["b"],
            *self.host_names("b"), environment=self.environment_of("a"))
        self.start("b")
        self.hear_each_other()
        found = self.health("b")
        if standby and found["ack_survives"] != "the loss of a disk":
            raise Failed(f"{found}")

    def admin(self, server, *arguments):
        """A command of needlelab-admin to one of the servers."""
        return run(self.template_of.bin / "needlelab-admin", "--server", f"{self.place(server).address}:{self.ports[server]}", "--ca", self.ca, "--user", "ada",
                   "--password-file", self.template / "password", *arguments)

    # --- stations ---
    def servers_text(self, servers):
        return ",".join(f"{self.place(name).address}:{self.ports[name]}" for name in servers)

    def group_of(self, name):
        return GROUPS[self.names.index(name) % 2]

    def _start_station(self, name, seed, sessions, samples):
        group = self.group_of(name)
        servers = self.servers_of_stations or ("ab" if group == GROUPS[0] else "ba")
        self.stations[name] = subprocess.Popen(  # pylint: disable=consider-using-with
            [*self.place(group).enter, self.template_of.bin / "needlelab-durability-station", "--server", self.servers_text(servers), "--ca", self.ca,
             "--key", self.template / f"{name}.key", "--spool", self.spools / name, "--ledger", self.folder / "ledger" / f"{name}.jsonl",
             "--seed", str(seed), "--sessions", str(sessions), "--samples", str(samples), "--rate", str(RATE_HZ), "--push", str(PUSH_HZ), "--drain", "240",
             "--as-station"],
            env=self.environment_of(name), stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log)

    def stream(self, dice):
        """Makes all stations record and send."""
        began = time.time_ns()
        self.start_stations(dice.randrange(1, 1000), self.names, samples=SAMPLES)
        self.all_acknowledged(self.names, began)

    def stations_at(self, name):
        """The stations that last logged in there."""
        there = self.primary.sql(f"SELECT station FROM needlelab.station_claims WHERE server = '{SERVERS[name]}'").split()
        return [one for one in self.names if one in there]

    def busier(self, dice):
        """The server with more stations."""
        at = {name: len(self.stations_at(name)) for name in SERVERS}
        return dice.choice(sorted(SERVERS)) if len(set(at.values())) == 1 else max(at, key=at.get)

    def all_acknowledged(self, stations, since_ns, seconds=90):
        """Whether each of these has received an ack since then."""
        def waiting():
            self.acks.read()
            return [name for name in stations if self.acks.since([name], since_ns) == 0]
        end = time.monotonic() + seconds
        while late := waiting():
            for name in late:
                if (process := self.stations.get(name)) is not None and process.poll() is not None:
                    raise Failed(f"{name} ended with {process.returncode}")
            if time.monotonic() > end:
                raise Failed(f"{len(late)} stations hear no ack within {seconds} s, {late[0]} is one")
            time.sleep(0.05)

    # --- viewers ---
    def place_viewers(self, dice):
        """At each server one viewer of a station, of the other server if it has any, and one with an overview."""
        self.end_viewers()
        for name in SERVERS:
            elsewhere = self.stations_at(OTHER[name]) or self.names
            servers = name + OTHER[name]
            # one after the other: a password check takes a core for a while, and a server with two viewers allows 5 s for a log-in
            for station, rate_hz in ((dice.choice(elsewhere), VIEW_HZ), (None, OVERVIEW_HZ)):
                self.viewers.append(Viewer(self, servers, station, rate_hz))
                self.all_seen(time.time_ns())

    def seen_by(self, viewer):
        return self.names if viewer.station is None else [viewer.station]

    def all_seen(self, since_ns, seconds=90):
        end = time.monotonic() + seconds
        while late := [one for one in self.viewers if not one.sees_since(self.seen_by(one), since_ns)]:
            if (gone := next((one for one in late if one.process.poll() is not None), None)) is not None:
                raise Failed(f"the viewer of {gone.name} ended with {gone.process.returncode}: {gone.notes()}")
            if time.monotonic() > end:
                raise Failed(f"{len(late)} viewers see nothing within {seconds} s: {', '.join(f'{one.name}: {one.notes()}' for one in late)}")
            time.sleep(0.05)

    def end_viewers(self):
        for viewer in self.viewers:
            viewer.end()
        self.viewers = []

    # --- what a fault did ---
    def measure(self, fault):
        """Waits until all stations stream and all viewers see again; records how long they did not."""
        since = max(fault.begin, fault.healed, fault.for_viewers().healed) + GUARD_NS
        self.all_acknowledged(self.names, since)
        self.all_seen(since)
        time.sleep(SETTLE_S)  # a repeated loss counts
        self.acks.read()
        now = time.time_ns()
        for name in fault.stations:
            self.stations_away.add(self.acks.times[name], fault, now)
        for viewer in self.viewers:
            # an overview sees again when it sees its last station again
            each = [measures.Away() for _ in self.seen_by(viewer)]
            for away, name in zip(each, self.seen_by(viewer)):
                away.add(viewer.times(name), fault.for_viewers(), now)
            worst = max(each, key=lambda away: (away.again, away.away))
            self.viewers_away.extend(worst)

    def nothing_missing(self, cluster=None):
        """Everything acknowledged is there, without waiting for a spool; the judge's verdict at the end would be too late for that."""
        committed = dict(self.acks.read().committed)
        rows = (cluster or self.primary).sql("SELECT encode(id, 'hex'), (SELECT count(*) FROM needlelab.chunks WHERE session = s.number) FROM needlelab.sessions s")
        stored = {one: int(count) for one, count in (row.split("|") for row in rows.splitlines())}
        if lacking := measures.missing(committed, stored):
            raise Failed(f"acknowledged-but-missing: {'; '.join(lacking[:3])}")

    def finish(self):  # pylint: disable=arguments-differ
        """Waits until everything is delivered; servers must be healthy and end cleanly. Returns the final judgement."""
        self.end_viewers()
        self.end_stations()
        for name in SERVERS:
            until(lambda: self.health(name)["healthy"], f"server {name} is healthy", 60, 0.2)  # pylint: disable=cell-var-from-loop
            stop(self.servers[name], f"server {name}")
        self.standby.caught_up(self.primary)
        return self.with_findings(self.judge(self.primary, True, [self.standby]))

    def with_findings(self, judgement):
        judgement.faults += self.findings
        return judgement


@contextlib.contextmanager
def stopped(process):
    """SIGSTOP, then SIGCONT."""
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)
