"""What a running server sends to browsers, stations and the instructor's terminal, compared with the database."""
import csv
import html
import io
import json
import os
import re
import signal
import subprocess

import spreadsheet
from commands import VERDICT, ZONES
from facts import OPEN, STATES, local, trend


def ms(unix_ns):
    return unix_ns / 1e6


def same_ms(held, screen, number, where, unix_ns, seen):
    """Milliseconds as a JSON number: a double keeps them to 0.25 µs; 0 and missing are null."""
    if not unix_ns:
        held.same(screen, number, where, None, seen)
    else:
        held.same(screen, number, where, ms(unix_ns), seen, 3e-4)


def results(held, facts, browser, now_ns):
    screen = "GET /results"
    for course in sorted({e["curriculum_id"] for e in facts.exercises.values()}):
        reply = browser.json(f"/results?course={course}")
        held.same(screen, "people listed", course, facts.trainees_of(course), [r["trainee"] for r in reply["rows"]])
        for row in reply["rows"]:
            for cell in row["cells"]:
                name, ident = row["trainee"], cell["exercise_id"]
                where = f"{name} {ident}"
                for key, expected in (("attempts", len(facts.counted(name, ident))), ("passed", facts.passed(name, ident)),
                                      ("attempts_left", facts.left(name, ident)), ("locked_by", facts.locked_by(name, ident)),
                                      ("done", facts.done(name, ident)), ("overdue", facts.overdue(name, ident, now_ns))):
                    held.same(screen, key, where, expected, cell.get(key))
                same_ms(held, screen, "due_unix_ms", where, facts.due(name, ident), cell["due_unix_ms"])
                best = facts.best(name, ident)
                held.same(screen, "best: which attempt", where, best and best["uuid"], cell["best"] and cell["best"]["session_id"] if "best" in cell else None)
                if best:
                    held.same(screen, "best: number, late", where, [best["attempt"], facts.late(best)], [cell["best"]["number"], cell["best"]["late"]])


def tables(held, facts, browser):
    for course in sorted({e["curriculum_id"] for e in facts.exercises.values()}):
        for separator in spreadsheet.STYLES:
            content = browser.bytes(f"/courses/{course}/results.csv?separator={separator}")
            spreadsheet.by_reader(held, "GET /courses/…/results.csv", f"{course} {separator}", facts, course, facts.trainees_of(course), content, separator)


def progress(held, facts, browser):
    screen = "GET /people/…/progress"
    pairs = sorted({(s["trainee"], s["exercise_id"]) for s in facts.sessions})
    for name, exercise in pairs:
        reply = browser.json(f"/people/{name}/progress?exercise={exercise}")
        mine = sorted((s for s in facts.sessions if (s["trainee"], s["exercise_id"]) == (name, exercise)), key=lambda s: s["attempt"])
        held.same(screen, "attempts, in order of time", f"{name} {exercise}", [s["uuid"] for s in mine], [r["session_id"] for r in reply["items"]])
        for s, row in zip(mine, reply["items"]):
            same_ms(held, screen, "started_unix_ms", s["uuid"], s["started_unix_ns"], row["started_unix_ms"])
            held.same(screen, "number, passed, excused, late", s["uuid"], [s["attempt"], s["verdict"], bool(s["excused"]), facts.late(s)],
                      [row["number"], row.get("passed"), row["excused"], row["late"]])
            held.same(screen, "score", s["uuid"], s["score"], row["score"])
        counted = [(i, {m["measure"]: m["value"] for m in json.loads(facts.newest_score(s)["measures"])})
                   for i, s in enumerate(mine) if not s["excused"] and s["state"] != OPEN and facts.newest_score(s)]
        for row in reply["measures"] or []:
            points = [(i, values[row["measure"]]) for i, values in counted if values.get(row["measure"]) is not None]
            where = f"{name} {exercise} {row['measure']}"
            held.same(screen, "values over attempts, without excused", where, [list(p) for p in points], [list(p) for p in zip(row["attempts"], row["values"])])
            rising = trend([v for _, v in points])
            held.same(screen, "a trend needs four attempts", where, rising is not None, row["trend"] is not None)
            if rising:
                held.close(screen, "trend: slope (Theil-Sen)", where, rising["slope"], row["trend"]["slope_per_attempt"])
                held.close(screen, "trend: tau (Kendall)", where, rising["tau"], row["trend"]["tau"])


