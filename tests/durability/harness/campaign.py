#!/usr/bin/env python3
"""Repeats kill -9 of server and stations under load; after each kill the judge compares every acknowledged sample.

The seed picks one of three kinds of server kill: before the n-th write or sync of a commit, before that of a
checkpoint, or at a random instant. The shared page then shows the server's phase at its death, which is counted.
"""
import argparse
import os
import random
import sys
import time

from crash_page import ELSEWHERE, IN_CHECKPOINT, IN_COMMIT
from lab import Failed, Lab, Programs, loss_ms, until

IN_A_LAB = 10  # kills per lab; then it is drained, judged and replaced by a new lab, which keeps the judge fast
LEAST_SHARE = 0.2
PHASES = {ELSEWHERE: "elsewhere", IN_COMMIT: "in a commit", IN_CHECKPOINT: "in a checkpoint"}


def kill_server(lab, draw, must_hit):
    """Kills after some acknowledgements since the last start; returns the phase in which the server died."""
    lab.wait_for_more("ack", draw.randint(1, 10))
    kind, operation, wait_s = draw.random(), draw.randint(1, 8), draw.uniform(0, 0.06)
    if kind < 0.35 or (must_hit and kind < 0.7):
        lab.page.arm(IN_COMMIT, operation)
    elif kind < 0.6 or must_hit:
        lab.page.arm(IN_CHECKPOINT, operation)
    else:
        time.sleep(wait_s)
        return lab.kill_server()
    try:
        until(lambda: lab.server.poll() is not None, "the armed operation", seconds=3)
    except Failed:  # that many did not come: kill at any point
        lab.server.kill()
    return lab.server_died()


def one_lab(programs, seed, server_kills, station_kills, loss, counts):
    """Returns the faults of one lab, as (name, text)."""
    draw = random.Random(seed)
    jobs = ["server"] * server_kills + ["station"] * station_kills
    draw.shuffle(jobs)
    with Lab(programs, loss=loss) as lab:
        try:
            lab.start_server()
            for name in programs.stations:
                lab.start_station(name, seed=draw.getrandbits(32), sessions=1000, samples=700)
            for job in jobs:
                if job == "server":
                    phase = kill_server(lab, draw, must_hit=False)
                    counts[PHASES[phase]] = counts.get(PHASES[phase], 0) + 1
                    judged = lab.judge(at_end=False)
                    if judged.faults:
                        return judged.faults
                    lab.start_server()
                else:
                    lab.wait_for_more("s", draw.randint(1, 600))
                    name = draw.choice(programs.stations)
                    lab.kill_station(name)
                    counts["stations"] = counts.get("stations", 0) + 1
                    lab.start_station(name, seed=draw.getrandbits(32), sessions=1000, samples=700)
            for name in programs.stations:
                lab.stop_station(name)
            lab.drain(programs.stations)
            lab.stop_server()
            judged = lab.judge(at_end=True)
            counts["held up at most, ms"] = max(counts.get("held up at most, ms", 0), round(lab.most_held_up_ns / 1e6, 1))
            for what in ("sessions", "chunks", "samples", "acknowledged"):
                counts[what] = counts.get(what, 0) + getattr(judged, what)
            return judged.faults
        except (Failed, OSError) as error:
            return [("harness", f"{error}\n{lab.said()}")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, help="folder of the built programs")
    is_long = os.environ.get("NEEDLELAB_LONG")
    parser.add_argument("--kills", type=int, default=100 if is_long else 6, help="of the server")
    parser.add_argument("--station-kills", type=int, default=100 if is_long else 3)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("NEEDLELAB_SEED", "20261120")))
    parser.add_argument("--loss-ms", type=float, help="what a killed station may lose (lab.py has the defaults)")
    options = parser.parse_args()
    loss = loss_ms(options.loss_ms)
    programs, counts, began = Programs(options.bin), {}, time.monotonic()
    seed, server_left, station_left = options.seed, options.kills, options.station_kills
    while server_left > 0 or station_left > 0:
        server_kills, station_kills = min(IN_A_LAB, server_left), min(IN_A_LAB, station_left)
        faults = one_lab(programs, seed, server_kills, station_kills, loss, counts)
        if faults:
            for name, text in faults[:20]:
                print(f"{name}: {text}")
            print(f"repeat: python3 tests/durability/harness/campaign.py --bin {options.bin} --seed {seed} "
                  f"--kills {server_kills} --station-kills {station_kills}")
            return 1
        seed, server_left, station_left = seed + 1, server_left - server_kills, station_left - station_kills
        print(f"seed {seed - 1}: {counts}", flush=True)
    inside = counts.get(PHASES[IN_COMMIT], 0) + counts.get(PHASES[IN_CHECKPOINT], 0)
    print(f"{options.kills} kills of the server, {inside} of them within a commit or a checkpoint; {options.station_kills} of stations; "
          f"{counts.get('acknowledged', 0)} chunks acknowledged, {counts.get('samples', 0)} samples in {counts.get('sessions', 0)} sessions: "
          f"none lost; {time.monotonic() - began:.0f} s")
    if options.kills and inside < LEAST_SHARE * options.kills:
        print(f"too few of the kills hit a commit or a checkpoint: at least {LEAST_SHARE:.0%} must")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
