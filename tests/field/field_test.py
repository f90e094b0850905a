#!/usr/bin/env python3
"""Files, clocks and terminals as they are outside (README.md): each row asks one question of one entrance.

usage: field_test.py --bin FOLDER [--only TEXT]
"""
import argparse
import pathlib
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from lab import Lab, Programs  # noqa: E402
import clocks  # noqa: E402
import curves  # noqa: E402
import lists  # noqa: E402
import network  # noqa: E402
import tables  # noqa: E402
import tracks  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    failed = asked = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        programs = Programs(options.bin.resolve(), folder)
        lab = Lab(programs)
        try:
            for room in (tracks, curves, lists, tables, network, clocks):
                for question, ask in room.rows(lab):
                    title = f"{room.__name__}: {question}"
                    if options.only not in title:
                        continue
                    asked += 1
                    wrong = ask()
                    failed += bool(wrong)
                    print(f"{'not ok' if wrong else 'ok'}  {title}" + (f"\n        {wrong}" if wrong else ""), flush=True)
        finally:
            lab.stop()
    print(f"{asked} questions, {failed} answered wrongly")
    return 1 if failed or asked == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
