#!/usr/bin/env python3
"""Changes one line of the product at a time, by seed, and notes whether a test finds it. Run it before and after a change that deletes tests: what was
found before is found after.

usage: mutants.py BUILD OUT.tsv [--seed N] [--each N] [--only SUBJECT] [--again FILE.tsv]

BUILD is a build directory of this checkout, whose files are changed and put back: use a checkout of its own, built without batches
(-DCMAKE_UNITY_BUILD=OFF), where a changed file is compiled alone. Each subject has --each mutants. A line
that does not compile is drawn again; a test that hangs has found its mutant. First the suites must pass on the unchanged code. OUT.tsv has a row for each: subject, file, line, old, new, found by.
--again takes the mutants from an earlier table (by their text, where it is nearest to its line of then).
"""
import argparse
import csv
import pathlib
import random
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# files to change, and the suites that should notice, quickest first
SUBJECTS = {
    "engine": (["common/haptics/tick.cpp", "common/haptics/effects/*.cpp", "common/haptics/models/*.cpp"], ["determinism_test", "fem_test", "haptics_test", "body_test"]),
    "gate": (["common/haptics/gate/force_gate.cpp", "common/haptics/gate/passivity_control.cpp"], ["haptics_test", "stability_test"]),
    "writer": (["db/sessions/db_writer.cpp", "db/sessions/session_appends.cpp", "db/sessions/session_store.cpp"], ["db_test", "server_net_test", "service_test"]),
    "spool": (["client/net/spool/spool*.cpp"], ["net_test", "spool_order_test"]),
    "hub": (["server/live/hub/hub*.cpp"], ["server_test", "server_net_test"]),
    "permissions": (["db/service/requests/requests.cpp", "db/service/**/*_handlers.cpp", "server/live/port/rules.cpp"], ["server_test", "service_test", "service_records_test"]),
}
SWAPS = [("<=", "<"), (">=", ">"), (" < ", " <= "), (" > ", " >= "), ("==", "!="), ("!=", "=="), ("&&", "||"), ("||", "&&"), (" + ", " - "), (" - ", " + "),
         (" * ", " / "), ("true", "false"), ("false", "true"), ("std::min", "std::max"), ("std::max", "std::min"), ("if (!", "if ("), ("++", "--")]
LONGEST_S = 900


def mutants_of(path):
    """(line number, old, new) of each possible change of a file."""
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines()):
        code = re.sub(r'"[^"]*"', lambda text: "~" * len(text[0]), line.split("//")[0])
        if not code.strip() or code.lstrip().startswith(("#", "///", "*", "using", "static_assert", "template", "namespace")) or "operator" in code or "assert(" in code:
            continue
        for old, new in SWAPS:
            if (at := code.find(old)) >= 0:
                found.append((number, line, line[:at] + new + line[at + len(old):]))
        for digits in re.finditer(r"(?<![\w.])(\d+)(?![\w.])", code):
            found.append((number, line, line[:digits.start()] + str(int(digits[1]) + 1) + line[digits.end():]))
        if re.fullmatch(r"\s+[\w.>\-\[\]]+(\(.*\)| = .*|\+\+);\s*", code):
            found.append((number, line, line[:len(line) - len(line.lstrip())] + ";"))
    return found


def run(*command, seconds=LONGEST_S):
    try:
        return subprocess.run(list(map(str, command)), cwd=ROOT, timeout=seconds, check=False, capture_output=True).returncode
    except subprocess.TimeoutExpired:
        return -1


def found_by(build, suites):
    """The suite that fails; "" if none does; None if the change does not compile."""
    if run("ninja", "-C", build, *suites, seconds=3600) != 0:
        return None
    for suite in suites:
        if run(build / "bin" / suite, "--gtest_brief=1", "--gtest_fail_fast") != 0:
            return suite
    return ""


def play(build, suites, path, number, new):
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines(keepends=True)
    lines[number] = new + "\n"
    try:
        path.write_text("".join(lines), encoding="utf-8")
        return found_by(build, suites)
    finally:
        path.write_text(text, encoding="utf-8")


def drawn(given):
    """Yields subject, path, line number, old, new until the caller has enough of a subject (it sends True)."""
    for subject, (patterns, _) in SUBJECTS.items():
        if given.only in (None, subject):
            choice = random.Random(f"{given.seed} {subject}")
            every = [(path, *one) for pattern in patterns for path in sorted(ROOT.glob(pattern)) for one in mutants_of(path)]
            choice.shuffle(every)
            for path, number, old, new in every:
                if (yield subject, path, number, old, new):
                    break


def repeated(given):
    with open(given.again, encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file, delimiter="\t"):
            path = ROOT / row["file"]
            lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
            same = [number for number, line in enumerate(lines) if line == row["old"]]
            number = min(same, key=lambda number: abs(number + 1 - int(row["line"] or 0)), default=None)
            yield row["subject"], path, number, row["old"], row["new"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument("--each", type=int, default=10)
    parser.add_argument("--only", choices=SUBJECTS)
    parser.add_argument("--again", type=pathlib.Path)
    given = parser.parse_args()
    build = given.build.resolve()
    for subject, (_, suites) in SUBJECTS.items():
        if given.only in (None, subject) and (by := found_by(build, suites)) != "":
            print(f"{subject}: {by or 'the build'} fails without a mutant", file=sys.stderr)
            return 1
    counts = dict.fromkeys(SUBJECTS, 0)
    with open(given.out, "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, delimiter="\t", lineterminator="\n")
        table.writerow(["subject", "file", "line", "old", "new", "found_by"])
        source = repeated(given) if given.again else drawn(given)
        enough = None
        while True:
            try:
                subject, path, number, old, new = source.send(enough)
            except StopIteration:
                break
            by = "the line is gone" if number is None else play(build, SUBJECTS[subject][1], path, number, new)
            enough = None
            if by is None and not given.again:
                continue
            counts[subject] += 1
            table.writerow([subject, path.relative_to(ROOT), "" if number is None else number + 1, old, new, "does not compile" if by is None else by or "nothing"])
            file.flush()
            print(f"{subject} {counts[subject]}: {path.relative_to(ROOT)}: {new.strip()}: {by or 'not found'}", file=sys.stderr)
            enough = not given.again and counts[subject] >= given.each
    return 0


if __name__ == "__main__":
    sys.exit(main())
