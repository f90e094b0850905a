#!/usr/bin/env python3
"""Walks the screens of a class of data, and holds each number against the database by a computation of its own.

usage: numbers_test.py --bin DIR --class FOLDER [--sessions N] [--all]
  Without --all six screens, with the server stopped. --all: every screen of README.md, with a server too; then it spoils one number of
  each kind in turn and shows the commands a database that was changed behind the script's back, and fails where that is not noticed.
  FOLDER: what deploy/demo --class --once left (its newest folder, or the folder above it); it is copied, never changed.
Exit code 0: every number is right; 1: some differ, each is named; 2: the comparison could not be made. The table of what was held
goes to standard output.
"""
import argparse
import json
import pathlib
import sqlite3
import struct
import sys
import tempfile
import time

import commands
import served
from facts import OPEN, Facts
from gesture import Gesture, measures_of, message, strokes
from held import Held, differs, spoilt
from lab import Broken, Lab


def newest_class(folder):
    """The class's folder itself, or the newest one in it."""
    folder = pathlib.Path(folder)
    if (folder / "server" / "needlelab.db").is_file():
        return folder
    found = sorted(p.parent.parent for p in folder.glob("*/server/needlelab.db"))
    if not found:
        raise Broken(f"{folder}: no class is there; make one with NEEDLELAB_CLASS_COURSE=injection-steps deploy/demo --class --once")
    return found[-1]


def gesture_of(facts, s):
    return Gesture(facts.chunks(s), s["rate_hz"], json.loads(s["profile_json"]))


def some_of(sessions, count):
    """Evenly over all, including the last one: those of the live stations come last."""
    if len(sessions) <= count:
        return list(sessions)
    return [sessions[round(k * (len(sessions) - 1) / (count - 1))] for k in range(count)]


def plan_of(facts, s):
    return facts.exercises[s["exercise_id"]]["json"].get("plan") if s["exercise_id"] in facts.exercises else None


def measured(held, facts, sessions):
    """The stored scores compared with the measures computed from the samples."""
    gestures = {}
    for s in sessions:
        g = gestures[s["number"]] = gesture_of(facts, s)
        said = message(s["description"])
        held.same("stored session", "started_unix_ns: of the row and of the station's words", s["uuid"], s["started_unix_ns"], said[11])
        held.same("stored session", "station, rate: of the row and of the station's words", s["uuid"],
                  [s["station"], s["rate_hz"]], [said[2].decode(), struct.unpack("<d", said[9])[0]])
        held.same("stored session", "the trainee stands in the row alone", s["uuid"], 3 in said, False)
        held.same("stored score", "samples in the chunks", s["uuid"], s["samples"], g.count)
        asked = facts.exercises[s["exercise_id"]]["json"] if s["exercise_id"] in facts.exercises else {}
        own = measures_of(g, asked)
        seen = {m["measure"]: m["value"] for m in s["score"] if m["value"] is not None and m["measure"] != "dtw_distance_m"}
        held.same("stored score", "which measures there are", s["uuid"], sorted(own), sorted(seen))
        for name, value in own.items():
            if name in seen:
                held.close("stored score", name.split("_layer_")[0] + ("_layer_K_n" if "_layer_" in name else ""), s["uuid"], float(value), seen[name], 1e-8)
        limits = {r["measure"]: (r.get("min"), r.get("max")) for r in asked.get("requirements", [])}
        if "time_limit_s" in asked:
            limits["needle_time_s"] = (None, asked["time_limit_s"])
        for m in s["score"]:
            low, high = limits.get(m["measure"], (None, None))
            held.same("stored score", "min and max: the exercise's", f"{s['uuid']} {m['measure']}", [low, high], [m.get("min"), m.get("max")])
        for m in s["score"]:
            hidden = g.holes()[1] and m["measure"] not in ("elapsed_s", "missing_s", "ends_in_tissue") and m["value"] is not None
            held.same("stored score", "incomplete: a hole may hide a part", f"{s['uuid']} {m['measure']}", hidden, m.get("incomplete", False))
        met = [m["value"] is not None and not m.get("incomplete") and (m.get("min") is None or m["value"] >= m["min"]) and (m.get("max") is None or m["value"] <= m["max"])
               for m in s["score"] if m["measure"] in limits]
        held.same("stored score", "passed: all requirements met", s["uuid"], all(met) if met else None, s["verdict"])
    return gestures


