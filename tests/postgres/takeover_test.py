#!/usr/bin/env python3
"""Two servers on one database: stations go from one that stands still (SIGSTOP) to the other, and come back.

usage: takeover_test.py BIN

The first server has received what it has not stored when it stands still. When it goes on (SIGCONT), the stations are the other server's: it
stores and acknowledges nothing of it, nothing is lost, and nothing is stored twice. Judged by what the database has, beside the ledgers of what was
recorded and acknowledged. With the planted bug takeover-unfenced it acknowledges what the other server has stored, which is seen. Without
PostgreSQL 15 it says so and exits with 77.
"""
import pathlib
import re
import signal
import socket
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "faults"))
import clusters  # noqa: E402
from clusters import main_on_postgres, run, until  # noqa: E402
from fault_lab import FaultLab, Template  # noqa: E402
from programs import fetched, metric_in, start, stop  # noqa: E402

clusters.MOST_CONNECTIONS = 60  # for two servers


class Proxy:
    """Forwards each connection to the current server. move() drops the stations, but keeps connections to the previous server open: what it has
    received stays there."""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port, self.target, self.stations, self.kept = self.listener.getsockname()[1], None, [], []
        self.lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            try:
                station, _ = self.listener.accept()
            except OSError:
                return
            try:
                server = socket.create_connection(("127.0.0.1", self.target))
            except OSError:  # of a server that was killed, until move()
                station.close()
                continue
            with self.lock:
                self.stations.append(station)
                self.kept.append(server)
            for source, sink, is_up in ((station, server, True), (server, station, False)):
                threading.Thread(target=self._pump, args=(source, sink, is_up), daemon=True).start()

    @staticmethod
    def _pump(source, sink, is_up):
        try:
            while data := source.recv(65536):
                sink.sendall(data)
            if not is_up:
                sink.shutdown(socket.SHUT_WR)
        except OSError:
            pass

    def move(self, target):
        with self.lock:
            self.target = target
            for station in self.stations:
                try:
                    station.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
            self.stations.clear()

    def close(self):
        self.listener.close()
        for one in self.stations + self.kept:
            one.close()


class TwoServers(FaultLab):
    """Servers `a` and `b` on one database, and stations that reach them through a proxy."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.servers, self.proxy = {}, Proxy()

    def __exit__(self, *error):
        for server in self.servers.values():
            if server.poll() is None:
                server.send_signal(signal.SIGCONT)
                server.kill()
                server.wait()
        self.proxy.close()
        return super().__exit__(*error)

    def data(self, name):
        return self.folder / ("data" if name == "a" else f"data-{name}")

    def start(self, name):
        files = [self.folder / f"{what}-{name}" for what in ("port", "metrics")]
        self.servers[name] = start(
            [self.template_of.bin / "needlelab-durability-server", "--data", self.data(name), "--together", "--listen", "127.0.0.1:0", "--port-file",
             files[0], "--metrics", "0", "--metrics-port-file", files[1], "--web", "off"], files, self._log, self._environment, f"the server {name}")

    def join(self, name):
        run(self.template_of.bin / "needlelab-admin", "--data", self.data(name), "server", "join", "--from", self.data("a"), "--name", name,
            "--host-name", "127.0.0.1", "--host-name", socket.gethostname())

    def move_to(self, name):
        self.proxy.move(int((self.folder / f"port-{name}").read_text()))
        self.port = self.proxy.port

    def metric_of(self, name, metric):
        return int(metric_in(fetched(self.folder / f"metrics-{name}", "/metrics")[1], metric))

    def chunks_of(self, name, result):
        return self.metric_of(name, f'needlelab_chunks_total{{result="{result}"}}')

    def stop(self, name):
        stop(self.servers[name], f"the server {name}")


def stop_between_transactions(server, cluster):
    """SIGSTOP at a moment without an open transaction: PostgreSQL ends a connection with one after 3 s, and the server would then drop its stations
    before it reads what they sent."""
    def has_stopped():
        server.send_signal(signal.SIGSTOP)
        time.sleep(0.1)  # statements in progress finish
        if cluster.sql("SELECT count(*) FROM pg_stat_activity WHERE state LIKE 'idle in transaction%'") == "0":
            return True
        server.send_signal(signal.SIGCONT)
        return False
    until(has_stopped, "the server stands still between two transactions")


def play(lab):
    """Returns how many chunks the hung server acknowledged although the other one had stored them."""
    cluster = lab.cluster("p")
    store = lab.data("a") / "store"
    store.write_text(re.sub(r"^url = .*$", f"url = {lab.url(cluster)}", store.read_text(), flags=re.MULTILINE))
    lab.start("a")
    lab.join("b")
    lab.start("b")
    lab.move_to("a")
    # sessions that outlast it, so that chunks are always in transit: a station sends none while it waits for its session to be opened
    lab.start_stations(7, samples=1_000_000)
    lab.wait_for_more("ack", 30)

    a, stations = lab.servers["a"], len(lab.stations)
    stop_between_transactions(a, cluster)
    # goes to the sockets of a server that reads nothing; data committed a moment ago may still be acknowledged
    time.sleep(1.5)
    lab.move_to("b")
    until(lambda: cluster.sql("SELECT count(*) FROM needlelab.station_claims WHERE server = 'b'") == str(stations), "all stations are at b")
    lab.wait_for_more("ack", 30)
    before = int(cluster.sql("SELECT count(*) FROM needlelab.chunks"))
    a.send_signal(signal.SIGCONT)
    fenced = lab.plant is None
    until(lambda: lab.metric_of("a", "needlelab_stations_deposed_total") == stations if fenced else lab.chunks_of("a", "repeated") > 0,
          "the server that stood still sees what it had received")
    lab.wait_for_more("ack", 30)
    assert int(cluster.sql("SELECT count(*) FROM needlelab.chunks")) > before
    repeated = lab.chunks_of("a", "repeated")
    if not fenced:
        return repeated
    # each row belongs to one server, and both report how many they stored
    lab.end_stations()
    stored = [lab.chunks_of(name, "stored") for name in "ab"]
    rows = int(cluster.sql("SELECT count(*) FROM needlelab.chunks"))
    assert sum(stored) == rows and min(stored) > 0, (stored, rows)

    # and back: the server that hung takes them again
    lab.move_to("a")
    lab.start_stations(8)
    lab.wait_for_more("ack", 30)
    assert cluster.sql("SELECT count(*) FROM needlelab.station_claims WHERE server = 'first'") == str(stations)
    # a server that is killed does not affect the other, and its daily duties are free
    lab.servers["a"].kill()
    lab.servers["a"].wait()
    lab.move_to("b")
    lab.wait_for_more("ack", 30)
    lab.end_stations()
    judgement = lab.judge(cluster, True)
    assert not judgement.faults, judgement.faults[:5]
    print(f"{judgement.acknowledged} chunks acknowledged, {judgement.samples} samples, 0 lost, 0 doubled; {repeated} acknowledged by the server that stood still")
    lab.stop("b")
    return repeated


def play_both(bin_folder, scratch):
    template = Template(bin_folder, scratch)
    with TwoServers(template, scratch / "sound") as lab:
        assert play(lab) == 0
    with TwoServers(template, scratch / "bug", "takeover-unfenced") as lab:
        assert play(lab) > 0, "the planted bug is not seen"
    print("takeover-unfenced: seen")


if __name__ == "__main__":
    sys.exit(main_on_postgres(__doc__, "nl-tko-", play_both))
