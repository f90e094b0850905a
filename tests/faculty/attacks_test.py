#!/usr/bin/env python3
"""A faculty's servers, its PostgreSQL and its NATS are killed, stopped and cut off from each other under fifty stations: nothing acknowledged is lost or
doubled, stations stream and people see again soon, who is deposed acknowledges nothing; and what would break that is caught.

usage: attacks_test.py BIN [--long] [--seed N] [--stations N] [--folder DIR] [SCENARIO]...
       attacks_test.py --list

Without names: a few scenarios, once each, and the planted bugs; --long (or NEEDLELAB_LONG=1): all of them under fifty stations, kills twenty times, the others six; there a p90
above the goal is a failure. A scenario NAME-planted has the bug NAME, and is passed when it is found. Without PostgreSQL 15 or NATS it says so and
exits with 77.
"""
import argparse
import collections
import dataclasses
import os
import pathlib
import random
import shutil
import signal
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "postgres" / "faults")]
import attacks  # noqa: E402
from clusters import PG, Failed, give  # noqa: E402
from faculty_lab import NATS, CannotPlay, FacultyLab, faculty_template, nats_is_here, sound  # noqa: E402
from measures import GOAL_S, Away  # noqa: E402

STATIONS, SHORT_STATIONS, FEW = 50, 12, 6
KILLS, OTHERS, SEEDS = 10, 3, 2  # for the long form: twenty kills of each kind, six faults of every other kind


@dataclasses.dataclass(frozen=True)
class Scenario:
    play: object
    short: bool = False     # also in the short form
    separate: bool = False  # each part is a separate machine
    few: bool = False       # it does not need many stations
    goal: bool = True       # stations stream and people see again within the goal
    rounds: int = OTHERS


SCENARIOS = {
    "server-killed": Scenario(attacks.of(attacks.kill_server), short=True, rounds=KILLS),
    "primary-killed": Scenario(attacks.of(attacks.kill_primary), short=True, rounds=KILLS),
    "standby-killed": Scenario(attacks.of(attacks.kill_standby), rounds=KILLS),
    "nats-killed": Scenario(attacks.of(attacks.kill_nats), short=True, rounds=KILLS),
    "server-stopped": Scenario(attacks.of(attacks.pause_server)),
    "primary-stopped": Scenario(attacks.of(attacks.pause_primary)),
    "standby-stopped": Scenario(attacks.of(attacks.pause_standby)),
    "nats-stopped": Scenario(attacks.of(attacks.pause_nats)),
    "server-deposed": Scenario(attacks.deposed_server, short=True),
    "primary-deposed": Scenario(attacks.of(attacks.depose_primary, spare=True), short=True, separate=True),
    "server-from-postgres": Scenario(attacks.of(attacks.cut_server_from_postgres), separate=True),
    "server-from-nats": Scenario(attacks.of(attacks.cut_server_from_nats), separate=True),
    "stations-from-server": Scenario(attacks.of(attacks.cut_stations_from_server), separate=True),
    "slow-viewers": Scenario(attacks.of(attacks.slow_viewers)),
    "clocks-apart": Scenario(attacks.clocks_apart),
    "presence": Scenario(attacks.presence_ends, short=True, few=True),
    "access": Scenario(attacks.access_ends, short=True, few=True),
    "stop": Scenario(attacks.stop_after_a_takeover, short=True, few=True),
}
# value of NEEDLELAB_PLANT -> the scenario that finds it, and as what
PLANTED = {
    "takeover-unfenced": ("server-deposed", {"acknowledged-by-a-deposed-server"}),
    "revoked-token-honoured": ("access", {"token-outlives-access"}),
    "epoch-ignored": ("stop", {"stop-at-the-wrong-place"}),
    "presence-for-ever": ("presence", {"online-for-ever"}),
}
SUFFIX = "-planted"
KNOWN = [*SCENARIOS, *(bug + SUFFIX for bug in PLANTED)]


