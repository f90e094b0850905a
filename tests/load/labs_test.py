#!/usr/bin/env python3
"""The arithmetic of labs.py, with runs that are made up."""
import pathlib
import tempfile
import unittest

import labs
from labs import GROWTH, STORES as ROWS, TWO_SERVERS, UNWATCHED


def process(name, **used):
    return {"name": name, **{key: used.get(key) for key, _, _ in labs.COSTS}}


def made_up(row, lost=0, factor=1):
    """A run of 1,000 stations for 20 s, or of 500 for 40: 20,000 seconds of a station."""
    names = [f"server {name}" for name in row.servers.split(",")] if row.servers else ["server"]
    watched = 1 if row.viewers else 0
    processes = [process(name, cpu_s=(8 + 4 * watched) * factor / len(names), sent_bytes=10**6, messages_in=1000) for name in names]
    if row.cluster:
        processes.append(process("PostgreSQL", cpu_s=1.0, log_bytes=80_000_000, disk_bytes=200_000_000))
    if row.cluster == "primary":
        processes.append(process("standby", cpu_s=0.5))
    if row.servers:
        # presence: 1,000 bytes of each station and second; a watched one 50 frames of 100 bytes, of half of them
        processes.append(process("NATS", cpu_s=1.0, received_bytes=20_000_000 + watched * 10_000 * 5000, messages_in=400 + watched * 10_000 * 51,
                                 messages_out=400 + watched * 10_000 * 51))
    processes.append(process("generator", cpu_s=15.0))
    return {"stations": row.stations, "viewers": row.viewers, "seconds": 20, "streamed_s": 20.0, "station_s": 20_000.0, "machine": "Made up, 2 cores", "server_rss_kib": 102_400,
            "bytes_per_sample": 3.5, "live_p50_ms": 21.0, "live_max_ms": 60.0, "good": lost == 0, "ack_p50_ms": 20.0, "ack_p99_ms": 40.0, "live_p99_ms": 26.0, "live_elsewhere_p99_ms": 30.0, "live_frames_seen": 1_000_000 * watched, "live_frames_sent": 1_000_000 * watched,
            "live_frames_elsewhere": 500_000 * watched if row.servers else 0, "live_dropped_frames": 0, "late_p99_ms": 2.0, "database_bytes": 100_000_000,
            "lost": lost, "duplicated": 0, "different": 0, "foreign": 0, "processes": processes}


ABOUT = {"commit": "abc", "when": "today"}


class StationSecond(unittest.TestCase):
    def test_is_what_a_process_took_by_stations_and_seconds(self):
        runs = [made_up(TWO_SERVERS, factor=factor) for factor in (1, 3, 2)]
        self.assertEqual(labs.cost(runs, "server a", "cpu_s"), 600)  # the median: 12 s of 20,000
        self.assertEqual(labs.cost(runs, "servers", "cpu_s"), 1200)
        self.assertEqual(labs.cost(runs, "servers", "sent_bytes"), 100)
        self.assertEqual(labs.cost(runs, "PostgreSQL", "log_bytes"), 4000)
        self.assertIsNone(labs.cost(runs, "standby", "sent_bytes"))
        self.assertIsNone(labs.cost(runs, "no such process", "cpu_s"))

    def test_of_several_is_unknown_where_one_is(self):
        run = made_up(TWO_SERVERS)
        run["processes"][1]["cpu_s"] = None
        self.assertIsNone(labs.cost([run], "servers", "cpu_s"))
        self.assertIsNone(labs.cost([made_up(TWO_SERVERS), run], "server b", "cpu_s"))

    def test_what_was_written_is_read_again(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "runs.json"
            runs_of = {row: [made_up(row), made_up(row)] for row in ROWS}
            labs.write(path, ABOUT, runs_of)
            about, again = labs.read(path)
        self.assertEqual(again, runs_of)
        self.assertEqual(about["commit"], "abc")


class Page(unittest.TestCase):
    def test_has_each_row_medians_and_the_most_that_is_wrong(self):
        runs_of = {row: [made_up(row), made_up(row, lost=7, factor=2), made_up(row, factor=3)] for row in ROWS}
        text = labs.stores_page(runs_of, ABOUT)
        lines = [line for line in text.splitlines() if line.startswith("| SQLite |")]
        self.assertEqual([cell.strip() for cell in lines[0].split("|")[2:4]], ["1,000", "1.20"])  # cores of the server
        self.assertEqual(lines[0].split("|")[4:7], ["  "] * 3)  # neither PostgreSQL nor standby nor NATS
        self.assertEqual(lines[0].split("|")[-4:-1], [" 7 ", " 0 ", " 7 "])
        for row in ROWS:
            self.assertIn(f"| {row.name} |", text)
        self.assertIn("|  | server b |", text)
        self.assertIn("|  | NATS | 50 |", text)
        self.assertIn("Two cores cannot show", text)
        nobody = next(line for line in text.splitlines() if line.startswith(f"| {UNWATCHED.name} |"))
        self.assertEqual(nobody.split("|")[2:3] + nobody.split("|")[12:15], [" 500 "] + ["  "] * 3, nobody)  # no frames


class Growth(unittest.TestCase):
    def met(self, change):
        runs_of = {row: [made_up(row)] for row in GROWTH}
        change([runs[0] for runs in runs_of.values()])
        return "".join("-+"[met] for met, _ in labs.goals(runs_of))

    def test_is_judged_by_every_loss_and_the_largest_size(self):
        self.assertEqual(self.met(lambda runs: runs[0].update(live_p99_ms=70)), "++")
        self.assertEqual(self.met(lambda runs: runs[-1].update(live_p99_ms=51)), "+-")
        self.assertEqual(self.met(lambda runs: runs[-1].update(live_frames_seen=0)), "+-")
        self.assertEqual(self.met(lambda runs: runs[0].update(lost=1)), "-+")
        self.assertEqual(self.met(lambda runs: runs[0].update(good=False)), "-+")

    def test_page(self):
        text = labs.growth_page({row: [made_up(row)] for row in GROWTH}, ABOUT)
        self.assertIn("| 1 | 1 | 1 | 0.60 | 0.75 | 100.0 | 20.0 | 40.0 | 21.0 | 26.0 | 60.0 | 0 | 2.0 | 100.0 | 3.50 | 0 |", text)
        self.assertIn("- PASS: capture to viewer p99 at 1,000 stations: 26.0 ms", text)


if __name__ == "__main__":
    unittest.main()
