"""People and stations that use the protocol directly, for things the users' programs do not do: use a token elsewhere, stay at a server that has lost
the station, read nothing."""
import pathlib
import socket
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [path for path in (str(HERE.parent / "durability" / part) for part in ("harness", "judge")) if path not in sys.path]
from database import message  # noqa: E402
from rude_client import LOGIN, REFUSAL, WELCOME, Peer, field  # noqa: E402

PING, PONG, REQUEST, REPLY, SUBSCRIBE, STOP_LESSON = 5, 6, 7, 8, 41, 47  # Envelope
CALL_STOP_LESSON = 83  # Request


class Refused(Exception):
    """The server's message."""


def welcome_of(peer):
    """The fields of its Welcome; raises Refused."""
    while True:
        envelope = peer.next()
        if REFUSAL in envelope:
            raise Refused(message(envelope[REFUSAL]).get(2, b"").decode(errors="replace"))
        if WELCOME in envelope:
            return message(envelope[WELCOME])


class Person(Peer):
    """Logs in with a password or a token; `token` is from the Welcome."""

    def __init__(self, lab, server, name=None, password=None, token=None, **how):
        super().__init__(lab.place(server).address, lab.ports[server], lab.ca, **how)
        try:
            who = field(3, token) if token is not None else field(2, field(1, name) + field(2, password))
            self.send(LOGIN, who)
            self.token = welcome_of(self).get(4, b"")
        except BaseException:
            self.socket.close()
            raise

    def stop_lesson(self, station, reason):
        """Returns once the server has answered; raises Refused."""
        self.send(REQUEST, field(1, 1) + field(CALL_STOP_LESSON, field(1, station) + field(3, reason)))
        while True:
            envelope = self.next()
            if PING in envelope:
                self.send(PONG, pong(envelope[PING]))
            if REFUSAL in envelope:
                raise Refused(message(envelope[REFUSAL]).get(2, b"").decode(errors="replace"))
            if REPLY in envelope:
                return

    def watch(self, stations):
        """Requests all samples of these; does not read."""
        for number, name in enumerate(stations, 1):
            self.send(SUBSCRIBE, field(1, number) + field(2, name))

    def ended_after(self, seconds):
        """Seconds until the server ended the connection; None: it did not."""
        begun = time.monotonic()
        try:
            while (left := begun + seconds - time.monotonic()) > 0:
                self.socket.settimeout(left)
                envelope = self.next()
                if PING in envelope:
                    self.send(PONG, pong(envelope[PING]))
        except TimeoutError:
            return None
        except OSError:
            return time.monotonic() - begun
        return None


def pong(ping):
    return ping + field(3, time.monotonic_ns())  # id and the sender's clock are echoed


class StationPeer(Peer):
    """A station that confirms what it receives, on its own thread: `stops` contains the reasons with which its lesson was stopped."""

    def __init__(self, lab, server, station):
        super().__init__(lab.place(server).address, lab.ports[server], lab.ca)
        name, key = (lab.template / f"{station}.key").read_text().strip().split(":")
        try:
            self.send(LOGIN, field(1, field(1, name) + field(2, bytes.fromhex(key))))
            welcome_of(self)
        except BaseException:
            self.socket.close()
            raise
        self.stops, self.ended_at = [], None
        self.socket.settimeout(None)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        try:
            while True:
                envelope = self.next()
                if PING in envelope:
                    self.send(PONG, pong(envelope[PING]))
                if STOP_LESSON in envelope:
                    self.stops.append(message(envelope[STOP_LESSON]).get(3, b"").decode())
        except (OSError, ValueError):
            self.ended_at = time.monotonic()

    def close(self):
        try:
            self.socket.shutdown(socket.SHUT_RDWR)  # wakes the thread
        except OSError:
            pass
        self.socket.close()
