"""Measures the machine's stalls of real-time threads: one witness per processor, at the priority of a station's writer.

A starved virtual machine stops every thread for some milliseconds, and a busy disk delays every write. A killed station then loses more than
promised. The ledger records the witnesses' stall with the kill, and the judge allows exactly that."""
import mmap
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

PRIORITY = 10  # like client/net's spool_writer
PERIOD_NS = 2_000_000
ENTRIES = 256  # the latest wake-ups: when, and how late; half a second of them
SIZE = 16 * ENTRIES


def real_time_allowed():
    child = os.fork()
    if child == 0:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
            os._exit(0)  # pylint: disable=protected-access
        except OSError:
            os._exit(1)  # pylint: disable=protected-access
    return os.waitpid(child, 0)[1] == 0


def _witness(path, processor):
    os.sched_setaffinity(0, {processor})
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        pass
    parent, entry = os.getppid(), 0
    with open(path, "r+b") as file:
        page = mmap.mmap(file.fileno(), SIZE)
    tail, size = os.open(path + ".tail", os.O_RDWR | os.O_CREAT, 0o600), 0
    while os.getppid() == parent:
        before = time.monotonic_ns()
        time.sleep(PERIOD_NS / 1e9)
        # writes and restarts a file like a spool's tail, which a busy disk also delays
        size += os.pwrite(tail, bytes(300), size)
        if size > 30_000:
            os.ftruncate(tail, 0)
            size = 0
        now = time.monotonic_ns()
        struct.pack_into("<QQ", page, 16 * entry, now, now - before - PERIOD_NS)
        entry = (entry + 1) % ENTRIES


class Witnesses:
    def __init__(self):
        self._folder = tempfile.TemporaryDirectory(prefix="durability-stalls-")
        self._pages, self._processes = [], []
        for processor in sorted(os.sched_getaffinity(0)):
            path = pathlib.Path(self._folder.name) / str(processor)
            path.write_bytes(bytes(SIZE))
            with open(path, "r+b") as file:
                self._pages.append(mmap.mmap(file.fileno(), SIZE))
            self._processes.append(subprocess.Popen(  # pylint: disable=consider-using-with
                [sys.executable, "-B", __file__, str(path), str(processor)]))

    def end(self):
        for process in self._processes:
            process.kill()
            process.wait()

    def held_up_ns(self, since, until):
        """The longest delay of any processor's witness in that time (steady clock, ns)."""
        worst = 0
        for page in self._pages:
            end = time.monotonic() + 1
            # its next wake-up reports a stall that has not ended yet
            while max(t for t, _ in struct.iter_unpack("<QQ", page[:])) <= until and time.monotonic() < end:
                time.sleep(0.001)
            worst = max(worst, sum(late for t, late in struct.iter_unpack("<QQ", page[:]) if t > since and t - late - PERIOD_NS < until))
        return worst


if __name__ == "__main__":
    _witness(sys.argv[1], int(sys.argv[2]))
