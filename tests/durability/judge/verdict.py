"""Compares the database with the ledgers. README.md lists the faults by name."""
import math

from database import COMPLETE, INTERRUPTED, OPEN
from gesture_chunk import COLUMNS, KINDS, REALS, WALL

FAULTS = ("acknowledged-but-missing", "recorded-but-missing", "doubled", "changed", "gap", "out-of-order", "wrong-hash",
          "unreadable", "not-safe", "never-closed")


class Judgement:
    def __init__(self):
        self.faults, self.sessions, self.chunks, self.samples, self.acknowledged = [], 0, 0, 0, 0
        self.lost = 0  # chunks that were acknowledged but are missing

    def fault(self, name, text):
        assert name in FAULTS, name
        self.faults.append((name, text))


def _near(stored, recorded, step):
    if recorded is None or stored is None:
        return recorded is stored
    if math.isnan(recorded):
        return math.isnan(stored)
    if step == 0 or math.isinf(recorded):
        return stored == recorded
    # half a step, plus the rounding of a double
    return abs(stored - recorded) <= step * 0.5 + 1e-9 * step + 1e-15 * abs(recorded)


def _differing_column(chunk, row, recorded):
    """The first column in which a stored sample differs from the recorded one by more than its step allows."""
    for c in (0, 1, 24, 25, 26, 27, 28, 29):
        if chunk.columns[c][row] != recorded[c]:
            return c
    for c in REALS:
        step = 0 if chunk.raw >> c & 1 else chunk.steps[KINDS[c - 2]]
        if not _near(chunk.columns[c][row], recorded[c], step):
            return c
    for c in (22, 23):
        if abs(chunk.columns[c][row] - recorded[c]) > chunk.time_step_ns / 2:
            return c
    return None


def _check_row(stored, decoded, judge, name):
    """Checks the session's row against its chunks, and the chunks themselves."""
    if stored.fault:
        judge.fault("unreadable", f"{name}: {stored.fault}")
    if stored.progress_fault:
        judge.fault("gap", f"{name}: {stored.progress_fault}")
    for position, (seq, samples, crc, _, chunk, why) in enumerate(decoded):
        if seq != position:
            judge.fault("gap", f"{name}: chunk {position} is not there, {seq} comes next")
            return False
        if (chunk is None) != (seq in stored.quarantined):
            judge.fault("unreadable", f"{name}: chunk {seq}: " +
                        (why if chunk is None else "is quarantined, although it can be decoded"))
            return False
        if chunk is None:
            continue
        if chunk.crc != crc or chunk.count != samples:
            judge.fault("unreadable", f"{name}: chunk {seq} is not what its row says")
        if any(abs(a - b) > 1e-12 * abs(b) for a, b in zip(chunk.steps, stored.steps)):
            judge.fault("changed", f"{name}: chunk {seq} has other steps than the session's description")
    sums = (len(stored.chunks), sum(c[1] for c in stored.chunks), sum(len(c[3]) for c in stored.chunks))
    if sums != (stored.row_chunks, stored.row_samples, stored.row_bytes):
        judge.fault("gap", f"{name}: its row counts {stored.row_chunks} chunks, {stored.row_samples} samples, "
                    f"{stored.row_bytes} bytes; there are {sums}")
    return True


def _check_samples(decoded, recorded, judge, name):
    """Checks that every stored sample is the next recorded one. Returns their number."""
    recorded_samples = recorded.samples()
    place = {values[0]: i for i, values in enumerate(recorded_samples)}
    expected = 0
    for seq, samples, _, _, chunk, _ in decoded:
        if chunk is None:  # quarantined: only its header tells how many samples it has
            expected += samples
            continue
        for row, tick in enumerate(chunk.columns[0]):
            where = f"{name}: chunk {seq}, sample {row}, tick {tick}"
            at = place.get(tick)
            if at is None:
                judge.fault("changed", f"{where}: no such tick was recorded")
                return expected
            if at < expected:
                judge.fault("doubled", f"{where}: it is there already")
                return expected
            if at > expected:
                later = any(recorded_samples[expected][0] in c[4].columns[0] for c in decoded[seq:] if c[4])
                judge.fault("out-of-order" if later else "gap",
                            f"{where}: tick {recorded_samples[expected][0]} was recorded before it")
                return expected
            column = _differing_column(chunk, row, recorded_samples[at])
            if column is not None:
                judge.fault("changed", f"{where}: column {column} is {chunk.columns[column][row]}, recorded was "
                            f"{recorded_samples[at][column]}")
                return expected
            expected += 1
    return expected


