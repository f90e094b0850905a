#!/usr/bin/env python3
"""Stations send to a server whose PostgreSQL fails in many ways: nothing acknowledged is lost or doubled, and what would break that is caught.

usage: faults_test.py BIN [--long] [--seed N] [SCENARIO]...

The judge is that of tests/durability: it compares all that PostgreSQL has with the stations' ledgers, sample by sample. Without names: a few
scenarios that take seconds; --long (or NEEDLELAB_LONG=1): all of them, many times. A scenario NAME-planted has the bug NAME, and is passed when the
judge finds it. Without PostgreSQL 15 it says so and exits with 77.
"""
import argparse
import os
import pathlib
import random
import shutil
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import planted  # noqa: E402
import power_cuts  # noqa: E402
import scenarios  # noqa: E402
from clusters import PG, Failed, give  # noqa: E402
from fault_lab import FaultLab, Template  # noqa: E402

# name -> (scenario, rounds in the short form or 0, seeds and rounds in the long one)
SCENARIOS = {
    "restart": (scenarios.restart, 0, 3, 5),
    "kill": (scenarios.kill, 0, 4, 8),
    "pause": (scenarios.pause, 0, 3, 8),
    "connections": (scenarios.connections, 0, 3, 4),
    "load": (scenarios.load, 0, 1, 6),
    "disk-full": (scenarios.disk_full, 0, 1, 3),
    "commit-lost": (scenarios.commit_lost, 2, 4, 10),
    "commit-silent": (scenarios.commit_silent, 0, 1, 2),
    "promotion": (scenarios.promotion, 1, 4, 4),
    "standby-lost": (scenarios.standby_lost, 0, 3, 3),
    "weak-settings": (scenarios.weak_settings, 0, 3, 2),
    "lagging": (scenarios.lagging, 1, 3, 2),
    "power-cut": (power_cuts.power_cut, 1, 6, 8),
}
SHORT_PLANTED = ("ack-before-commit",)
LONG_SEEDS_PLANTED = 2


def plan(given):
    """(name, seed, rounds) of each lab to come."""
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
            if form in given.names or (not given.names and (long or (form != name and name in SHORT_PLANTED))):
                yield from ((form, dice.randrange(10**6), 1) for _ in range(LONG_SEEDS_PLANTED if long else 1))


def play(template, folder, name, seed, rounds):
    """One scenario in a lab of its own; its judgement."""
    dice = random.Random(seed)
    bug = name.removesuffix("-planted")
    plant = planted.PLANTED[bug][1] if bug in planted.PLANTED and name != bug else None
    with FaultLab(template, folder, plant) as lab:
        try:
            if name in SCENARIOS:
                return scenarios.sound(SCENARIOS[name][0](lab, dice, rounds))
            if bug in power_cuts.PLANTED:
                return power_cuts.play(lab, dice, bug, name != bug)
            return planted.play(lab, dice, bug, name != bug)
        except scenarios.CannotPlay:
            raise
        except Exception as error:
            raise Failed(f"{type(error).__name__}: {error}\n{lab.said()}") from error


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
    scratch.chmod(0o755)  # the user postgres goes through it
    give(scratch)
    bad, template, played, caught_bugs = 0, None, 0, 0
    try:
        template = Template(given.bin, scratch)
        for number, (name, seed, rounds) in enumerate(plan(given)):
            began, folder = time.monotonic(), scratch / f"l{number}"
            try:
                judgement = play(template, folder, name, seed, rounds)
            except scenarios.CannotPlay as reason:
                print(f"{name}: not played: {reason}", flush=True)
                continue
            except Failed as error:
                bad += 1
                print(f"{name}, seed {seed}: FAILED: {error}\nrepeat: {sys.argv[0]} {given.bin}{' --long' if given.long else ''} --seed {given.seed}"
                      f"{' ' + name if given.names else ''}", flush=True)
                continue
            finally:
                shutil.rmtree(folder, ignore_errors=True)
            played += 1
            caught_bugs += bool(judgement.faults)
            caught = f"caught: {judgement.faults[0][0]}: {judgement.faults[0][1][:120]}; " if judgement.faults else "no fault; "
            print(f"{name}, seed {seed}, rounds {rounds}: {caught}{judgement.sessions} sessions, {judgement.acknowledged} chunks acknowledged, "
                  f"{judgement.samples} samples compared, {time.monotonic() - began:.1f} s", flush=True)
        print(f"{played} labs played, {bad} failed, {caught_bugs} planted faults caught")
    finally:
        if template is not None:
            template.cluster.stop("immediate")
        shutil.rmtree(scratch, ignore_errors=True)
    return 1 if bad or not played else 0


if __name__ == "__main__":
    sys.exit(main())
