"""A copy of the server's database, read from the SQL schema (db/migrations) and the field numbers of proto/ alone."""
import hashlib
import pathlib
import shutil
import sqlite3
import struct
import tempfile

from gesture_chunk import Chunk, Unreadable

OPEN, COMPLETE, INTERRUPTED = 1, 2, 3  # needlelab.pb.SessionState


def _varint(data, at):
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7


def message(data):
    """A Protobuf message's fields: number -> the last value (int, bytes; fixed64 as 8 bytes, fixed32 as 4)."""
    fields, at = {}, 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(data, at)
        elif kind in (1, 5):
            size = 8 if kind == 1 else 4
            value, at = data[at:at + size], at + size
        elif kind == 2:
            size, at = _varint(data, at)
            value, at = data[at:at + size], at + size
            if len(value) != size:
                raise ValueError("a field ends early")
        else:
            raise ValueError(f"wire type {kind}")
        fields[key >> 3] = value
    return fields


class Session:
    """A row of `sessions` with its chunks in order of seq: (seq, samples, crc, bytes). A decoded chunk takes some 30 times its bytes."""

    def __init__(self, row, chunks, progress, quarantined=frozenset()):
        self.id = row["id"].hex()
        self.station, self.state = row["station"], row["state"]
        # an open session's counters are only in session_progress
        self.progress_fault = None
        if (progress is not None) != (self.state == OPEN):
            self.progress_fault = "is open without counters" if self.state == OPEN else "is closed, but has counters of an open one"
        sums = progress or row
        self.row_chunks, self.row_samples, self.row_bytes = sums["chunks"], sums["samples"], sums["stored_bytes"]
        # 1: the original; by a policy, retention may have thinned (2) or deleted (3) a recording
        self.recording = row["recording"]
        self.hash = row["hash"].hex() if row["hash"] is not None else None
        self.steps, self.fault = None, None
        self._describe(row["description"])
        self.chunks = chunks
        self.quarantined = quarantined  # seqs of chunks that arrived undecodable
        digest = hashlib.blake2b(digest_size=32)
        for entry in chunks:
            digest.update(entry[3])
        self.true_hash = digest.hexdigest()

    def decoded(self):
        """Each chunk in order, with its decoded content: (seq, samples, crc, bytes, Chunk or None, reason or None)."""
        return ((*entry, *_decoded(entry[3])) for entry in self.chunks)

    def _describe(self, data):
        try:
            fields = message(data)  # SessionDescription: 1 session_id, 2 station, 10 resolution
            if fields[1].hex() != self.id or fields[2].decode() != self.station:
                self.fault = "its description names another session or station"
            steps = message(fields.get(10, b""))
            self.steps = tuple(struct.unpack("<d", steps.get(i, bytes(8)))[0] for i in range(1, 7))
        except (ValueError, IndexError, KeyError, struct.error) as error:
            self.fault = f"its description cannot be read: {error!r}"


def _decoded(data):
    try:
        return Chunk(data), None
    except (Unreadable, struct.error, IndexError) as error:
        return None, str(error)


class Database:
    """`path`: a needlelab.db without a running writer; its -wal counts. The judge copies it first."""

    def __init__(self, path):
        self.faults, self.sessions = [], {}
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "needlelab.db"
            shutil.copy(path, copy)
            wal = pathlib.Path(str(path) + "-wal")
            if wal.exists():
                shutil.copy(wal, str(copy) + "-wal")
            try:
                self._read(copy)
            except sqlite3.Error as error:
                self.faults.append(f"the database cannot be read: {error}")

    def _read(self, path):
        connection = sqlite3.connect(path)
        connection.row_factory = sqlite3.Row
        try:
            for (said,) in connection.execute("PRAGMA integrity_check"):
                if said != "ok":
                    self.faults.append(f"integrity_check: {said}")
            progress = {p["session"]: p for p in connection.execute("SELECT * FROM session_progress")}
            quarantined = {}
            for mark in connection.execute("SELECT session, seq FROM quarantined_chunks"):
                quarantined.setdefault(mark["session"], set()).add(mark["seq"])
            for row in connection.execute("SELECT * FROM sessions"):
                chunks = [(c["seq"], c["samples"], c["crc"], bytes(c["bytes"]))
                          for c in connection.execute("SELECT * FROM chunks WHERE session = ? ORDER BY seq", (row["number"],))]
                session = Session(row, chunks, progress.pop(row["number"], None), quarantined.get(row["number"], set()))
                self.sessions[session.id] = session
            if progress:
                self.faults.append(f"{len(progress)} counters belong to no session")
            orphans = connection.execute("SELECT count(*) FROM chunks WHERE session NOT IN (SELECT number FROM sessions)")
            if count := orphans.fetchone()[0]:
                self.faults.append(f"{count} chunks belong to no session")
        finally:
            connection.close()


def chunks_in(path):
    """For a backup: session -> number of chunks without a gap."""
    return {s.id: next((i for i, c in enumerate(s.decoded()) if c[0] != i or c[4] is None), len(s.chunks))
            for s in Database(path).sessions.values()}
