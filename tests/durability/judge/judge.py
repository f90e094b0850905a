#!/usr/bin/env python3
"""The judge: checks that a database holds every sample recorded by stations and every acknowledged chunk.

Python's standard library only; written from common/gesture/FORMAT.md, db/migrations and the field numbers of proto/.
Exit code 0: no fault; 1: faults, one per line on standard output, each with its name first; 2: cannot judge.
"""
import argparse
import pathlib
import sys

from database import Database, chunks_in
from ledger import Ledgers
from verdict import judge_all


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("database", type=pathlib.Path, help="needlelab.db of a server that does not run; its -wal counts")
    parser.add_argument("ledgers", type=pathlib.Path, help="folder of *.jsonl")
    parser.add_argument("--backup", type=pathlib.Path, action="append", default=[], help="a backup file; may be repeated")
    parser.add_argument("--midway", action="store_true", help="stations have not drained: what was acknowledged since the last restore counts")
    parser.add_argument("--loss-ms", type=float, default=20, help="what a killed station may lose (default 20)")
    options = parser.parse_args()
    if not options.database.is_file() or not options.ledgers.is_dir():
        parser.error(f"{options.database} or {options.ledgers} is not there")
    ledgers = Ledgers(options.ledgers, options.loss_ms * 1e6)
    judge = judge_all(Database(options.database), ledgers, [chunks_in(path) for path in options.backup], not options.midway)
    for name, text in judge.faults:
        print(f"{name}: {text}")
    print(f"{judge.sessions} of {len(ledgers.sessions)} sessions, {judge.chunks} chunks, {judge.samples} samples compared, "
          f"{judge.acknowledged} chunks acknowledged: {len(judge.faults)} faults", file=sys.stderr)
    return 1 if judge.faults else 0


if __name__ == "__main__":
    sys.exit(main())
