#!/usr/bin/env python3
"""Stations send to a server whose PostgreSQL fails in many ways: nothing acknowledged is lost or doubled, and what would break that is caught.

usage: faults_test.py BIN [--long] [--seed N] [SCENARIO]...

The judge is that of tests/durability: it compares all that PostgreSQL has with the stations' ledgers, sample by sample. Without names: a few
scenarios that take seconds, and the planted bugs; --long (or NEEDLELAB_LONG=1): all of them, many times. A scenario NAME-planted has the bug NAME, and is passed when the
judge finds it. Without PostgreSQL 15 it says so and exits with 77.
"""
import argparse
import collections
import concurrent.futures
import functools
import os
import pathlib
import random
import shutil
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import planted  # noqa: E402
import power_cuts  # noqa: E402
import scenarios  # noqa: E402
from clusters import PG, Failed, give  # noqa: E402
from fault_lab import FaultLab, Template  # noqa: E402

def under_both(name, scenario, short_rounds, seeds, rounds):
    """Rows of a scenario with a single PostgreSQL server, where acks survive a power cut, and with its synchronous standby."""
    yield name, (functools.partial(scenario, durability=scenarios.POWER_CUT), 0, seeds, rounds)
    yield f"{name}-{scenarios.TWO_DISKS}", (functools.partial(scenario, durability=scenarios.TWO_DISKS), short_rounds, seeds, rounds)


# name -> (scenario, rounds in the short form or 0, seeds and rounds in the long one)
SCENARIOS = {
    **dict(under_both("restart", scenarios.restart, 0, 2, 5)),
    **dict(under_both("kill", scenarios.kill, 0, 2, 8)),
    **dict(under_both("pause", scenarios.pause, 0, 2, 6)),
    **dict(under_both("pause-long", scenarios.pause_long, 0, 1, 1)),
    **dict(under_both("connections", scenarios.connections, 0, 2, 3)),
    **dict(under_both("load", scenarios.load, 0, 1, 6)),
    **dict(under_both("disk-full", scenarios.disk_full, 0, 1, 3)),
    **dict(under_both("commit-lost", scenarios.commit_lost, 2, 2, 8)),
    **dict(under_both("commit-silent", scenarios.commit_silent, 0, 1, 1)),
    "promotion": (scenarios.promotion, 1, 4, 4),
    "standby-lost": (scenarios.standby_lost, 0, 3, 3),
    "weak-settings": (scenarios.weak_settings, 0, 3, 2),
    "commit-late": (scenarios.commit_late, 0, 1, 1),
    "standby-disk-full": (scenarios.standby_disk_full, 0, 1, 2),
    "lagging": (scenarios.lagging, 1, 3, 2),
    "power-cut": (power_cuts.power_cut, 1, 6, 8),
    "power-cut-two-disks": (power_cuts.power_cut_promotion, 0, 2, 4),
}
AT_ONCE = 3  # labs at a time; most of them wait
LONG_SEEDS_PLANTED = 2


def plan(given):
    """(name, seed, rounds) of each lab to run."""
    long = given.long or bool(os.environ.get("NEEDLELAB_LONG"))
    dice = random.Random(given.seed)
    for name, (_, short_rounds, seeds, rounds) in SCENARIOS.items():
        if given.names and name not in given.names:
            continue
        if long:
            yield from ((name, dice.randrange(10**6), rounds) for _ in range(seeds))
        elif short_rounds or given.names:
            yield name, dice.randrange(10**6), short_rounds or 2
    for name in [*planted.PLANTED, *power_cuts.PLANTED]:
        for form in (f"{name}-planted", name):
            if form in given.names or (not given.names and (long or (form != name and name in planted.PLANTED))):
                yield from ((form, dice.randrange(10**6), 1) for _ in range(LONG_SEEDS_PLANTED if long else 1))


def play(template, folder, name, seed, rounds):
    """Runs one scenario in its own lab; returns its judgement and the number of faults played."""
    dice = random.Random(seed)
    bug = name.removesuffix("-planted")
    plant = planted.PLANTED[bug][1] if bug in planted.PLANTED and name != bug else None
    with FaultLab(template, folder, plant) as lab:
        try:
            if name in SCENARIOS:
                judgement = scenarios.sound(SCENARIOS[name][0](lab, dice, rounds))
            else:
                judgement = (power_cuts if bug in power_cuts.PLANTED else planted).play(lab, dice, bug, name != bug)
            return judgement, lab.faults_played
        except scenarios.CannotPlay:
            raise
        except Exception as error:
            raise Failed(f"{type(error).__name__}: {error}\n{lab.said()}") from error


