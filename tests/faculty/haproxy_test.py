#!/usr/bin/env python3
"""HAProxy in front of a faculty's two servers by the very file deploy/faculty/haproxy.cfg: stations, an instructor and browsers know its address only. One
server is killed, one stands still; then HAProxy ends the browsers' TLS itself.

usage: haproxy_test.py BIN [--long] [--folder DIR] [--seed N]

--long (deploy/nightly) also judges how soon stations and people are back; else it is told. Of the file only addresses, ports and paths of files are other ones. Without HAProxy, PostgreSQL 15 or NATS it says so and exits with 77.
"""
import argparse
import http.client
import json
import os
import pathlib
import random
import re
import select
import shutil
import signal
import socket
import ssl
import struct
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "postgres" / "faults")]
from clusters import PG, Failed, give, run, until  # noqa: E402
from fault_lab import PASSWORD  # noqa: E402
from faculty_lab import (NATS, OTHER, OVERVIEW_HZ, PATIENCE_S, SERVERS, FacultyLab, Viewer, faculty_template, free_port, nats_is_here, sound,  # noqa: E402
                         stopped)
from measures import GOAL_S, Fault  # noqa: E402

EXAMPLE = HERE.parents[1] / "deploy/faculty/haproxy.cfg"
HAPROXY = shutil.which("haproxy", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
NAME = "lab.example.org"  # what people call HAProxy
NETWORK = "127.0.0."  # replaces the file's 192.0.2.: this machine has all of these addresses
PROXY, SEEN_AS = NETWORK + "10", NETWORK + "1"  # a connection to the loopback device comes from .1 by default
STATIONS = 6
BROWSERS = [f"{NETWORK}{last}" for last in range(21, 37)]
PAUSE_GOAL_S = 10  # until HAProxy has noticed, plus a station's wait
LIVE_S, DATABASE_STILL_S = 3, 5
MOST_CONNECTIONS = 256  # per address, from the file's console block


class At:
    """A server's place: this machine, with its own address."""
    enter = []

    def __init__(self, address):
        self.address = address

    @staticmethod
    def call(work):
        return work()


class ProxiedLab(FacultyLab):
    """Servers with their own addresses; clients reach them through HAProxy."""
    PLACES = {"a": At(NETWORK + "11"), "b": At(NETWORK + "12")}

    def __init__(self, template, folder):
        super().__init__(template, folder, STATIONS)
        self.port, self.web_port, self.check_port = (free_port() for _ in range(3))
        self.ports |= {name: self.port for name in SERVERS}
        self.believes = []  # the peer whose header the servers trust from their next start on

    def place(self, name):
        return self.PLACES.get(name) or super().place(name)

    def host_names(self, name):
        return [word for one in (f"{name}.example.org", NAME, PROXY, self.place(name).address) for word in ("--host-name", one)]

    def served(self, name):
        address, believed = self.place(name).address, [word for one in self.believes for word in ("--web-proxy", one)]
        return [*self.host_names(name), "--ca-domain", "example.org", "--metrics", f"{address}:{self.check_port}", "--web", f"{address}:{self.web_port}",
                *believed]

    def monitored_at(self, name):
        return self.place(name).address

    def servers_text(self, _servers):
        return f"{PROXY}:{self.port}"

    def said(self):
        log = self.folder / "haproxy.log"
        return super().said() + ("\n--- haproxy.log\n" + log.read_text(errors="replace")[-3000:] if log.exists() else "")

    def who_answers(self, certificate):
        """The server with this certificate."""
        for name in SERVERS:
            text = (self.data(name) / "tls/server.crt").read_text()
            if ssl.PEM_cert_to_DER_cert(re.search(r"-----BEGIN.*?-----END CERTIFICATE-----\n", text, re.DOTALL)[0]) == certificate:
                return name
        raise Failed("a certificate of neither server")


class HaProxy:
    """Runs with the example's file, for a lab. `console`: with that block instead of "browsers"."""

    def __init__(self, lab, console=False):
        self.lab, self.log, self.file = lab, lab.folder / "haproxy.log", lab.folder / "haproxy.cfg"
        self.file.write_text(self._console(self._here(EXAMPLE.read_text())) if console else self._here(EXAMPLE.read_text()))
        run(HAPROXY, "-c", "-dW", "-f", self.file)  # a warning is an error
        self._from = self.log.stat().st_size if self.log.exists() else 0
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(  # pylint: disable=consider-using-with
                [HAPROXY, "-db", "-f", self.file], stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        until(self._listens, "HAProxy listens", PATIENCE_S)

    def _here(self, text):
        ports = {"7750": self.lab.port, "7751": self.lab.web_port, "9750": self.lab.check_port}
        text = re.sub(r"(?<=bind ):", f"{PROXY}:", text.replace("192.0.2.", NETWORK))
        text = re.sub(r"(?<=[: ])(7750|7751|9750)\b", lambda found: str(ports[found[0]]), text)
        if os.getuid() != 0:
            text = re.sub(r"^    (user|group|chroot) .*\n", "", text, flags=re.MULTILINE)
        return text

    def _console(self, text):
        made = self.lab.folder / "lab.pem"
        run("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2", "-subj", f"/CN={NAME}",
            "-addext", f"subjectAltName=DNS:{NAME}", "-keyout", made.with_suffix(".key"), "-out", made.with_suffix(".crt"))
        made.write_text(made.with_suffix(".crt").read_text() + made.with_suffix(".key").read_text())
        text = re.sub(r"^listen browsers\n(    .*\n)+", "", text, flags=re.MULTILINE)
        before, commented = text.split("# listen console\n")
        block = "".join(line.removeprefix("# ") for line in commented.splitlines(True))
        return before + "listen console\n" + block.replace("/etc/haproxy/lab.pem", str(made)).replace("/etc/haproxy/needlelab-ca.crt", str(self.lab.ca))

    def _listens(self):
        if self.process.poll() is not None:
            raise Failed(f"HAProxy ended with {self.process.returncode}")
        try:
            socket.create_connection((PROXY, self.lab.port), 1).close()
            return True
        except OSError:
            return False

    def states(self):
        """Its reports about its servers since it started: [(block, server, UP or DOWN, why)]."""
        said = self.log.read_bytes()[self._from:].decode(errors="replace")
        return re.findall(r"Server (\w+)/(\w) is (UP|DOWN)(?:, reason: ([^,.]*))?", said)

    def counts(self, name):
        """How often each block reported this server UP and DOWN."""
        return {(block, state): sum(1 for one in self.states() if one[:3] == (block, name, state))
                for block in ("stations", "browsers", "console") for state in ("UP", "DOWN")}

    def are_all_up(self):
        """Neither server has been reported down since it started."""
        return not any(state == "DOWN" for _, _, state, _ in self.states())

    def wait_for(self, name, state, before, *blocks):
        """Waits until these blocks have reported it once more than in `before`."""
        until(lambda: all(self.counts(name)[block, state] > before[block, state] for block in blocks), f"HAProxy finds {name} {state}", PATIENCE_S, 0.05)

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


class Browser(http.client.HTTPSConnection):
    """A person with their own address who knows only HAProxy's name."""

    def __init__(self, lab, address, authority=None):
        self.lab, self.address, self.cookie = lab, address, ""
        super().__init__(NAME, lab.web_port, timeout=60, context=ssl.create_default_context(cafile=authority or lab.ca))

    def connect(self):
        plain = socket.create_connection((PROXY, self.port), 20, (self.address, 0))
        self.sock = self._context.wrap_socket(plain, server_hostname=NAME)

    def server(self):
        """The connection's server; the connection must be passed to it unread."""
        return self.lab.who_answers(self.sock.getpeercert(True))

    def ask(self, method, path, body=None, **headers):
        """Status and reply, over a new connection; `server()` tells whose."""
        self.close()
        if self.cookie:
            headers["Cookie"] = self.cookie
        if body is not None:
            headers |= {"Content-Type": "application/json", "Origin": f"https://{NAME}:{self.port}"}
        self.request(method, path, None if body is None else json.dumps(body), headers)
        answer = self.getresponse()
        self.cookie = (answer.getheader("Set-Cookie") or self.cookie).split(";")[0]
        return answer.status, json.loads(answer.read())

    def log_in(self, **headers):
        status, reply = self.ask("POST", "/api/v1/session", {"name": "ada", "password": PASSWORD}, **headers)
        if status != 200 or not self.cookie:
            raise Failed(f"a log-in through HAProxy: {status} {reply}")

    def is_known(self):
        """Whether the session continues."""
        status, reply = self.ask("GET", "/api/v1/session")
        if status not in (200, 401):
            raise Failed(f"GET session: {status} {reply}")
        return status == 200

    def live(self):
        """Opens the live page's WebSocket on a separate connection."""
        self.close()
        self.request("GET", "/api/v1/live", None, {
            "Cookie": self.cookie, "Origin": f"https://{NAME}:{self.port}", "Upgrade": "websocket", "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="})
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            if not (one := self.sock.recv(1)):
                raise Failed("live page: the connection ended")
            head += one
        if not head.startswith(b"HTTP/1.1 101 "):
            raise Failed(f"live page: {head.splitlines()[0]}")
        self.sock.settimeout(5)

    def _take(self, count):
        data = b""
        while len(data) < count:
            if not (more := self.sock.recv(count - len(data))):
                raise ConnectionError("it hung up")
            data += more
        return data

    def message(self):
        """The next text of the live page (RFC 6455)."""
        while True:
            first, size = self._take(2)
            if size in (126, 127):
                size = struct.unpack(">H" if size == 126 else ">Q", self._take(2 if size == 126 else 8))[0]
            data = self._take(size)
            if first & 15 == 8:
                raise ConnectionError("it closed the page")
            if first & 15 == 1:
                return json.loads(data)

    def watch(self, seconds):
        """How many texts arrive within that time; each contains the stations."""
        count, end = 0, time.monotonic() + seconds
        while time.monotonic() < end:
            if {tile["station"] for tile in self.message()["tiles"]} < set(self.lab.names):
                raise Failed("a live page lacks a station")
            count += 1
        return count


def seconds_until(holds, what, seconds=PATIENCE_S):
    begun = time.monotonic()
    until(holds, what, seconds)
    return time.monotonic() - begun


def of_servers(lab):
    return " and ".join(f"{len(lab.stations_at(name))} at {name}" for name in SERVERS)


def again(lab, what, goal):
    """lab.measure's latest result."""
    stations, viewers = lab.stations_away.again, lab.viewers_away.again
    print(f"{what}: {len(stations)} stations stream again within {max(stations):.1f} s, the instructor sees all within {max(viewers):.1f} s", flush=True)
    if lab.is_timed and max(stations + viewers) > goal:
        raise Failed(f"{what}: again after {max(stations + viewers):.1f} s, at most {goal} s were expected")
    for one in (stations, viewers):
        one.clear()


def connected(lab, dice):
    """Stations and an instructor through HAProxy's address: the servers do the TLS."""
    lab.stream(dice)
    if min(len(lab.stations_at(name)) for name in SERVERS) < STATIONS // 3:
        raise Failed(f"stations are not spread: {of_servers(lab)}")
    begin = time.time_ns()
    lab.viewers = [Viewer(lab, "ab", None, OVERVIEW_HZ)]
    lab.all_seen(begin)
    print(f"stations: {of_servers(lab)}; an instructor sees all", flush=True)


def browsers_stay(lab):
    """Browsers are spread by their addresses, and each stays at its server. Returns one that is logged in."""
    servers = []
    for address in BROWSERS:
        stranger = Browser(lab, address)
        stranger.connect()
        servers.append(stranger.server())
        stranger.close()
    browser = Browser(lab, BROWSERS[0])
    browser.log_in()
    for _ in range(5):
        if not browser.is_known() or browser.server() != servers[0]:
            raise Failed("a browser does not stay at its server, logged in")
    if len(set(servers)) < 2:
        raise Failed("all browsers are at one server")
    browser.live()
    texts = browser.watch(1)
    print(f"browsers: {servers.count('a')} of {len(servers)} addresses at a; one is logged in at {servers[0]} and stays there; its live page has {texts} texts "
          "in 1 s", flush=True)
    return browser, servers[0]


def kill(lab, proxy, browser, name):
    """Its stations and its browser continue at the other one."""
    there, begin, before = lab.stations_at(name), time.time_ns(), proxy.counts(name)
    lab.kill(name)

    def goes_on():
        try:
            return browser.is_known()
        except (OSError, http.client.HTTPException):
            return False
    took = seconds_until(goes_on, "the browser's session continues")
    if browser.server() != OTHER[name]:
        raise Failed("the browser is at the killed server")
    lab.measure(Fault(begin, begin, there))
    lab.nothing_missing()
    again(lab, f"server {name} killed", GOAL_S)
    print(f"its browser's session continues at {browser.server()} within {took:.1f} s", flush=True)
    proxy.wait_for(name, "DOWN", before, "stations", "browsers")
    before = proxy.counts(name)
    lab.believes = [SEEN_AS]  # for the console at the end
    lab.start(name)
    lab.hear_each_other()
    proxy.wait_for(name, "UP", before, "stations", "browsers")


def pause(lab, proxy, name):
    """The health check notices it, its stations continue at the other one, and when it continues it acknowledges nothing."""
    there, before, begin = lab.stations_at(name), proxy.counts(name), time.time_ns()
    repeated, deposed = lab.chunks(name, "repeated"), lab.metric("needlelab_stations_deposed_total", name)
    with stopped(lab.servers[name]):
        took = seconds_until(lambda: proxy.counts(name)["stations", "DOWN"] > before["stations", "DOWN"], f"HAProxy finds that {name} stands still")
        why = [one[3] for one in proxy.states() if one[:3] == ("stations", name, "DOWN")][-1]
        until(lambda: set(there) <= set(lab.stations_at(OTHER[name])), "all stations are at the other server", 30, 0.05)
        lab.measure(Fault(begin, begin, there))
    print(f"server {name} stands still: HAProxy marks it down after {took:.1f} s ({why})", flush=True)
    again(lab, f"server {name} stands still", PAUSE_GOAL_S)
    proxy.wait_for(name, "UP", before, "stations")
    time.sleep(1)  # for data in transit
    if (more := lab.chunks(name, "repeated") - repeated) > 0:
        raise Failed(f"server {name} acknowledged {more} chunks that the other one had stored")
    told = lab.metric("needlelab_stations_deposed_total", name) - deposed
    lab.nothing_missing()
    print(f"it continues and acknowledges nothing; {told:.0f} connections were told that they are deposed", flush=True)
    # it is restarted, as the other server was
    lab.servers[name].terminate()
    if lab.servers[name].wait(60) != 0:
        raise Failed(f"server {name} ended with {lab.servers[name].returncode}")
    lab.start(name)
    lab.hear_each_other()


def console(lab, proxy):
    """HAProxy terminates TLS, and the servers know the client's address."""
    def peers(name):
        return re.findall(r"web_login .*?\bpeer=(\S+)", (lab.folder / f"log-{name}").read_text(errors="replace"))
    earlier = {name: len(peers(name)) for name in SERVERS}
    browser = Browser(lab, BROWSERS[1], lab.folder / "lab.crt")
    browser.log_in(**{"X-Forwarded-For": "203.0.113.5"})  # a value that a browser sends itself is not trusted
    seen = {name: peers(name)[earlier[name]:] for name in SERVERS}
    found = [peer for name in SERVERS for peer in seen[name]]
    if len(found) != 1 or found[0].strip('"').rsplit(":", 1)[0] != BROWSERS[1]:
        raise Failed(f"the servers take a browser at {BROWSERS[1]} for {found}")
    name = next(name for name in SERVERS if seen[name])
    browser.live()
    texts = browser.watch(LIVE_S)
    database_stands_still(lab, proxy)
    texts += browser.watch(1)
    viewers = {one: lab.metric("needlelab_web_live_viewers", one) for one in SERVERS}
    if viewers != {name: 1, OTHER[name]: 0}:
        raise Failed(f"live pages: {viewers}, one at {name} was expected")
    crowd_is_refused(lab, browser)
    lab.kill(name)
    try:
        while True:
            browser.message()
    except (ConnectionError, ssl.SSLError):
        pass
    took = seconds_until(browser.is_known, "the browser's session continues")
    lab.start(name)  # so that the lab ends cleanly
    lab.hear_each_other()
    print(f"console: logged in at {name}, which knows the browser's address; the live page is open for {LIVE_S + DATABASE_STILL_S + 2} s with {texts} texts, also while "
          f"PostgreSQL stands still (/healthz says 503) and while another address has too many connections; server {name} killed: "
          f"the page ends, and the session continues at {OTHER[name]} within {took:.1f} s", flush=True)


def database_stands_still(lab, proxy):
    """/healthz returns 503 after 2 s at every server. Connections are not cut for that."""
    begun = time.monotonic()
    lab.primary.signal_all(signal.SIGSTOP)
    try:
        # a state read within the last second is reported once more
        until(lambda: not lab.health("a")["healthy"], "/healthz says that PostgreSQL stands still", PATIENCE_S, 0.1)
        time.sleep(max(0, begun + DATABASE_STILL_S - time.monotonic()))
    finally:
        lab.primary.signal_all(signal.SIGCONT)
    time.sleep(1)  # answers in progress
    if not proxy.are_all_up():
        raise Failed(f"PostgreSQL stands still, and HAProxy finds a server down: {proxy.states()}")


def crowd_is_refused(lab, browser):
    """One address with too many connections; others are not affected."""
    crowd = []
    try:
        for _ in range(MOST_CONNECTIONS + 1):
            crowd.append(socket.create_connection((PROXY, lab.web_port), 5, (BROWSERS[2], 0)))
        time.sleep(0.2)
        ended = select.select(crowd, [], [], 5)[0]  # HAProxy's threads take them in any order
        if len(ended) != 1:
            raise Failed(f"of {len(crowd)} connections of an address {len(ended)} are refused, not the one above {MOST_CONNECTIONS}")
        browser.message()
    finally:
        for one in crowd:
            one.close()


def play(lab, dice):
    run(HAPROXY, "-c", "-dW", "-f", EXAMPLE)
    lab.open()
    proxy = HaProxy(lab)
    try:
        connected(lab, dice)
        browser, at = browsers_stay(lab)
        kill(lab, proxy, browser, at)
        pause(lab, proxy, OTHER[at])
        proxy.end()
        proxy = HaProxy(lab, console=True)
        console(lab, proxy)
        return sound(lab.finish())
    finally:
        proxy.end()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--long", action="store_true", help="how soon stations and people are back is judged, too")
    parser.add_argument("--folder", type=pathlib.Path, default="/tmp", help="for all files, a short path")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    given = parser.parse_args()
    for is_here, what in ((HAPROXY is not None, "HAProxy"), (os.access(PG / "initdb", os.X_OK), "PostgreSQL 15"), (nats_is_here(), NATS)):
        if not is_here:
            print(f"{what} is not installed; deploy/setup installs it")
            return 77
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that clusters, which are sessions of their own, end with it
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="nl-ha-", dir=given.folder))  # a socket's path has at most 107 bytes
    scratch.chmod(0o755)  # the user postgres must be able to enter it
    give(scratch)
    template, begun = None, time.monotonic()
    try:
        template = faculty_template(given.bin, scratch, STATIONS)
        with ProxiedLab(template, scratch / "l") as lab:
            lab.is_timed = given.long
            try:
                judgement = play(lab, random.Random(given.seed))
            except Exception as error:  # pylint: disable=broad-except
                print(f"{lab.said()}\nFAILED: {type(error).__name__}: {error}\nrepeat: {sys.argv[0]} {given.bin} --seed {given.seed}")
                return 1
        print(f"{judgement.sessions} sessions, {judgement.acknowledged} chunks acknowledged, {judgement.samples} samples compared, none lost; "
              f"seed {given.seed}; {time.monotonic() - begun:.1f} s")
    finally:
        if template is not None:
            template.cluster.stop("immediate")
        shutil.rmtree(scratch, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