def recording(held, facts, browser, s, g):
    ident = s["uuid"]
    screen = "GET /sessions/…/samples"
    reply = browser.json(f"/sessions/{ident}/samples")
    held.same(screen, "rate_hz, samples, from_s", ident, [s["rate_hz"], s["samples"], 0.0], [reply["rate_hz"], reply["samples"], reply["from_s"]])
    held.close(screen, "to_s: since the first sample", ident, (g.time_ns[-1] - g.time_ns[0]) / 1e9, reply["to_s"])
    place = {round((t - g.time_ns[0]) / 1e6): i for i, t in enumerate(g.time_ns)}
    # at most 1000 spans of equal length with two points each: places and states are those of the two samples, of the
    # other columns the least and the greatest of the span are shown, in their order (server/web/README.md)
    columns, spans, whole_ns, edges = reply["columns"], {}, g.time_ns[-1] - g.time_ns[0], set()

    def span_of(i):
        return min(999, (g.time_ns[i] - g.time_ns[0]) * 1000 // whole_ns) if reply["decimated"] else i
    for i, t in enumerate(g.time_ns):
        spans.setdefault(span_of(i), []).append(i)
        if reply["decimated"] and i and (t - g.time_ns[0]) * 1000 % whole_ns == 0:
            edges |= {span_of(i) - 1, span_of(i)}  # the last digit decides which of the two a sample on the edge belongs to
    states = dict(zip("px_m py_m pz_m qx qy qz qw".split(), range(2, 9))) | {"phase": 28, "layer": 27, "fault": 29}
    extremes = dict(zip("speed_m_s fx_n fy_n fz_n".split(), range(9, 13))) | {"insertion_m": 19, "lateral_error_m": 20, "plunger": 21}
    values = {name: g.columns[c] for name, c in extremes.items()} | {"force_n": g.force}
    shown = {}
    for k, t in enumerate(columns["t_s"]):
        i = place.get(round(t * 1e3))
        held.same(screen, "t_s: each point is at a recorded sample", f"{ident} {t} s", True, i is not None)
        if i is None:
            continue
        shown.setdefault(span_of(i), []).append(k)
        for name, c in states.items():
            held.close(screen, "place, orientation, phase, layer, fault", f"{ident} {name} {t} s", float(g.columns[c][i]), columns[name][k])
    held.same(screen, "every span is shown", ident, set(), set(spans) - set(shown) - edges)
    for span, points in shown.items():
        if span in edges:
            continue
        for name, all_of in values.items():
            inside = [all_of[i] for i in spans[span]]
            seen = [columns[name][k] for k in points]
            number = f"{name}: least and greatest of a span"
            held.close(screen, number, f"{ident} span {span}", min(inside), min(seen))
            held.close(screen, number, f"{ident} span {span}", max(inside), max(seen))
    held.close(screen, "the peak is among the points", ident, max(g.force), max(columns["force_n"]))
    screen = "GET /sessions/…/samples.csv"
    rows = list(csv.DictReader(io.StringIO(browser.text(f"/sessions/{ident}/samples.csv"))))
    held.same(screen, "rows", ident, s["samples"], len(rows))
    for i in range(0, len(rows), 11):
        held.same(screen, "t_s, tick, fz_n, insertion_m", f"{ident} row {i}",
                  [(g.time_ns[i] - g.time_ns[0]) / 1e9, g.tick[i], g.columns[12][i], g.insertion[i]],
                  [float(rows[i]["t_s"]), int(rows[i]["tick"]), float(rows[i]["fz_n"]), float(rows[i]["insertion_m"])])
    screen = "GET /sessions/…/annotations"
    notes = facts.rows("SELECT * FROM annotations WHERE session = ? ORDER BY tick", s["number"])
    items = browser.items(f"/sessions/{ident}/annotations")
    held.same(screen, "remarks", ident, len(notes), len(items))
    for note, item in zip(notes, items):
        held.close(screen, "t_s: since the first sample", ident, (note["tick"] - g.tick[0]) / s["rate_hz"], item["t_s"])
        same_ms(held, screen, "created_unix_ms", ident, note["created_unix_ns"], item["created_unix_ms"])


def events(held, facts, browser, s, g, strokes):
    screen = "GET /sessions/…/events"
    items = browser.items(f"/sessions/{s['uuid']}/events")
    held.same(screen, "aspirations and injections", s["uuid"], [k for k, *_ in strokes], [e["kind"] for e in items])
    behind = g.opening_behind_tip()
    for (_, first, last, level, to), e in zip(strokes, items):
        where = f"{s['uuid']} {e['kind']}"
        held.same(screen, "begin and end, in ticks", where, [g.tick[first], g.tick[last]], [e["begin_tick"], e["end_tick"]])
        held.close(screen, "plunger_from", where, level, e["plunger_from"])
        held.close(screen, "plunger_to", where, to, e["plunger_to"])
        for name, i in (("begin", first), ("end", last)):
            p = tuple(a - behind * b for a, b in zip(g.tip[i], g.axis[i]))
            for axis, value in zip("xyz", p):
                held.close(screen, "place of the opening", where, value, e[name][f"{axis}_m"])
            held.close(screen, "depth_m of the opening", where, g.depth(p), e[name]["depth_m"])
            if e[name]["in_tissue"]:
                held.close(screen, "insertion_m of the opening", where, max(0.0, g.insertion[i] - behind), e[name]["insertion_m"])
            if g.targets:
                held.close(screen, "target_distance_m, from the edge", where, min(g.from_target(t, p) for t in g.targets), e[name]["target_distance_m"])


def ladder(held, facts, lab, name, now_ns):
    """needlelab-station --list-exercises: the numbered steps, as people and programs read them."""
    groups = facts.groups_of(name)
    mine = [a for a in facts.assignments if a["trainee"] == name or a["group_id"] in groups]
    courses = {a["course_id"] for a in mine if a["course_id"]}
    single = {a["exercise_id"] for a in mine if a["exercise_id"]}
    assigned = [e for course in sorted(courses) for e in facts.course(course)]
    assigned += [e for e in facts.exercises.values() if e["id"] in single and e["curriculum_id"] not in courses]

    def plain(ident):
        return "done" if facts.done(name, ident) else "locked" if facts.locked_by(name, ident) else "used up" if facts.left(name, ident) == 0 else "open"
    following = next((e["id"] for e in assigned if plain(e["id"]) == "open"), None)
    document = lab.folder / "ladder.json"
    for zone in ZONES:
        screen = f"station --list-exercises ({zone[:3]})"
        text = lab.station("lab-1", "--trainee", name, "--list-exercises", "--json", document, "--spool", lab.folder / "spool", zone=zone).stdout
        full = facts.people[name]["full_name"]
        held.same(screen, "the full name", name, full or name, text.splitlines()[0])
        # the ladder precedes the list of cached exercises
        steps = dict(re.findall(r"^ +(?:\d+\.|-)  (\S+) (.*)$", text.split("\nEXERCISE")[0], re.M))
        held.same(screen, "all exercises", name, sorted(facts.exercises), sorted(steps))
        for ident, line in steps.items():
            state = "next" if ident == following else plain(ident)
            said = "done" if state == "done" else "Next" if state == "next" else "no attempt left" if state == "used up" else state
            held.same(screen, "state of a step", f"{name} {ident}", True, f" {said}" in line)
            due = facts.due(name, ident)
            if due and state != "done":
                moment = local(due, zone, "%Y-%m-%d %H:%M")
                soon = due - now_ns <= 3 * 86400 * 10**9
                held.same(screen, "due: local time, over, soon or later", f"{name} {ident}",
                          f"{'overdue since' if due < now_ns else 'due soon:' if soon else 'due'} {moment}",
                          (re.findall(r"(?:overdue since|due soon:|due) [-\d]+ [\d:]+", line) or [""])[0])
            else:
                held.same(screen, "nothing due", f"{name} {ident}", False, "due" in line.split("  ")[-1] and "overdue since" in line)
            left = facts.left(name, ident)
            if left and state != "used up":
                held.same(screen, "attempts left", f"{name} {ident}", str(left), (re.findall(r"(\d+) attempts? left", line) or [""])[0])
    screen = "station --list-exercises --json"
    for row in json.loads(document.read_text())["rows"]:
        ident = row["exercise_id"]
        held.same(screen, "state, attempts_left, due_unix_ns", f"{name} {ident}",
                  ["next" if ident == following else plain(ident), facts.left(name, ident), facts.due(name, ident) or None],
                  [row["state"], row["attempts_left"], row["due_unix_ns"]])
        exercise = facts.exercises[ident]
        alone = ident in single and exercise["curriculum_id"] not in courses
        held.same(screen, "step: its place in the course, from 1", f"{name} {ident}", None if alone else exercise["position"] + 1, row["step"])


PHASES = {0: "outside", 1: "going in", 2: "at rest", 3: "coming out"}


def update(held, screen, where, g, i, u):
    held.same(screen, "phase, layer, fault", where, [PHASES[g.phase[i]], g.layer[i], g.columns[29][i]], [u["phase"], u["layer"], u["fault"]])
    held.close(screen, "force_n", where, g.force[i], u["force_n"])
    held.close(screen, "insertion_m", where, g.insertion[i], u["insertion_m"])
    held.close(screen, "plunger", where, g.plunger[i], u["plunger"])


def replay(held, facts, lab, s, g):
    arguments = ("--session", s["uuid"], "--replay", "--headless", "--speed", "0", "--rate", "10")
    place = {t - g.time_ns[0]: i for i, t in enumerate(g.time_ns)}
    screen = "instructor --replay --json"
    lines = [json.loads(line) for line in lab.instructor(*arguments, "--json").stdout.splitlines() if line.startswith("{")]
    updates = [line for line in lines if line["type"] == "update"]
    held.same(screen, "lines at 10 a second", s["uuid"], True, abs(len(updates) - 10 * g.at_s[-1]) <= 0.05 * len(updates) + 2)
    which = []
    for u in updates:
        i = place.get(round(u["time_s"] * 1e9))
        held.same(screen, "time_s: since the first sample", s["uuid"], True, i is not None)
        if i is not None:
            which.append(i)
            update(held, screen, f"{s['uuid']} {u['time_s']} s", g, i, u)
    screen = "instructor --replay"
    text = [line for line in lab.instructor(*arguments).stdout.splitlines() if "insertion" in line]
    held.same(screen, "lines", s["uuid"], len(updates), len(text))
    for i, line in zip(which, text):
        found = re.match(r" *([\d.]+) s .* (outside|going in|at rest|coming out) +(\S.*?) +insertion +([-\d.]+) mm +\|F\| +([\d.]+) N  plunger +(\d+) %", line)
        where = f"{s['uuid']} {line.strip()[:12]}"
        held.same(screen, "a line's form", where, True, found is not None)
        if not found:
            continue
        held.same(screen, "time in s, since the first sample", where, (g.time_ns[i] - g.time_ns[0]) / 1e9, float(found[1]), 0.0005001)
        held.same(screen, "layer: its name in the profile, or its tissue", where, "outside" if g.layer[i] < 0 else g.layer_names[g.layer[i]], found[3])
        held.same(screen, "insertion in mm", where, 1e3 * g.insertion[i], float(found[4]), 0.005001)
        held.same(screen, "|F| in N", where, g.force[i], float(found[5]), 0.0005001)
        held.same(screen, "plunger in %", where, 100 * g.plunger[i], float(found[6]), 0.5001)


def report(held, facts, lab, s, g, zone):
    """needlelab-instructor --report: the page's head and its table of measures."""
    file = lab.folder / "report.html"
    lab.instructor("--session", s["uuid"], "--report", file, zone=zone)
    page = re.sub(r"<svg.*?</svg>", "", file.read_text(encoding="utf-8"), flags=re.S)
    screen = "instructor --report"
    cells = [[html.unescape(re.sub(r"<[^>]*>", "", c)) for c in re.findall(r"<td[^>]*>(.*?)</td>", row, re.S)] for row in re.findall(r"<tr>(.*?)</tr>", page, re.S)]
    facts_of = {c[0]: c[1] for c in cells if len(c) == 2}
    exercise = facts.exercises[s["exercise_id"]]["json"]["name"] if s["exercise_id"] in facts.exercises else s["exercise_id"]
    held.same(screen, "begun, local time", s["uuid"], f"{facts.people.get(s['trainee'], {}).get('full_name') or s['trainee']}, {exercise}, {local(s['started_unix_ns'], zone, '%Y-%m-%d %H:%M')}",
              facts_of["when and what"])
    held.same(screen, "attempt", s["uuid"], str(s["attempt"]), facts_of["attempt"])
    count, seconds = re.match(r"(\d+) samples, ([\d.]+) s", facts_of["recording"]).groups()
    held.same(screen, "samples", s["uuid"], s["samples"], int(count))
    held.same(screen, "seconds of the recording", s["uuid"], (g.time_ns[-1] - g.time_ns[0]) / 1e9, float(seconds), 0.05001)
    held.same(screen, "verdict", s["uuid"], VERDICT[s["verdict"]], re.search(r"<p class='v'>. ([^<]*)</p>", page)[1])
    measures = json.loads(facts.newest_score(s)["measures"])
    measures = [m for m in measures if "passed" in m] + [m for m in measures if "passed" not in m]
    rows = [c for c in cells if len(c) >= 4 and c[0] in ("", "✔", "✘")]
    held.same(screen, "measures", s["uuid"], len(measures), len(rows))
    for m, row in zip(measures, rows):
        where = f"{s['uuid']} {m['measure']}"
        held.same(screen, "met or not", where, {True: "✔", False: "✘", None: ""}[m.get("passed")], row[0])
        if m["value"] is None:
            held.same(screen, "not measured: why", where, m["words"], row[2])
        else:
            held.measure(screen, "value, with its unit", where, m["measure"], m["value"], m["unit"], row[2])
        for key, words in (("min", "at least "), ("max", "at most ")):
            if m.get(key) is not None and row[3].startswith(words):
                held.measure(screen, "required", where, m["measure"], float(m[key]), m["unit"], row[3].removeprefix(words))


def live(held, facts_after, lab, gesture_of):
    """A lesson while it runs, watched by an instructor's terminal; afterwards compared with the stored data."""
    names = sorted(n for n, p in facts_after().people.items() if p["role"] == 1)
    exercise = "step-1-straight"
    environment = dict(os.environ, TZ="UTC0")
    watch = subprocess.Popen([str(a) for a in [lab.bin / "needlelab-instructor", *lab._peer(), *lab._person("ines"), "--headless", "--json", "--station",
                              "lab-1", "--rate", "0", "--seconds", "100"]], stdout=subprocess.PIPE, text=True, env=environment)
    summary = lab.folder / "summary.json"
    try:
        lab.station("lab-1", "--trainee", names[0], "--exercise", exercise, "--device", "simulated", "--headless", "--seconds", "4", "--hand-skill", "1",
                    "--spool", lab.folder / "spool", "--json", summary)
        watch.send_signal(signal.SIGINT)
        lines = [json.loads(line) for line in watch.communicate(timeout=60)[0].splitlines() if line.startswith("{")]
    finally:
        if watch.poll() is None:
            watch.kill()
    row = json.loads(summary.read_text())["rows"][0]
    facts = facts_after()
    s = facts.by_id[row["session_id"]]
    g = gesture_of(facts, s)
    screen = "station's summary, JSON"
    held.same(screen, "samples, acknowledged, chunks, state", s["uuid"], [s["samples"], s["samples"], s["chunks"], STATES[s["state"]].upper()],
              [row["samples"], row["samples_acked"], row["chunks"], row["state"]])
    held.same(screen, "ticks: samples and missed ones", s["uuid"], g.count, row["ticks"] - row["missed_ticks"])
    # those after the last sample leave no gap
    held.same(screen, "missed ticks: at least the gaps", s["uuid"], True, row["missed_ticks"] >= g.tick[-1] - g.tick[0] + 1 - g.count)
    held.same(screen, "bytes_per_sample", s["uuid"], s["stored_bytes"] / s["samples"], float(row["bytes_per_sample"]), 0.0005001)
    held.same(screen, "entries", s["uuid"], sum(1 for f in g.flags if f & 1), row["events"].get("entries into the tissue", 0))
    held.same(screen, "score", s["uuid"], s["score"], row["score"])
    screen = "instructor --station --json (live)"
    updates = [u for u in lines if u["type"] == "update" and u["session"] == s["uuid"]]
    held.same(screen, "frames come", s["uuid"], True, len(updates) > 20)
    place = {tick: i for i, tick in enumerate(g.tick)}
    for u in updates:
        i = place.get(round(u["time_s"] * s["rate_hz"]))
        held.same(screen, "time_s: since the lesson's first tick", s["uuid"], True, i is not None)
        if i is not None:
            update(held, screen, f"{s['uuid']} {u['time_s']} s", g, i, u)
    return s