@dataclasses.dataclass(frozen=True)
class Planned:
    name: str
    seed: int
    rounds: int
    stations: int
    is_timed: bool = True  # FacultyLab.within()

    @property
    def bug(self):
        return self.name.removesuffix(SUFFIX) if self.name.endswith(SUFFIX) else None

    @property
    def scenario(self):
        return SCENARIOS[PLANTED[self.bug][0] if self.bug else self.name]


def plan(names, is_long, seed, stations=None):
    """The labs to run. A seed is drawn for each name, requested or not: a scenario alone gets the same seeds as among all."""
    dice = random.Random(seed)
    for name in KNOWN:
        bug = name.removesuffix(SUFFIX) if name.endswith(SUFFIX) else None
        scenario = SCENARIOS[PLANTED[bug][0] if bug else name]
        seeds = [dice.randrange(10**6) for _ in range(SEEDS)]
        if names and name not in names or not names and not is_long and not (scenario.short or bug):
            continue
        most = STATIONS if is_long else SHORT_STATIONS
        count = stations or (min(FEW, most) if scenario.few or bug else most)
        for one in seeds if is_long and not bug else seeds[:1]:
            yield Planned(name, one, scenario.rounds if is_long and not bug else 1, count, is_long or bug is not None)


def play(template, folder, planned):
    """Runs one scenario in its own lab; returns its judgement and the lab."""
    scenario = planned.scenario
    with FacultyLab(template, folder, planned.stations, planned.bug, scenario.separate) as lab:
        lab.is_timed = planned.is_timed
        try:
            judgement = scenario.play(lab, random.Random(planned.seed), planned.rounds)
            if not planned.bug:
                return sound(judgement), lab
            wanted = PLANTED[planned.bug][1]
            if not {fault for fault, _ in judgement.faults} & wanted:
                raise Failed(f"NOT CAUGHT: one of {sorted(wanted)} was expected, found was {judgement.faults[:3]}")
            return judgement, lab
        except CannotPlay:
            raise
        except Exception as error:
            raise Failed(f"{type(error).__name__}: {error}\n{lab.said()}") from error


class Table:
    """The combined results of all labs of a scenario."""
    COUNTED = ("labs", "faults played", "chunks acknowledged", "samples compared", "chunks lost", "samples doubled")
    TIMES = ("stations again, s", "stations away, s", "viewers again, s", "viewers away, s")

    def __init__(self):
        self.sums, self.seeds = collections.defaultdict(collections.Counter), collections.defaultdict(list)
        self.stations, self.viewers = collections.defaultdict(Away), collections.defaultdict(Away)
        self.caught = 0

    def add(self, planned, judgement, faults_played, stations_away, viewers_away):
        doubled = sum(fault == "doubled" for fault, _ in judgement.faults)
        numbers = (1, faults_played, judgement.acknowledged, judgement.samples, judgement.lost, doubled)
        self.sums[planned.name].update(dict(zip(self.COUNTED, numbers)))
        self.seeds[planned.name].append(str(planned.seed))
        self.caught += bool(judgement.faults)
        self.stations[planned.name].extend(stations_away)
        self.viewers[planned.name].extend(viewers_away)

    def text(self):
        """In Markdown; times are p50 / p90."""
        lines = [("scenario", *self.COUNTED, *self.TIMES, "seeds"), ("---", *["---:"] * len(self.COUNTED), *["---"] * len(self.TIMES), "---")]
        for name, sums in self.sums.items():
            lines.append((name, *(sums[one] for one in self.COUNTED), *self.stations[name].text(), *self.viewers[name].text(), " ".join(self.seeds[name])))
        return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)

    def slow(self):
        """Lines of text: those with a p90 over the goal."""
        for name in self.sums:
            if name in SCENARIOS and SCENARIOS[name].goal:
                for who, away in (("stations", self.stations[name]), ("viewers", self.viewers[name])):
                    if (found := away.over_goal()) is not None:
                        yield f"{name}: {who} again after {found:.1f} s (p90), the goal is {GOAL_S} s"


