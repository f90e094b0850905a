"""How long stations and viewers were away: from the ledgers' acks and the viewers' lines. Times: ns since 1970, by this machine's clock."""
import bisect
import collections
import dataclasses
import json
import math
import pathlib
import statistics

UNNOTICED_NS = 10**9  # normal silence, even without a fault: two chunks or lines per second
GOAL_S = 5  # p90, from the moment the lab has everything it needs until a station streams, and a viewer sees, again


def longest_silence(times, begin, end):
    """(from, to): the longest time without an event that overlaps [begin, end]. It may have begun earlier; `to` is None if it has not ended. `times`
    must be sorted."""
    first = bisect.bisect_right(times, begin)
    last = bisect.bisect_right(times, end)
    points = [times[first - 1] if first > 0 else begin, *times[first:last]]
    gaps = [(after - before, before, after) for before, after in zip(points, points[1:])]
    gaps.append((end - points[-1], points[-1], None))
    _, since, until = max(gaps, key=lambda gap: gap[0])
    return since, until


def percentile(values, share):
    """By nearest rank; None for an empty list."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)] if ordered else None


@dataclasses.dataclass
class Fault:
    """`begin`: of the fault; `healed`: when the lab has everything it needs; for a killed server both are the same moment, because the other one is
    there. `stations`: those affected. `viewers_healed`: if that moment differs for viewers."""
    begin: int
    healed: int
    stations: list
    restore: object = lambda: None  # what remains to be done once everything is measured
    viewers_healed: int | None = None

    def for_viewers(self):
        return dataclasses.replace(self, healed=self.healed if self.viewers_healed is None else self.viewers_healed)


class Away:
    """For many stations or viewers and faults: `again`, seconds from `healed` until the longest silence ended; `away`, its duration, counted from the
    fault."""

    def __init__(self):
        self.again, self.away = [], []

    def add(self, times, fault, end):
        since, until = longest_silence(times, fault.begin, end)
        first = bisect.bisect_right(times, fault.begin)
        if (until or end) - since < UNNOTICED_NS and first < len(times):
            # any of its silences may be the longest: the one at the fault's moment counts
            since, until = fault.begin, times[first]
        if until is None:
            until = end
        self.again.append(max(0, until - fault.healed) / 1e9)
        self.away.append((until - max(since, fault.begin)) / 1e9)

    def extend(self, other):
        self.again += other.again
        self.away += other.away

    def text(self):
        """p50 / p90 of `again`, then of `away`."""
        def both(values):
            return f"{percentile(values, 0.5):.1f} / {percentile(values, 0.9):.1f}" if values else ""
        return both(self.again), both(self.away)

    def over_goal(self):
        """The p90 of `again` if it is over the goal, otherwise None."""
        found = percentile(self.again, 0.9)
        return found if found is not None and found > GOAL_S else None


class AckTimes:
    """Reads the stations' ledgers as they grow: when each station received an ack, and how far each session is acknowledged."""

    def __init__(self, folder, ahead_ns=None):
        """`ahead_ns`: for stations whose clock is ahead."""
        self.folder, self.ahead_ns = pathlib.Path(folder), ahead_ns or {}
        self.times, self.committed = collections.defaultdict(list), {}
        self._read = {}  # bytes by file

    def read(self):
        for path in self.folder.glob("station-*.jsonl"):
            with open(path, "rb") as file:
                file.seek(self._read.get(path, 0))
                data = file.read()
            data = data[:data.rfind(b"\n") + 1]
            self._read[path] = self._read.get(path, 0) + len(data)
            for line in data.split(b"\n"):
                if b'"e":"ack"' in line:
                    self._note(path.stem, json.loads(line))
        return self

    def _note(self, station, event):
        self.times[station].append(event["t"] - self.ahead_ns.get(station, 0))
        self.committed[event["id"]] = max(event["committed"], self.committed.get(event["id"], 0))

    def since(self, stations, begin):
        """How many acks these stations received after `begin`."""
        return sum(len(self.times[name]) - bisect.bisect_right(self.times[name], begin) for name in stations)


def missing(committed, stored):
    """Chunks that are acknowledged but not stored, as text. Both: chunks by session."""
    return [f"session {one}: {count} chunks were acknowledged, {stored.get(one, 0)} are there"
            for one, count in committed.items() if stored.get(one, 0) < count]


def median_ms(seconds):
    return round(1000 * statistics.median(seconds)) if seconds else None
