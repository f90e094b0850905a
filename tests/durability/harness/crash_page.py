"""The page that the server under test shares with the harness: ../crash_vfs.cpp."""
import mmap
import struct

WORDS = ("phase", "commits", "checkpoints", "operations", "die_in", "die_at", "hold_ms")
ELSEWHERE, IN_COMMIT, IN_CHECKPOINT = 0, 1, 2


class CrashPage:
    def __init__(self, path):
        self.path = path
        path.write_bytes(bytes(8 * len(WORDS)))
        with open(path, "r+b") as file:
            self._map = mmap.mmap(file.fileno(), 0)

    def get(self, word):
        return struct.unpack_from("<Q", self._map, 8 * WORDS.index(word))[0]

    def set(self, word, value):
        struct.pack_into("<Q", self._map, 8 * WORDS.index(word), value)

    def arm(self, phase, operation, hold_ms=0):
        """The server dies before this operation (from 1) of the next such phases."""
        self.set("die_in", ELSEWHERE)
        for word, value in (("operations", 0), ("die_at", operation), ("hold_ms", hold_ms), ("die_in", phase)):
            self.set(word, value)

    def disarm(self):
        self.set("die_in", ELSEWHERE)
        self.set("phase", ELSEWHERE)
