#!/usr/bin/env python3
"""A course's results as LibreOffice opens them, beside the database: columns, texts, numbers that are numbers, dates that are dates.

usage: libreoffice_test.py --bin DIR --out FOLDER
  Makes a small class of data in FOLDER (deploy/demo --class), has needlelab-admin write its results with each separator, and
  LibreOffice read them without a window, with the separator and the language of a reader who has it.
Exit code 0: every cell is right; 1: some differ, each is named; 2: the comparison could not be made; 77: LibreOffice is missing.
"""
import argparse
import datetime
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import spreadsheet
from facts import Facts
from held import Held
from lab import Broken, Lab
from numbers_test import newest_class

# for the filter "Text - txt - csv (StarCalc)": the separator's code; Windows' language number (English, German)
READERS = {"comma": (ord(","), 1033), "semicolon": (ord(";"), 1031), "tab": (ord("\t"), 1033)}
SPACES = {"office": "urn:oasis:names:tc:opendocument:xmlns:office:1.0", "table": "urn:oasis:names:tc:opendocument:xmlns:table:1.0",
          "text": "urn:oasis:names:tc:opendocument:xmlns:text:1.0"}


def opened(office, file, separator, folder):
    """The file as a sheet: flat OpenDocument."""
    code, language = READERS[separator]
    sheet = folder / f"{separator}.fods"
    file = shutil.copy(file, folder / f"{separator}.csv")
    # columns in double quotes, UTF-8, from line 1; no column types; quoted numbers are numbers, too
    options = f"{code},34,76,1,,{language},false,true,false"
    command = [office, "--headless", "--norestore", f"-env:UserInstallation=file://{folder}/profile", f"--infilter=Text - txt - csv (StarCalc):{options}",
               "--convert-to", "fods", "--outdir", str(folder), str(file)]
    for _ in range(2):  # a first start may only create the profile
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        if sheet.exists():
            return sheet
    raise Broken(f"{office} made no sheet of {file}: {done.stdout[-500:]}{done.stderr[-500:]}")


def cells_of(sheet):
    """Rows of cells: None, text, a number; (type, value) for anything else: a date, or something unexpected."""
    def name(space, word):
        return f"{{{SPACES[space]}}}{word}"

    rows = []
    for row in ElementTree.parse(sheet).getroot().iter(name("table", "table-row")):
        line = []
        for cell in row.iter(name("table", "table-cell")):
            kind = cell.get(name("office", "value-type"))
            text = "\n".join("".join(part.itertext()) for part in cell.iter(name("text", "p")))
            value = None if kind is None else text if kind == "string" else float(cell.get(name("office", "value"))) if kind == "float" else (kind, cell.get(name("office", f"{kind}-value"), text))
            line += [value] * (int(cell.get(name("table", "number-columns-repeated"), "1")) if value is not None or len(line) < 100 else 0)
        rows.append(line)
    while rows and all(cell is None for cell in rows[-1]):
        rows.pop()
    return rows


def rows_of(sheet):
    """(header, rows) with the types of spreadsheet.expected."""
    head, *rows = cells_of(sheet)
    while head and head[-1] is None:
        head.pop()

    def moment(cell):
        if not isinstance(cell, tuple) or cell[0] != "date":
            return cell  # a text is not a date
        # a sheet stores days as a number: its seconds may be off by some microseconds
        return round(datetime.datetime.fromisoformat(cell[1][:26]).replace(tzinfo=datetime.timezone.utc).timestamp())
    rows = [(row + [None] * len(head))[:len(head)] for row in rows]
    return head, [[*row[:8], moment(row[8]), *row[9:]] for row in rows]


def walk(options, office, held):
    environment = dict(os.environ, NEEDLELAB_CLASS_OUT=str(options.out), NEEDLELAB_CLASS_COURSE="injection-steps")
    subprocess.run([spreadsheet.ROOT / "deploy/demo", "--class", "--once", "--small", "--bin", options.bin], env=environment, check=True)
    with tempfile.TemporaryDirectory(prefix="needlelab-libreoffice-") as name:
        folder = pathlib.Path(name)
        lab = Lab(newest_class(options.out), options.bin, folder / "class")
        # what a spreadsheet could mistake for the end of a cell, or for a formula
        lab.admin("user", "change", "anna", "--full-name", 'Keller; "Anna", ß')
        lab.settle()
        facts = Facts(lab.database())
        for course in sorted({e["curriculum_id"] for e in facts.exercises.values()}):
            names = facts.trainees_of(course)
            if not names:
                continue
            wanted = spreadsheet.expected(facts, course, names)
            for separator in READERS:
                file = folder / "results.csv"
                lab.admin("results", course, "--out", file, "--replace", "--separator", separator)
                spreadsheet.held_rows(held, f"LibreOffice, {separator}", course, wanted, *rows_of(opened(office, file, separator, folder)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="folder of the class")
    options = parser.parse_args()
    office = shutil.which("soffice") or shutil.which("libreoffice")
    if office is None:
        print("skipped: LibreOffice is not installed; deploy/setup --nightly installs it")
        return 77
    try:
        held = Held()
        walk(options, office, held)
    except (Broken, subprocess.SubprocessError) as error:
        print(f"libreoffice_test: {error}", file=sys.stderr)
        return 2
    for screen, number, where, expected, seen in held.differences[:100]:
        print(f"DIFFERS  {screen}: {number} ({where}): the database says {expected!r}, the sheet has {seen!r}")
    print(held.table())
    print(f"{sum(held.counts.values())} comparisons in {len(READERS)} sheets: {len(held.differences)} differ")
    return 1 if held.differences else 0


if __name__ == "__main__":
    sys.exit(main())