def line_of(planned, judgement, lab, seconds):
    caught = f"caught: {judgement.faults[0][0]}: {judgement.faults[0][1][:120]}; " if judgement.faults else "no fault; "
    again = "".join(f"{who} again {away.text()[0]} s, away {away.text()[1]} s (p50 / p90 of {len(away.again)}); "
                    for who, away in (("stations", lab.stations_away), ("viewers", lab.viewers_away)) if away.again)
    notes = "".join(f"{note}; " for note in lab.notes)
    return (f"{planned.name}, seed {planned.seed}, rounds {planned.rounds}, {planned.stations} stations: {caught}{judgement.sessions} sessions, "
            f"{judgement.acknowledged} chunks acknowledged, {judgement.samples} samples compared; {again}{notes}{seconds:.1f} s")


def arguments(words=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", nargs="?", type=pathlib.Path)
    parser.add_argument("names", nargs="*", metavar="SCENARIO")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--stations", type=int)
    parser.add_argument("--folder", type=pathlib.Path, default="/tmp", help="for all files, a short path; /dev/shm spares a slow disk (no power is cut here)")
    parser.add_argument("--seed", type=int, default=int(os.environ.get("NEEDLELAB_SEED", time.time())))
    given = parser.parse_intermixed_args(words)
    if given.list:
        return given
    if given.bin is None:
        parser.error("BIN is the folder of the programs")
    if unknown := [name for name in given.names if name not in KNOWN]:
        parser.error(f"there is no scenario {unknown[0]}; there are: {', '.join(KNOWN)}")
    return given


def main():
    given = arguments()
    if given.list:
        print("\n".join(KNOWN))
        return 0
    if not os.access(PG / "initdb", os.X_OK):
        print("PostgreSQL 15 is not installed; deploy/setup installs it")
        return 77
    if not nats_is_here():
        print(f"{NATS} is not installed; deploy/setup installs it")
        return 77
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that clusters, which are sessions of their own, end with it
    is_long = given.long or bool(os.environ.get("NEEDLELAB_LONG"))
    labs = list(plan(given.names, is_long, given.seed, given.stations))
    print(f"seed {given.seed}", flush=True)
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="nl-att-", dir=given.folder))  # a socket's path has at most 107 bytes
    scratch.chmod(0o755)  # the user postgres must be able to enter it
    give(scratch)
    table, played, bad, template = Table(), 0, 0, None
    try:
        template = faculty_template(given.bin, scratch, max(planned.stations for planned in labs))
        for number, planned in enumerate(labs):
            began, folder = time.monotonic(), scratch / f"l{number}"
            try:
                judgement, lab = play(template, folder, planned)
            except CannotPlay as reason:
                print(f"{planned.name}: not played: {reason}", flush=True)
                continue
            except Failed as error:
                played, bad = played + 1, bad + 1
                print(f"{planned.name}, seed {planned.seed}: FAILED: {error}\nrepeat: {sys.argv[0]} {given.bin} {planned.name}"
                      f"{' --long' if given.long else ''} --seed {given.seed}", flush=True)
                continue
            finally:
                shutil.rmtree(folder, ignore_errors=True)
            played += 1
            table.add(planned, judgement, lab.faults_played, lab.stations_away, lab.viewers_away)
            print(line_of(planned, judgement, lab, time.monotonic() - began), flush=True)
    finally:
        if template is not None:
            template.cluster.stop("immediate")
        shutil.rmtree(scratch, ignore_errors=True)
    print(table.text())
    for text in table.slow():
        print(f"{'FAILED: ' if is_long else ''}{text}")
        bad += is_long
    print(f"{played} labs played, {bad} failed, {table.caught} planted faults caught")
    return 1 if bad or not played else 0


if __name__ == "__main__":
    sys.exit(main())
