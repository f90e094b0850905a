#!/usr/bin/env python3
"""Holds SECURITY.md against the repository.

usage: security_page.py SOURCE_DIR

1. Each promise of the table names a test, and each file and folder named on the page exists.
2. README.md and ARCHITECTURE.md link to the page.
3. It stays short: at most 150 lines.
4. Each limit of server/live/limits/limits.h has a row of tests/security/limits.tsv: the attack that it stops, and the test that shows it.
"""
import os
import re
import sys

MOST_LINES = 150
LIMIT = re.compile(r"^(?:struct (\w+) \{|  (?:std::\w+|std::chrono::\w+|double) (\w+)(?:[ {].*)?;.*)$", re.M)
PATH = re.compile(r"`((?:client|common|db|deploy|proto|server|tests)/[A-Za-z0-9_./-]+)(?: [^`]*)?`")


def limits(source):
    """Faults of the table of limits; none if the server's table is missing."""
    header, table = (os.path.join(source, *path.split("/")) for path in ("server/live/limits/limits.h", "tests/security/limits.tsv"))
    if not os.path.exists(header):
        return []
    with open(header, encoding="utf-8") as file:
        names, group = set(), ""
        for struct, field in LIMIT.findall(file.read()):
            group = struct or group
            if field:
                names.add(f"{group}.{field}")
    with open(table, encoding="utf-8") as file:
        rows = [line.split("\t") for line in file.read().splitlines()[1:]]
    faults = [f"limits.tsv: no attack is given for {name}" for name in sorted(names - {row[0] for row in rows})]
    faults += [f"limits.tsv: {row[0]} is not a limit" for row in rows if row[0] not in names]
    for name, _, path, test in rows:
        path = os.path.join(source, path)
        text = open(path, encoding="utf-8").read() if os.path.exists(path) else ""
        if not re.search(rf"^TEST(?:_F|_P)?\(\w+, {test}\)", text, re.M):
            faults.append(f"limits.tsv: {name}: test {test} is missing")
    return faults


def check(source):
    with open(os.path.join(source, "SECURITY.md"), encoding="utf-8") as file:
        lines = file.read().split("\n")
    faults = []
    if len(lines) > MOST_LINES:
        faults.append(f"SECURITY.md has {len(lines)} lines, at most {MOST_LINES} are read")
    promises = 0
    for number, line in enumerate(lines, 1):
        paths = PATH.findall(line)
        faults += [
            f"SECURITY.md:{number}: {path} is missing" for path in paths if not os.path.exists(os.path.join(source, path))
        ]
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.startswith("|") or len(cells) != 3 or cells[0] == "against" or set(cells[0]) == {"-"}:
            continue
        promises += 1
        if not any(path.startswith("tests/") and os.path.isfile(os.path.join(source, path)) for path in PATH.findall(cells[2])):
            faults.append(f"SECURITY.md:{number}: no test holds this promise: {cells[1][:60]}")
    if promises == 0:
        faults.append("SECURITY.md promises nothing: is the table 'against | promise | held by' gone?")
    for page in ("README.md", "ARCHITECTURE.md"):
        with open(os.path.join(source, page), encoding="utf-8") as file:
            if "(SECURITY.md)" not in file.read():
                faults.append(f"{page} does not link to SECURITY.md")
    return faults + limits(source), promises


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    faults, promises = check(os.path.realpath(sys.argv[1]))
    for fault in faults:
        print(fault)
    if faults:
        sys.exit(f"{len(faults)} faults: mend SECURITY.md, or bring back the test that it names")
    print(f"{promises} promises, each with a test that exists")


if __name__ == "__main__":
    main()
