#!/usr/bin/env python3
"""Checks the suite itself: runs the shortest history that shows each planted bug, with the bug and without.

Four of the ten show in a power cut only: tests/powercut covers those (README.md has the table).
"""
import argparse
import sys

from crash_page import IN_COMMIT
from lab import Failed, Lab, Programs
from rude_client import ACK, REFUSAL, RudeClient


def ack_before_commit(lab):
    """Kills at the first write of a commit, after the server had time to send a premature acknowledgement."""
    lab.start_server()
    lab.start_station("station-1", sessions=100, samples=2000)
    # the commit may hold only the clock's offset, without an acknowledgement: then try again
    for _ in range(3 if lab.plant else 1):
        lab.wait_for_more("ack", 8)
        lab.page.arm(IN_COMMIT, 1, hold_ms=300)
        if lab.server_died() != IN_COMMIT:
            raise Failed("the server died elsewhere than in the commit")
        faults = lab.judge(at_end=False).faults
        if faults:
            return faults
        lab.start_server()
    return []


def repeated_chunk_stored_twice(lab):
    lab.start_server()
    client = RudeClient(lab)
    client.record(2)
    try:
        for seq in (0, 0, 1):
            client.chunk(seq)
        client.end(2)
    except ConnectionError:
        if not lab.plant:  # stored twice, chunk 0 replaces chunk 1: a contradiction, which ends the connection
            raise
    lab.stop_server()
    return lab.judge(at_end=True).faults


def gap_accepted(lab):
    lab.start_server()
    client = RudeClient(lab)
    client.record(3)
    client.chunk(0)
    if client.chunk(2, acknowledged=2) == REFUSAL:
        client.chunk(1)
        client.chunk(2)
        client.end(3)
    lab.stop_server()
    return lab.judge(at_end=True).faults


def hash_not_checked(lab):
    lab.start_server()
    client = RudeClient(lab)
    client.record(1)
    if client.chunk(0) != ACK:
        raise Failed("a good chunk was refused")
    if client.close(1, bytes(32)) == REFUSAL:
        client.end(1)
    lab.stop_server()
    return lab.judge(at_end=True).faults


def spool_purged_at_ack(lab):
    """Restores yesterday's backup: later chunks are still in the spools."""
    lab.start_server()
    lab.backup()
    lab.start_station("station-1", samples=300)
    lab.drain(["station-1"])
    lab.stop_server()
    lab.restore(lab.backups[0])
    lab.start_server()
    lab.drain(["station-1"])
    lab.stop_server()
    return lab.judge(at_end=True).faults


def sample_lost_at_reconnection(lab):
    """The station records until it is told to end, so that it certainly has more to send when it comes back."""
    lab.start_server()
    lab.start_station("station-1", sessions=100, samples=2000)
    lab.wait_for_more("ack", 3)
    lab.stop_server()
    lab.start_server()
    lab.wait_for_more("ack", 3)
    lab.stop_station("station-1")
    lab.drain(["station-1"])
    lab.stop_server()
    return lab.judge(at_end=True).faults


# bug -> the history, and the possible names of its faults
BUGS = {
    "ack-before-commit": (ack_before_commit, {"acknowledged-but-missing"}),
    "repeated-chunk-stored-twice": (repeated_chunk_stored_twice, {"doubled"}),
    "gap-accepted": (gap_accepted, {"gap"}),
    "hash-not-checked": (hash_not_checked, {"wrong-hash"}),
    "spool-purged-at-ack": (spool_purged_at_ack, {"recorded-but-missing", "acknowledged-but-missing"}),
    "sample-lost-at-reconnection": (sample_lost_at_reconnection, {"gap"}),
}


def run(programs, bug, planted):
    """Returns a message about a wrong outcome, or nothing."""
    history, names = BUGS[bug]
    with Lab(programs, plant=bug if planted else None) as lab:
        try:
            faults = history(lab)
        except (Failed, ConnectionError, OSError) as error:
            return f"the history could not be played: {error}\n{lab.said()}"
    found = {name for name, _ in faults}
    if planted and not found & names:
        return f"NOT CAUGHT: one of {sorted(names)} was expected, found was {sorted(found)}"
    if not planted and faults:
        return "faults although no bug is in: " + "; ".join(f"{name}: {text}" for name, text in faults)
    if planted:
        print(f"{bug}: caught: {faults[0][0]}: {faults[0][1]}", flush=True)
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, help="folder of the built programs")
    parser.add_argument("--bug", choices=sorted(BUGS), action="append", help="only this; may be repeated")
    options = parser.parse_args()
    programs, bad = Programs(options.bin, stations=1), 0
    for bug in options.bug or BUGS:
        for planted in (True, False):
            if wrong := run(programs, bug, planted):
                bad += 1
                print(f"{bug}, {'planted' if planted else 'without it'}: {wrong}\n"
                      f"repeat: python3 tests/durability/harness/planted.py --bin {options.bin} --bug {bug}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
