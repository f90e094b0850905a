"""A client that sends invalid input, written from proto/ alone: a gap, a repetition, a wrong hash."""
import hashlib
import json
import pathlib
import socket
import ssl
import struct
import sys
import time
import uuid

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "judge"))
from database import message  # noqa: E402
from gesture_chunk import COLUMNS, STANDARD, crc32c  # noqa: E402

CHUNK, ACK, HELLO, REFUSAL, LOGIN, WELCOME, OPEN_SESSION, SESSION_OPENED, CLOSE_SESSION, SESSION_CLOSED = \
    1, 2, 20, 21, 22, 23, 25, 26, 27, 28
SAMPLES = 10  # in each of its chunks


def varint(n):
    out = bytearray()
    while n > 127:
        out.append(n & 127 | 128)
        n >>= 7
    return bytes(out + bytes([n]))


def field(number, value):
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 1) + struct.pack("<d", value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def chunk_bytes(seq, shift=0):
    """SAMPLES samples at rest: after the first row no column changes. Also returns their values for the ledger. `shift`: steps away from that place.
    """
    first = seq * SAMPLES
    steps_x = 7 * seq + 1 + shift
    data = b"NLGC" + struct.pack("<BBHQQqqI", 1, 1, SAMPLES - 1, first, first + SAMPLES - 1, first * 10**6, 10**6, 0)
    row = [0] * COLUMNS
    row[2], row[8], row[27] = steps_x, 2**15, -1
    data += b"".join(varint(2 * n if n >= 0 else -2 * n - 1) for n in row[2:])
    data += struct.pack("<I", 0)
    data += struct.pack("<I", crc32c(data))
    values = []
    for tick in range(first, first + SAMPLES):
        v = [tick, tick * 10**6, steps_x * STANDARD[0], 0, 0, 0, 0, 0, 1.0] + [0] * 7 + [None] * 3 + [0] * 3
        values.append(v + [0, 0, 0, 0, 0, -1, 0, 0])
    return data, values


class Peer:
    """A connection to a server, using only the protocol. It sends Hello; the caller logs in."""

    def __init__(self, address, port, ca, receive_bytes=None):
        context = ssl.create_default_context(cafile=ca)
        plain = socket.socket()
        if receive_bytes is not None:
            plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)  # before the window is announced
        plain.settimeout(60)
        plain.connect((address, port))
        self.socket = context.wrap_socket(plain, server_hostname=address)
        self.send(HELLO, field(1, field(1, 1)) + field(2, "rude client"))

    def send(self, number, body):
        envelope = field(number, body)
        self.socket.sendall(struct.pack(">I", len(envelope)) + envelope)

    def _take(self, count):
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                raise ConnectionError("the server hung up")
            data += more
        return data

    def next(self):
        """The fields of the next envelope."""
        return message(self._take(struct.unpack(">I", self._take(4))[0]))


class RudeClient(Peer):
    def __init__(self, lab, station="station-1"):
        name, key = (lab.programs.template / f"{station}.key").read_text().strip().split(":")
        self.ledger, self.id, self.station = lab.folder / "ledger" / "rude.jsonl", uuid.uuid4().bytes, name
        super().__init__("127.0.0.1", lab.port, lab.folder / "data" / "tls" / "ca.crt")
        self.send(LOGIN, field(1, field(1, name) + field(2, bytes.fromhex(key))))
        self.wait_for(WELCOME)
        self.hash = hashlib.blake2b(digest_size=32)
        self.note(e="session", id=self.id.hex(), station=name, resolution=STANDARD)
        resolution = b"".join(field(i + 1, step) for i, step in enumerate(STANDARD))
        self.send(OPEN_SESSION, field(1, field(1, self.id) + field(2, name) + field(3, "tina") + field(4, "practice") + field(5, "practice")
                                      + field(7, "{}") + field(8, "rude") + field(9, 1000.0) + field(10, resolution) + field(11, 10**18)))
        self.wait_for(SESSION_OPENED)

    def note(self, **event):
        with open(self.ledger, "a", encoding="ascii") as file:
            file.write(json.dumps(event) + "\n")

    def wait_for(self, *wanted):
        """The next such message: (number, its fields). Acks are written to the ledger."""
        while True:
            for number, body in self.next().items():
                if number == ACK:
                    ack = message(body)
                    self.note(e="ack", id=self.id.hex(), t=time.time_ns(), committed=ack.get(2, 0), safe=ack.get(3, 0))
                if number in wanted:
                    return number, message(body)

    def record(self, chunks):
        """Writes the session's samples and its hash to the ledger."""
        for seq in range(chunks):
            data, values = chunk_bytes(seq)
            self.hash.update(data)
            for v in values:
                self.note(e="s", t=time.monotonic_ns(), v=v)

    def chunk(self, seq, acknowledged=None, shift=0):
        """Returns REFUSAL, or ACK once this many are acknowledged: by default all up to this one. `shift`: with bytes other than those recorded."""
        self.send(CHUNK, field(1, self.id) + field(2, seq) + field(3, chunk_bytes(seq, shift)[0]))
        while True:
            number, body = self.wait_for(ACK, REFUSAL)
            if number == REFUSAL or body.get(2, 0) >= (seq + 1 if acknowledged is None else acknowledged):
                return number

    def close(self, chunks, digest):
        self.send(CLOSE_SESSION, field(1, self.id) + field(2, chunks) + field(3, chunks * SAMPLES) + field(4, digest))
        number, body = self.wait_for(SESSION_CLOSED, REFUSAL)
        if number == SESSION_CLOSED:
            self.note(e="closed", id=self.id.hex(), t=time.time_ns(), state=body.get(2, 0), hash=digest.hex())
        return number

    def end(self, chunks):
        self.note(e="end", id=self.id.hex(), chunks=chunks, samples=chunks * SAMPLES, hash=self.hash.hexdigest(), interrupted=False)
        self.close(chunks, self.hash.digest())
