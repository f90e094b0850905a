#!/usr/bin/env python3
"""Tests the judge: golden chunks against their twins, and a good database with one planted fault at a time."""
import hashlib
import json
import math
import pathlib
import sqlite3
import struct
import sys
import tempfile
import tracemalloc
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
sys.path[:0] = [str(HERE), str(HERE.parent / "harness")]
from database import Database  # noqa: E402
from gesture_chunk import Chunk, Unreadable, crc32c  # noqa: E402
from ledger import SAMPLE, Ledgers  # noqa: E402
from rude_client import SAMPLES, chunk_bytes, field  # noqa: E402
from verdict import judge_all  # noqa: E402

TWIN_NAMES = ("tick time_ns px_m py_m pz_m qx qy qz qw speed_m_s fx_n fy_n fz_n tx_nm ty_nm tz_nm wx_m wy_m wz_m insertion_m "
              "lateral_error_m plunger device_ns engine_ns").split()
STEPS = (1e-6, 2.0**-15, 1e-3, 1e-4, 1e-6, 1e-4)
ID = bytes(range(16))


class Goldens(unittest.TestCase):
    def test_every_golden_chunk_is_read_as_its_twin_says(self):
        files = sorted((ROOT / "tests/data/gesture").glob("*.chunk"))
        self.assertGreater(len(files), 4)
        for path in files:
            with self.subTest(path.name):
                self._compare(Chunk(path.read_bytes()), json.loads(pathlib.Path(str(path) + ".json").read_text()))

    def _compare(self, chunk, twin):
        self.assertEqual((chunk.count, chunk.first_tick, chunk.last_tick), (twin["count"], twin["first_tick"], twin["last_tick"]))
        for row, sample in enumerate(twin["samples"]):
            seen = {name: chunk.columns[c][row] for c, name in enumerate(TWIN_NAMES)}
            seen = {n: None if isinstance(v, float) and not math.isfinite(v) else v for n, v in seen.items()}
            seen["flags"] = chunk.columns[24][row] | chunk.columns[25][row] << 16
            for c, name in ((26, "buttons"), (27, "layer"), (28, "phase"), (29, "fault")):
                seen[name] = chunk.columns[c][row]
            self.assertEqual(seen, {name: sample[name] for name in seen})

    def test_every_flipped_byte_of_a_chunk_is_noticed(self):
        data = chunk_bytes(3)[0]
        for at in range(len(data)):
            spoilt = bytearray(data)
            spoilt[at] ^= 1 << at % 8
            with self.assertRaises(Unreadable):
                Chunk(bytes(spoilt))

    def _lines(self, name):
        for line in (ROOT / "tests/data/gesture" / name).read_text().splitlines():
            kind, digits = line.split("\t")
            yield kind, bytes.fromhex(digits)

    def test_every_kind_of_impossible_chunk_is_refused(self):
        kinds = dict(self._lines("refused.tsv"))
        self.assertGreaterEqual(len(kinds), 23)
        for kind, data in kinds.items():
            with self.subTest(kind), self.assertRaises(Unreadable):
                self.assertEqual(crc32c(data[:-4]), struct.unpack("<I", data[-4:])[0], "only what is inside is wrong")
                Chunk(data)

    def test_strange_chunks_are_read_as_they_stand(self):
        chunks = {kind: Chunk(data) for kind, data in self._lines("accepted.tsv")}
        self.assertEqual(chunks["ticks that repeat"].columns[0], [100] * 40)
        self.assertEqual(chunks["ticks that go backwards"].columns[0], list(range(100, 60, -1)))
        self.assertLess(chunks["a time that goes backwards"].columns[1][1], chunks["a time that goes backwards"].columns[1][0])
        self.assertTrue(math.isnan(chunks["a raw wall that is not a number under its presence bit"].columns[16][0]))
        self.assertEqual(chunks["a memory of the cut of one byte, behind listed steps"].cut_memory, b"\7")
        self.assertEqual(chunks["one sample"].cut_memory, b"")
        both = chunks["a memory of the cut and paths, behind listed steps"]
        self.assertEqual((both.cut_memory, both.paths), (b"\7", b"\10\11"))

    def test_the_check_value_of_the_crc(self):
        self.assertEqual(crc32c(b"123456789"), 0xE3069283)