def on_disk(held, facts, lab, chosen, gestures, now_ns):
    """The six screens: results, session list, progress, session show, score, export."""
    commands.results(held, facts, lab, now_ns)
    commands.sessions(held, facts, lab)
    commands.progress(held, facts, lab, now_ns)
    for s in chosen:
        commands.session(held, facts, lab, s)
    for s in chosen[:: max(1, len(chosen) // 2)]:
        commands.exports(held, facts, lab, s, gestures[s["number"]])


def more_on_disk(held, facts, lab, chosen, gestures):
    commands.references(held, facts, lab)
    commands.records(held, facts, lab)
    for s in chosen:
        commands.events(held, facts, lab, s, strokes(gestures[s["number"]]), gestures[s["number"]])


def over_the_network(held, facts, lab, chosen, gestures):
    lab.start()
    try:
        now_ns = time.time_ns()
        ines = lab.browser("ines")
        served.results(held, facts, ines, now_ns)
        served.tables(held, facts, ines)
        served.progress(held, facts, ines)
        for s in chosen:
            served.events(held, facts, ines, s, gestures[s["number"]], strokes(gestures[s["number"]]))
        for k, s in enumerate(chosen[:: max(1, len(chosen) // 3)]):
            served.recording(held, facts, ines, s, gestures[s["number"]])
            served.replay(held, facts, lab, s, gestures[s["number"]])
            served.report(held, facts, lab, s, gestures[s["number"]], commands.ZONES[k % 2])
        for name in sorted({s["trainee"] for s in facts.sessions}):
            served.ladder(held, facts, lab, name, now_ns)
        served.live(held, lambda: Facts(lab.database()), lab, gesture_of)
        return {m["name"]: m["better"] for m in ines.json("/measures")["items"] if "_K_" not in m["name"]}
    finally:
        lab.stop()


def walk(options, held):
    with tempfile.TemporaryDirectory(prefix="needlelab-numbers-") as folder:
        lab = Lab(newest_class(options.class_folder), options.bin, folder)
        lab.admin("user", "code", "ines", "--make")  # a person with a code
        lab.settle()
        facts = Facts(lab.database())
        scored = [s for s in facts.sessions if s["score"] and s["state"] != OPEN]
        if not scored:
            raise Broken("the class has no session with a score")
        chosen = some_of(scored, options.sessions)
        with_plan = [s for s in scored if plan_of(facts, s)]
        if not any(s in chosen for s in with_plan):
            chosen += with_plan[:1]
        gestures = measured(held, facts, chosen)
        if options.all:
            commands.lists(held, facts, lab)  # before the exports, which write to the audit log
        on_disk(held, facts, lab, chosen, gestures, time.time_ns())
        if options.all:
            more_on_disk(held, facts, lab, chosen, gestures)
            better = over_the_network(held, facts, lab, chosen, gestures)
            commands.scores(held, Facts(lab.database()), lab, better)


# only for exercises with a plan
PLANNED = ("planned_entry_error_m", "planned_angle_error_rad", "mean_planned_line_error_m", "largest_planned_line_error_m")


class Kinds(Held):
    """Keeps an example of every kind, to spoil it."""

    def __init__(self):
        super().__init__()
        self.examples = {}

    def same(self, screen, number, where, expected, seen, within=0.0):
        self.examples.setdefault((screen, number), (expected, seen, within))
        super().same(screen, number, where, expected, seen, within)


def self_check(options, held):
    """Spoils each kind of checked number once; then uses a database unknown to the script's facts. Returns what was not noticed."""
    missed = [kind for kind, (expected, seen, within) in held.examples.items() if not differs(expected, spoilt(seen, within), within)]
    for screen, number in missed:
        print(f"NOT NOTICED: {screen}: {number}, spoilt by hand")
    for name in PLANNED:
        if ("stored score", name) not in held.examples:
            missed.append(("stored score", name))
            print(f"NOT HELD: stored score: {name}; no session of the class is of an exercise with a plan")
    with tempfile.TemporaryDirectory(prefix="needlelab-numbers-") as folder:
        lab = Lab(newest_class(options.class_folder), options.bin, folder)
        lab.settle()
        # the change, the screen that shows it, and the function that checks that screen
        changes = {
            "closed an hour later": ("UPDATE sessions SET closed_unix_ns = closed_unix_ns + 3600000000000 WHERE number = 1", "admin session list --json",
                                     commands.sessions),
            "the other verdict": ("UPDATE sessions SET passed = 1 - passed WHERE number = 2", "admin session list", commands.sessions),
            "an attempt more": ("UPDATE sessions SET trainee = (SELECT trainee FROM sessions WHERE number = 1) WHERE trainee <> "
                                "(SELECT trainee FROM sessions WHERE number = 1)", "admin results",
                                lambda *all: commands.results(*all, time.time_ns())),
            "another date": ("UPDATE assignments SET due_unix_ns = due_unix_ns - 60000000000 WHERE id = 1", "admin assignments", commands.lists)}
        for name, (statement, screen, holds) in changes.items():
            before = lab.database().read_bytes()
            db = sqlite3.connect(lab.database())
            if db.execute(statement).rowcount < 1:
                raise Broken(f"{statement}: changed nothing")
            db.commit()
            db.close()
            seen = Held()
            original = pathlib.Path(folder) / "original.db"
            original.write_bytes(before)
            told = Facts(original)
            holds(seen, told, lab)
            if not any(d[0].startswith(screen) for d in seen.differences):
                missed.append((screen, name))
                print(f"NOT NOTICED: {screen}: {name}, changed in the database")
            told.db.close()
            lab.settle()
            lab.database().write_bytes(before)
    print(f"{len(held.examples)} kinds of numbers spoilt, and {len(changes)} changes in the database: {len(missed)} not noticed")
    return missed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, type=pathlib.Path, help="folder of the programs")
    parser.add_argument("--class", dest="class_folder", required=True, type=pathlib.Path, help="what deploy/demo --class --once left")
    parser.add_argument("--sessions", type=int, default=6, help="how many recordings are computed (default 6)")
    parser.add_argument("--all", action="store_true", help="every screen, and then show that wrong numbers are noticed")
    options = parser.parse_args()
    try:
        held = Kinds()
        walk(options, held)
        missed = self_check(options, held) if options.all else []
    except Broken as error:
        print(f"numbers_test: {error}", file=sys.stderr)
        return 2
    for screen, number, where, expected, seen in held.differences[:100]:
        print(f"DIFFERS  {screen}: {number} ({where}): the database says {expected!r}, shown is {seen!r}")
    print(held.table())
    print(f"{sum(held.counts.values())} comparisons of {len(held.counts)} kinds of numbers: {len(held.differences)} differ")
    return 1 if held.differences or missed else 0


if __name__ == "__main__":
    sys.exit(main())