class Rows:
    """The combined results of all labs of a scenario; the judge ends a planted one at its first fault."""
    COLUMNS = ("scenario", "labs", "faults played", "chunks acknowledged", "samples compared", "chunks lost", "samples doubled", "seeds")

    def __init__(self):
        self.sums, self.seeds = collections.defaultdict(collections.Counter), collections.defaultdict(list)
        self.labs, self.caught = 0, 0
        self._lock = threading.Lock()

    def add(self, name, seed, faults_played, judgement):
        with self._lock:
            self._add(name, seed, faults_played, judgement)

    def _add(self, name, seed, faults_played, judgement):
        self.labs += 1
        self.caught += bool(judgement.faults)
        doubled = sum(fault == "doubled" for fault, _ in judgement.faults)
        self.sums[name].update(dict(zip(self.COLUMNS[1:], (1, faults_played, judgement.acknowledged, judgement.samples, judgement.lost, doubled))))
        self.seeds[name].append(str(seed))

    def text(self, names):
        """A table in Markdown, in this order."""
        lines = [self.COLUMNS, ["---"] + ["---:"] * (len(self.COLUMNS) - 2) + ["---"]]
        lines += [[name, *(sums[column] for column in self.COLUMNS[1:-1]), " ".join(self.seeds[name])] for name in names if (sums := self.sums.get(name))]
        return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("names", nargs="*", metavar="SCENARIO")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--seed", type=int, default=int(os.environ.get("NEEDLELAB_SEED", time.time())))
    given = parser.parse_args()
    known = [*SCENARIOS, *(form for bug in [*planted.PLANTED, *power_cuts.PLANTED] for form in (bug, f"{bug}-planted"))]
    if unknown := [name for name in given.names if name not in known]:
        parser.error(f"there is no scenario {unknown[0]}; there are: {', '.join(known)}")
    if not os.access(PG / "initdb", os.X_OK):
        print("PostgreSQL 15 is not installed; deploy/setup installs it")
        return 77
    print(f"seed {given.seed}")
    # a socket's path has at most 107 bytes
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="nl-flt-", dir="/tmp"))
    scratch.chmod(0o755)  # the user postgres must be able to enter it
    give(scratch)
    template, rows = None, Rows()
    try:
        template = Template(given.bin, scratch)

        def played(numbered):
            """A lab's line of text, and whether it has failed; adds its judgement to the rows."""
            number, (name, seed, rounds) = numbered
            began, folder = time.monotonic(), scratch / f"l{number}"
            try:
                judgement, faults_played = play(template, folder, name, seed, rounds)
            except scenarios.CannotPlay as reason:
                return f"{name}: not played: {reason}", False
            except Failed as error:
                return (f"{name}, seed {seed}: FAILED: {error}\nrepeat: {sys.argv[0]} {given.bin}{''.join(f' {one}' for one in given.names)}"
                        f"{' --long' if given.long else ''} --seed {given.seed}"), True
            finally:
                shutil.rmtree(folder, ignore_errors=True)
            rows.add(name, seed, faults_played, judgement)
            caught = f"caught: {judgement.faults[0][0]}: {judgement.faults[0][1][:120]}; " if judgement.faults else "no fault; "
            return (f"{name}, seed {seed}, rounds {rounds}: {caught}{judgement.sessions} sessions, {judgement.acknowledged} chunks acknowledged, "
                    f"{judgement.samples} samples compared, {time.monotonic() - began:.1f} s"), False

        bad = 0
        with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as labs:
            for text, has_failed in labs.map(played, enumerate(plan(given))):
                print(text, flush=True)
                bad += has_failed
        print(rows.text(list(dict.fromkeys(name for name, _, _ in plan(given)))))
        print(f"{rows.labs} labs played, {bad} failed, {rows.caught} planted faults caught")
    finally:
        if template is not None:
            template.cluster.stop("immediate")
        shutil.rmtree(scratch, ignore_errors=True)
    return 1 if bad or not rows.labs else 0


if __name__ == "__main__":
    sys.exit(main())