class Spoilt(unittest.TestCase):
    """Three chunks of ten samples, all acknowledged, two of them Safe, closed as complete."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.events, self.chunks = [], [chunk_bytes(seq)[0] for seq in range(3)]
        self.hash = hashlib.blake2b(b"".join(self.chunks), digest_size=32)
        self.note(e="session", id=ID.hex(), station="s", resolution=STEPS)
        for seq in range(3):
            for v in chunk_bytes(seq)[1]:
                self.note(e="s", t=v[0] * 10**6, v=v)
        self.note(e="ack", id=ID.hex(), t=5, committed=3, safe=2)
        self.note(e="end", id=ID.hex(), chunks=3, samples=30, hash=self.hash.hexdigest(), interrupted=False)
        self.note(e="closed", id=ID.hex(), t=6, state=2)
        self.backups = [{ID.hex(): 2}]
        self.path = self.folder / "needlelab.db"
        self.db = sqlite3.connect(self.path)
        self.addCleanup(self.db.close)
        self.db.execute("PRAGMA synchronous=OFF")
        for migration in sorted((ROOT / "db/migrations").glob("*.sql")):
            self.db.executescript(migration.read_text())
        self.db.execute("INSERT INTO stations VALUES ('s', ?, 0, 0)", (bytes(32),))
        self.put_session(1, ID, self.chunks, self.hash)

    def note(self, **event):
        self.events.append(event)

    def put_session(self, number, session, chunks, digest):
        resolution = b"".join(field(i + 1, step) for i, step in enumerate(STEPS))
        self.db.execute(
            "INSERT INTO sessions (number, id, station, trainee, exercise_id, profile_id, profile_revision, profile_json, "
            "engine_version, rate_hz, started_unix_ns, description, state, chunks, samples, stored_bytes, hash, received_unix_ns) "
            "VALUES (?, ?, 's', 't', 'e', 'p', 0, '{}', 'v', 1000, 0, ?, 2, ?, ?, ?, ?, 0)",
            (number, session, field(1, session) + field(2, "s") + field(10, resolution), len(chunks), len(chunks) * SAMPLES, sum(map(len, chunks)),
             digest.digest()))
        for seq, data in enumerate(chunks):
            self.put(seq, data, number=number)

    def put(self, seq, data, samples=SAMPLES, number=1):
        self.db.execute("INSERT OR REPLACE INTO chunks VALUES (?, ?, ?, ?, ?)",
                        (number, seq, samples, struct.unpack("<I", data[-4:])[0], data))

    def names(self, at_end=True):
        self.write()
        return {name for name, _ in self.judged(at_end).faults}

    def write(self):
        self.db.commit()
        (self.folder / "ledger").mkdir(exist_ok=True)
        (self.folder / "ledger" / "s.jsonl").write_text("".join(json.dumps(e) + "\n" for e in self.events))

    def judged(self, at_end=True):
        return judge_all(Database(self.path), Ledgers(self.folder / "ledger", 20e6), self.backups, at_end)

    def count(self, chunks):
        self.db.execute("UPDATE sessions SET chunks = ?, samples = ?, stored_bytes = (SELECT sum(length(bytes)) FROM chunks)",
                        (chunks, SAMPLES * chunks))

    def reopen(self):
        self.db.execute("INSERT INTO session_progress SELECT number, chunks, samples, stored_bytes FROM sessions")
        self.db.execute("UPDATE sessions SET state = 1, hash = NULL, chunks = 0, samples = 0, stored_bytes = 0")

    def test_what_is_good_has_no_fault(self):
        self.assertEqual(self.names(), set())
        self.assertEqual(self.names(at_end=False), set())

    def test_a_missing_last_chunk(self):
        self.db.execute("DELETE FROM chunks WHERE seq = 2")
        self.count(2)
        self.assertIn("acknowledged-but-missing", self.names(at_end=False))

    def test_a_missing_session(self):
        self.db.execute("DELETE FROM chunks")
        self.db.execute("DELETE FROM sessions")
        self.assertEqual(self.names(), {"acknowledged-but-missing"})
        self.events = [e for e in self.events if e["e"] != "ack"]
        self.assertEqual(self.names(), {"recorded-but-missing"})
        self.assertEqual(self.names(at_end=False), set(), "nothing was promised yet")

    def test_a_missing_chunk_in_the_middle(self):
        self.db.execute("DELETE FROM chunks WHERE seq = 1")
        self.assertIn("gap", self.names())

    def test_a_row_that_counts_wrong(self):
        self.count(4)
        self.assertEqual(self.names(), {"gap"})

    def test_a_chunk_stored_twice(self):
        self.put(3, self.chunks[2])
        self.count(4)
        self.assertIn("doubled", self.names())

    def test_chunks_in_another_order(self):
        self.put(1, self.chunks[2])
        self.put(2, self.chunks[1])
        self.assertIn("out-of-order", self.names())

    def test_a_value_off_by_more_than_half_a_step(self):
        sample = next(e for e in self.events if e["e"] == "s" and e["v"][0] == 17)
        sample["v"][2] += 0.4e-6
        self.assertEqual(self.names(), set())
        sample["v"][2] += 0.2e-6
        self.assertEqual(self.names(), {"changed"})

    def test_a_tick_that_nobody_recorded(self):
        self.events = [e for e in self.events if e["e"] != "s" or e["v"][0] != 17]
        self.assertEqual(self.names(), {"changed"})

    def test_a_sample_left_out(self):
        extra = list(chunk_bytes(1)[1][9])
        extra[0:2] = [1000, 10**9]  # recorded before tick 20
        self.events.insert(next(i for i, e in enumerate(self.events) if e["e"] == "s" and e["v"][0] == 20),
                           {"e": "s", "t": 0, "v": extra})
        self.assertIn("gap", self.names())

    def test_a_hash_that_does_not_agree(self):
        self.db.execute("UPDATE sessions SET hash = ?", (bytes(32),))
        self.assertEqual(self.names(), {"wrong-hash"})

    def test_the_stations_hash_was_another(self):
        next(e for e in self.events if e["e"] == "end")["hash"] = "00" * 32
        self.assertEqual(self.names(), {"wrong-hash"})

    def test_complete_although_interrupted(self):
        next(e for e in self.events if e["e"] == "end")["interrupted"] = True
        self.assertEqual(self.names(), {"wrong-hash"})

    def test_a_chunk_that_cannot_be_read(self):
        data = bytearray(self.chunks[1])
        data[50] ^= 4
        self.db.execute("UPDATE chunks SET bytes = ? WHERE seq = 1", (bytes(data),))
        self.assertEqual(self.names(), {"unreadable"})

    def quarantine(self, seq, data, samples=SAMPLES):
        self.put(seq, data, samples)
        self.db.execute("INSERT INTO quarantined_chunks VALUES (1, ?, 'why')", (seq,))
        self.count(3)
        digest = hashlib.blake2b(b"".join(self.chunks[:seq] + [data] + self.chunks[seq + 1:]), digest_size=32)
        self.db.execute("UPDATE sessions SET hash = ?", (digest.digest(),))
        next(e for e in self.events if e["e"] == "end")["hash"] = digest.hexdigest()

    def test_a_quarantined_chunk_keeps_its_place_and_is_never_safe(self):
        data = bytearray(self.chunks[1])
        data[16] ^= 1  # another last tick
        data[-4:] = struct.pack("<I", crc32c(bytes(data[:-4])))
        self.quarantine(1, bytes(data))
        self.assertEqual(self.names(), {"not-safe"}, "two chunks were called Safe")
        self.events = [e for e in self.events if e["e"] != "ack"]
        self.note(e="ack", id=ID.hex(), t=5, committed=3, safe=1)
        self.assertEqual(self.names(), set())
        self.db.execute("DELETE FROM quarantined_chunks")
        self.assertEqual(self.names(), {"unreadable"}, "no one says that it cannot be decoded")

    def test_a_sound_chunk_in_quarantine(self):
        self.quarantine(2, self.chunks[2])
        self.assertEqual(self.names(), {"unreadable"})

    def test_a_damaged_page(self):
        self.db.commit()
        self.db.execute("PRAGMA journal_mode=DELETE")
        self.db.close()
        data = bytearray(self.path.read_bytes())
        data[4096:] = bytes(len(data) - 4096)
        self.path.write_bytes(data)
        self.db = sqlite3.connect(self.folder / "other")
        self.assertIn("unreadable", self.names())

    def test_called_safe_without_a_backup(self):
        self.backups = [{ID.hex(): 1}]
        self.assertEqual(self.names(), {"not-safe"})

    def test_open_after_it_was_said_to_be_closed(self):
        self.reopen()
        self.assertEqual(self.names(at_end=False), {"never-closed"})

    def test_counters_of_an_open_session(self):
        self.reopen()
        self.events = [e for e in self.events if e["e"] not in ("end", "closed")]
        self.assertEqual(self.names(at_end=False), set())
        for column in ("chunks", "samples", "stored_bytes"):
            self.db.execute(f"UPDATE session_progress SET {column} = {column} + 1")
            self.assertEqual(self.names(at_end=False), {"gap"}, column)
            self.db.execute(f"UPDATE session_progress SET {column} = {column} - 1")
        self.db.execute("DELETE FROM session_progress")
        self.assertEqual(self.names(at_end=False), {"gap"})

    def test_a_closed_session_with_counters_of_an_open_one(self):
        self.db.execute("INSERT INTO session_progress SELECT number, chunks, samples, stored_bytes FROM sessions")
        self.assertEqual(self.names(), {"gap"})

    def test_counters_of_no_session(self):
        self.db.execute("INSERT INTO session_progress VALUES (7, 0, 0, 0)")
        self.assertNotEqual(self.names(), set())

    def test_a_killed_station_may_lose_20_ms_and_no_more(self):
        self.db.execute("DELETE FROM chunks WHERE seq = 2")
        self.count(2)
        state = [("UPDATE sessions SET state = 3, hash = ?", (hashlib.blake2b(b"".join(self.chunks[:2]), digest_size=32).digest(),))]
        self.db.execute(*state[0])
        self.events = [e for e in self.events if e["e"] in ("session", "s")]
        self.note(e="kill", station="s", t=41 * 10**6)
        self.assertEqual(self.names(), set(), "that tick 20 was given away is known since tick 21: 20 ms before the kill")
        self.events[-1]["t"] = 41 * 10**6 + 1
        self.assertEqual(self.names(), {"recorded-but-missing"})

    def test_what_a_station_noted_while_it_was_being_killed_is_no_reason_to_ask_for_all(self):
        self.db.execute("DELETE FROM chunks WHERE seq = 2")
        self.count(2)
        digest = hashlib.blake2b(b"".join(self.chunks[:2]), digest_size=32).digest()
        self.db.execute("UPDATE sessions SET state = 3, hash = ?", (digest,))
        self.events = [e for e in self.events if e["e"] in ("session", "s")]
        self.note(e="kill", station="s", t=28 * 10**6)
        self.note(e="kill", station="s", t=5000 * 10**6)
        self.assertEqual(self.names(), set(), "the second kill was of another session")

    def test_of_other_sessions_the_judge_holds_what_is_stored_and_a_time_for_each_sample(self):
        made = [chunk_bytes(seq) for seq in range(50)]
        chunks = [data for data, _ in made]
        digest = hashlib.blake2b(b"".join(chunks), digest_size=32)

        def peak(numbers):
            for number in numbers:
                session = bytes([number]) * 16
                self.put_session(number, session, chunks, digest)
                self.note(e="session", id=session.hex(), station="s", resolution=STEPS)
                for _, values in made:
                    for v in values:
                        self.note(e="s", t=v[0] * 10**6, v=v)
            self.write()
            tracemalloc.start()
            judgement = self.judged(at_end=False)
            bytes_used = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            self.assertEqual({name for name, _ in judgement.faults}, {"wrong-hash"}, "complete, and no station ended them")
            self.assertEqual(judgement.samples, (3 + 50 * (numbers[-1] - 1)) * SAMPLES)
            return bytes_used

        few, many = peak(range(2, 4)), peak(range(4, 10))
        # Python's objects for a chunk that is not decoded, and for a session
        besides = 300 * len(chunks) + 5000
        self.assertLess((many - few) / 6, sum(map(len, chunks)) + 8 * SAMPLES * len(chunks) + besides)

    def test_what_a_station_writes_is_read_like_any_json(self):
        """A sample's line in the station's own form is first scanned for its time, and parsed when its session is judged."""
        self.write()
        ledger = self.folder / "ledger" / "s.jsonl"
        as_stations = "".join(json.dumps(json.loads(line), sort_keys=True, separators=(",", ":")) + "\n" for line in ledger.read_text().splitlines())
        before = Ledgers(self.folder / "ledger", 20e6).sessions[ID.hex()]
        values = before.samples()
        self.assertEqual([tuple(v) for v in values], [tuple(v) for seq in range(3) for v in chunk_bytes(seq)[1]])
        self.assertIn(SAMPLE.decode(), as_stations)
        ledger.write_text(as_stations + as_stations[:30])
        after = Ledgers(self.folder / "ledger", 20e6).sessions[ID.hex()]
        self.assertEqual((after.samples(), after.times), (values, before.times))
        self.assertEqual(self.judged().faults, [])

    def test_after_a_restore_only_what_was_acknowledged_since_counts_midway(self):
        self.db.execute("DELETE FROM chunks WHERE seq = 2")
        self.count(2)
        self.reopen()
        self.note(e="restore", t=10)
        self.assertEqual(self.names(at_end=False), set())
        self.note(e="ack", id=ID.hex(), t=11, committed=3, safe=0)
        self.assertEqual(self.names(at_end=False), {"acknowledged-but-missing"})


if __name__ == "__main__":
    unittest.main()
