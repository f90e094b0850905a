"""A course's results as a table for a spreadsheet: its expected content by the database, and what a CSV reader finds in it."""
import csv
import datetime
import io
import math
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
STYLES = {"comma": (",", "."), "semicolon": (";", ","), "tab": ("\t", ".")}
HEAD = ["Person", "Full name", "Groups", "Exercise", "Verdict", "Attempts", "Attempts left", "Best attempt", "Date of best attempt (UTC)"]
# displayed units per SI unit, by the end of a measure's name; the longest match
UNITS = {"_m": (1e3, "mm"), "_m_s": (1e3, "mm/s"), "_m2": (1e4, "cm²"), "_s": (1, "s"), "_n": (1, "N"), "_j": (1e3, "mJ"),
         "_rad": (180 / math.pi, "°"), "_share": (100, "%")}


def unit_of(name):
    ends = [end for end in UNITS if name.endswith(end)]
    return UNITS[max(ends, key=len)] if ends else (1, "")


def words_of(name):
    """The name used by the page about measures."""
    layer = re.search(r"_layer_(\d+)_", name)
    row = name.replace(layer[0], "_layer_K_") if layer else name
    found = re.search(rf"^\| `{row}` \|(?:[^|]*\|){{2}} ([^|]+) \|", (ROOT / "common/scoring/README.md").read_text(encoding="utf-8"), re.MULTILINE)
    return found[1].replace("layer K", f"layer {layer[1]}") if layer else found[1]


def measures_of(facts, course):
    """The measures required by the exercises, each once."""
    names = []
    for exercise in facts.course(course):
        names += [r["measure"] for r in exercise["json"].get("requirements", [])] + ["needle_time_s"] * ("time_limit_s" in exercise["json"])
    return list(dict.fromkeys(names))


def expected(facts, course, names):
    """(header, rows): cells as Python values; None: empty."""
    measures = measures_of(facts, course)
    titles = [words_of(name) + (f" [{unit_of(name)[1]}]" if unit_of(name)[1] else "") for name in measures]
    rows = []
    for name in names:
        for exercise in facts.course(course):
            ident = exercise["id"]
            tried, verdict, best = len(facts.counted(name, ident)), facts.passed(name, ident), facts.best(name, ident)
            excused = any((s["trainee"], s["exercise_id"]) == (name, ident) for s in facts.sessions)
            text = {True: "passed", False: "not passed", None: "no verdict" if tried else "excused" if excused else "not tried"}[verdict]
            score = {m["measure"]: m["value"] for m in best["score"] or []} if best else {}
            shown = [None if score.get(m) is None else float(score[m] * unit_of(m)[0]) for m in measures]
            person = facts.people.get(name, {"full_name": ""})
            rows.append([name, person["full_name"] or None, "; ".join(facts.groups_of(name)) or None, exercise["json"]["name"], text, tried, facts.left(name, ident),
                         best and best["attempt"], best and best["started_unix_ns"] // 1_000_000_000, *shown])
    return HEAD + titles, rows


def held_rows(held, screen, where, wanted, header, rows):
    """The cells read: None, text, or a number."""
    titles, lines = wanted
    held.same(screen, "columns", where, titles, header)
    held.same(screen, "rows: people, exercises", where, [line[:4] for line in lines], [row[:4] for row in rows])
    for line, row in zip(lines, rows):
        at = f"{where} {line[0]} {line[3]}"
        held.same(screen, "verdict", at, line[4], row[4])
        held.same(screen, "attempts, left, number of the best one", at, line[5:8], row[5:8])
        held.same(screen, "date of the best one", at, line[8], row[8])
        for title, value, seen in zip(titles[9:], line[9:], row[9:]):
            held.same(screen, "a measure of the best one, in its unit", f"{at} {title}", value, seen, 5.1e-7)


def seconds_of(text):
    """A moment in UTC, in seconds, as spreadsheets read it."""
    return int(datetime.datetime.strptime(text, "%Y-%m-%d %H:%M:%S").replace(tzinfo=datetime.timezone.utc).timestamp())


def cells(content, separator):
    """(header, rows) of the file's bytes, by Python's reader, with the types of `expected`."""
    delimiter, sign = STYLES[separator]
    lines = list(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), delimiter=delimiter, strict=True))

    def number(text, whole):
        if text == "":
            return None
        if whole and re.fullmatch(r"\d{1,9}", text):
            return int(text)
        if not whole and re.fullmatch(rf"-?\d{{1,12}}(?:{re.escape(sign)}\d{{1,6}})?", text):
            return float(text.replace(sign, "."))
        return text  # differs from every number
    return lines[0], [[cell or None for cell in row[:5]] + [number(cell, True) for cell in row[5:8]] + [seconds_of(row[8]) if row[8] else None] +
                      [number(cell, False) for cell in row[9:]] for row in lines[1:]]


def by_reader(held, screen, where, facts, course, names, content, separator):
    held.same(screen, "a byte order mark, lines that end in CRLF", where, [True, content.count(b"\n")],
              [content.startswith(b"\xef\xbb\xbf"), content.count(b"\r\n")])
    held_rows(held, screen, where, expected(facts, course, names), *cells(content, separator))