def _check_end(stored, recorded, arrived, judge, name):
    """Checks after all stations have drained."""
    required = len(recorded.times) if recorded.required is None else recorded.required
    if arrived < required:
        judge.fault("recorded-but-missing", f"{name}: {required} samples had to arrive, {arrived} did")
    if stored.state == OPEN:
        judge.fault("never-closed", f"{name}: all is sent, and it is open still")
    if recorded.end is not None and recorded.end["chunks"] != len(stored.chunks):
        judge.fault("recorded-but-missing", f"{name}: ended with {recorded.end['chunks']} chunks, {len(stored.chunks)} are there")


def _check_close(stored, recorded, judge, name):
    if stored.state in (COMPLETE, INTERRUPTED):
        if stored.hash != stored.true_hash:
            judge.fault("wrong-hash", f"{name}: closed with hash {stored.hash}, its chunks have {stored.true_hash}")
        if recorded.end is not None and stored.hash != recorded.end["hash"]:
            judge.fault("wrong-hash", f"{name}: closed, although the station's hash is {recorded.end['hash']}, not {stored.hash}")
    for _, state, offered in recorded.closed:
        if offered is not None and offered != stored.true_hash and stored.state != OPEN:
            judge.fault("wrong-hash", f"{name}: closed as {state} when {offered} was offered, its chunks have {stored.true_hash}")
    if stored.state == COMPLETE and (recorded.end is None or recorded.end["interrupted"]):
        judge.fault("wrong-hash", f"{name}: called complete, although it was interrupted")


def _check_session(recorded, database, ledgers, at_end, judge):
    name = f"session {recorded.id} of {recorded.station}"
    acknowledged = ledgers.acknowledged(recorded, at_end)
    judge.acknowledged += acknowledged
    stored = database.sessions.get(recorded.id)
    if stored is None:
        judge.lost += acknowledged
        if acknowledged:
            judge.fault("acknowledged-but-missing", f"{name}: {acknowledged} chunks were acknowledged, it is not there")
        elif at_end and (recorded.required or (recorded.required is None and recorded.times)):
            judge.fault("recorded-but-missing", f"{name}: it is not there")
        return
    judge.sessions += 1
    judge.chunks += len(stored.chunks)
    if stored.recording != 1:
        return
    decoded = list(stored.decoded())
    if not _check_row(stored, decoded, judge, name):
        return
    if len(stored.chunks) < acknowledged:
        judge.lost += acknowledged - len(stored.chunks)
        judge.fault("acknowledged-but-missing", f"{name}: {acknowledged} chunks were acknowledged, {len(stored.chunks)} are there")
    before = len(judge.faults)
    arrived = _check_samples(decoded, recorded, judge, name)
    judge.samples += arrived
    _check_close(stored, recorded, judge, name)
    since = 0 if at_end or not ledgers.restores else max(r["t"] for r in ledgers.restores)
    if any(t >= since for t, _, _ in recorded.closed) and stored.state == OPEN:
        judge.fault("never-closed", f"{name}: the server said that it was closed, and it is open")
    if at_end and len(judge.faults) == before:
        _check_end(stored, recorded, arrived, judge, name)


def judge_all(database, ledgers, backups, at_end):
    """`backups`: one dict per backup file, session -> chunks. `at_end`: all stations have drained."""
    judge = Judgement()
    for text in database.faults:
        judge.fault("unreadable", text)
    for recorded in ledgers.sessions.values():
        _check_session(recorded, database, ledgers, at_end, judge)
        safe = ledgers.safe(recorded)
        covered = max((backup.get(recorded.id, 0) for backup in backups), default=0)
        stored = database.sessions.get(recorded.id)
        if stored is not None and stored.quarantined:
            covered = min(covered, min(stored.quarantined))
        if safe > covered:
            judge.fault("not-safe", f"session {recorded.id} of {recorded.station}: {safe} chunks were called Safe, a backup has {covered}")
    for number in database.sessions.keys() - ledgers.sessions.keys():
        judge.fault("changed", f"session {number}: no one recorded it")
    return judge


assert COLUMNS == 31 and max(WALL) < 19
