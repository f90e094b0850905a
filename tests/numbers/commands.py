"""needlelab-admin on a stopped server's folder: its tables, JSON and files compared with the database."""
import csv
import datetime
import json
import math

import spreadsheet
from facts import ROLES, STATES, local, size_text
from gesture import measures_of
from held import YES_OR_NO, last_quantity
from lab import pairs, run, table

# Asia/Kolkata and America/St_Johns: half hours, and daylight saving (POSIX's form needs no tz data on the machine)
ZONES = ("IST-5:30", "NST3:30NDT,M3.2.0,M11.1.0")
VERDICT = {True: "passed", False: "not passed", None: "-"}


def cell_text(facts, trainee, exercise, now_ns):
    passed, tried = facts.passed(trainee, exercise), len(facts.counted(trainee, exercise))
    text = VERDICT[passed] if passed is not None else "tried" if tried else "locked" if facts.locked_by(trainee, exercise) else "-"
    text += f", {tried} attempt{'s' if tried > 1 else ''}" if tried else ""
    left = facts.left(trainee, exercise)
    text += f", {left} left" if left is not None and not passed else ""
    return text + (", overdue" if facts.overdue(trainee, exercise, now_ns) else "")


def results(held, facts, lab, now_ns):
    for course in sorted({e["curriculum_id"] for e in facts.exercises.values()}):
        names = facts.trainees_of(course)
        if not names:
            continue
        ids = [e["id"] for e in facts.course(course)]
        for screen, rows in (("admin results", table(lab.admin("results", course, zone=ZONES[0]).stdout)),
                             ("admin results --json", lab.admin_rows("results", course))):
            who = "TRAINEE" if "json" not in screen else "trainee"
            held.same(screen, "people listed", course, names, [row[who] for row in rows])
            for row in rows:
                for ident in ids:
                    held.same(screen, "verdict, attempts, left, overdue", f"{row[who]} {ident}",
                              cell_text(facts, row[who], ident, now_ns), row[ident])
        for group, members in facts.members.items():
            rows = lab.admin_rows("results", course, "--group", group)
            held.same("admin results --group", "people listed", group, members, [row["trainee"] for row in rows])
        tables(held, facts, lab, course, names)


def tables(held, facts, lab, course, names):
    """The same for a spreadsheet, in each reader's form."""
    file = lab.folder / "results.csv"
    for separator in spreadsheet.STYLES:
        said = lab.admin("results", course, "--out", file, "--replace", "--separator", separator, zone=ZONES[1]).stdout
        held.same("admin results --out", "rows and people, as it says", course, [len(names) * len(facts.course(course)), len(names)],
                  [int(word) for word in said.split(" in ")[0].split() if word.isdigit()])
        spreadsheet.by_reader(held, "admin results --out", f"{course} {separator}", facts, course, names, file.read_bytes(), separator)
    for group, members in facts.members.items():
        lab.admin("results", course, "--group", group, "--out", file, "--replace")
        spreadsheet.by_reader(held, "admin results --out", f"{course} {group}", facts, course, members, file.read_bytes(), "comma")


def sessions(held, facts, lab):
    screen = "admin session list"
    for zone in ZONES:
        rows = table(lab.admin("session", "list", "--limit", "0", zone=zone).stdout)
        held.same(screen, "order: newest first", zone, [s["uuid"] for s in facts.newest_first], [r["SESSION"] for r in rows])
        for row in rows:
            s = facts.by_id[row["SESSION"]]
            held.same(screen, f"STARTED, local time ({zone[:3]})", row["SESSION"], local(s["started_unix_ns"], zone), row["STARTED"])
            for title, expected in (("STATION", s["station"]), ("TRAINEE", s["trainee"]), ("EXERCISE", s["exercise_id"]),
                                    ("STATE", STATES[s["state"]]), ("VERDICT", VERDICT[s["verdict"]]), ("SAMPLES", str(s["samples"])),
                                    ("SIZE", size_text(s["stored_bytes"]))):
                held.same(screen, title, row["SESSION"], expected, row[title])
    screen = "admin session list --json"
    for row in lab.admin_rows("session", "list", "--limit", "0"):
        s = facts.by_id[row["session_id"]]
        chunks = facts.rows("SELECT samples, length(bytes) AS size FROM chunks WHERE session = ?", s["number"])
        for name, expected in (("started_unix_ns", s["started_unix_ns"]), ("received_unix_ns", s["received_unix_ns"]),
                               ("closed_unix_ns", s["closed_unix_ns"]), ("rate_hz", s["rate_hz"]), ("hash", s["hash"].hex()),
                               ("samples", sum(c["samples"] for c in chunks)), ("chunks", len(chunks)),
                               ("stored_bytes", sum(c["size"] for c in chunks)),
                               ("verdict", {True: "passed", False: "failed", None: None}[s["verdict"]])):
            held.same(screen, name, s["uuid"], expected, row[name])
        score = {m["measure"]: m["value"] for m in s["score"]}
        for name, value in row["figures"].items():
            held.same(screen, "figures", f"{s['uuid']} {name}", score[name], value)
    # filters: by the list's columns
    count = lambda keep: sum(1 for s in facts.sessions if keep(s))
    some = facts.sessions[len(facts.sessions) // 2]
    from_ns = some["started_unix_ns"] // 60_000_000_000 * 60_000_000_000
    moment = local(from_ns, "UTC0", "%Y-%m-%dT%H:%MZ")
    for arguments, keep in ((["--trainee", some["trainee"]], lambda s: s["trainee"] == some["trainee"]),
                            (["--exercise", some["exercise_id"]], lambda s: s["exercise_id"] == some["exercise_id"]),
                            (["--station", some["station"]], lambda s: s["station"] == some["station"]),
                            (["--verdict", "passed"], lambda s: s["verdict"] is True),
                            (["--verdict", "not-passed"], lambda s: s["verdict"] is False),
                            (["--from", moment], lambda s: s["started_unix_ns"] >= from_ns),
                            (["--to", moment], lambda s: s["started_unix_ns"] < from_ns)):
        held.same(screen, "rows with a filter", " ".join(arguments), count(keep),
                  len(lab.admin_rows("session", "list", "--limit", "0", *arguments)))


def measure_table(held, screen, where, score, rows):
    held.same(screen, "measures, in order", where, [m["measure"] for m in score], [r["MEASURE"] for r in rows])
    for m, row in zip(score, rows):
        if m["value"] is None:
            held.same(screen, "VALUE", f"{where} {m['measure']}", "-", row["VALUE"])
        else:
            held.measure(screen, "VALUE", where, m["measure"], float(m["value"]), m["unit"], row["VALUE"])
        held.same(screen, "VERDICT of a measure", f"{where} {m['measure']}", VERDICT[m.get("passed")], row["VERDICT"])
        words(held, screen, f"{where} {m['measure']}", m, row[""])


def words(held, screen, where, m, text):
    """"Peak force 3.03 N: within the 6 N allowed": the value, the limit, and that they belong together."""
    if m["value"] is None or m["measure"] in YES_OR_NO:
        return
    head, _, verdict = text.partition(": ")
    if m["measure"] == "hazards_touched":
        head = f"Hazards touched {head.rsplit(' ', 1)[1]}"
    held.measure(screen, "the value in words", where, m["measure"], m["value"], m["unit"], last_quantity(head))
    for key, mark in (("max", "above the "), ("min", "below the "), ("max", "within the "), ("min", "at least the ")):
        if mark in verdict and not (m.get("min") is not None and m.get("max") is not None):
            limit = verdict.partition(mark)[2].removesuffix(" allowed").removesuffix(" asked for")
            held.measure(screen, "the limit in words", where, m["measure"], float(m[key]), m["unit"], limit)
            met = m["value"] <= m[key] if key == "max" else m["value"] >= m[key]
            held.same(screen, "within, above or below", where, met, mark in ("within the ", "at least the "))


def session(held, facts, lab, s):
    """`session show`, `score`, `events`, `verify` for one session with a score."""
    zone, ident = ZONES[s["number"] % 2], s["uuid"]
    screen = "admin session show"
    text = lab.admin("session", "show", ident, zone=zone).stdout
    head = pairs(text)
    for name, expected in (("state", STATES[s["state"]]), ("trainee", s["trainee"]), ("profile revision", str(s["profile_revision"])),
                           ("rate Hz", f"{s['rate_hz']:.6g}"), ("started", local(s["started_unix_ns"], zone)),
                           ("closed", local(s["closed_unix_ns"], zone)), ("samples", str(s["samples"])), ("chunks", str(s["chunks"])),
                           ("size", size_text(s["stored_bytes"])), ("hash", s["hash"].hex())):
        held.same(screen, name, ident, expected, head[name])
    measure_table(held, screen, ident, s["score"], table(text[text.index("\nMEASURE") + 1:]))
    remarks = facts.rows("SELECT * FROM annotations WHERE session = ? ORDER BY tick", s["number"])
    if remarks:
        rows = table(text[text.index("\nTICK") + 1:])
        held.same(screen, "TICK of a remark", ident, [str(r["tick"]) for r in remarks], [r["TICK"] for r in rows])
    screen = "admin session score"
    text = lab.admin("session", "score", ident, zone=zone).stdout
    head, newest = pairs(text), facts.newest_score(s)
    held.same(screen, "definitions", ident, str(newest["definition_version"]), head["definitions"])
    held.same(screen, "made", ident, local(newest["made_unix_ns"], zone), head["made"])
    held.same(screen, "verdict", ident, VERDICT[None if newest["passed"] is None else bool(newest["passed"])], head["verdict"])
    measure_table(held, screen, ident, json.loads(newest["measures"]), table(text[text.index("\nMEASURE") + 1:]))
    compare(held, facts, lab, s, newest)
    row = lab.admin_rows("session", "verify", ident)[0]
    held.same("admin session verify", "chunks, samples, hash", ident, [True, s["chunks"], s["samples"], s["hash"].hex()],
              [row["ok"], row["chunks"], row["samples"], row["hash"]])


def compare(held, facts, lab, s, newest):
    """Compared with the experts: n, least and greatest come from the reference's sessions, and the place is the value's among them."""
    screen = "admin session score --json"
    row = lab.admin_rows("session", "score", s["uuid"])[0]
    values = {m["measure"]: m for m in json.loads(newest["measures"])}
    bands = facts.bands(s["exercise_id"])
    for c in row["comparison"]:
        where = f"{s['uuid']} {c['measure']}"
        if c["measure"] == "dtw_distance_m":  # its band compares the references with each other: README of common/scoring
            continue
        band = bands[c["measure"]]
        held.same(screen, "value beside the experts", where, values[c["measure"]]["value"], c["value"])
        held.same(screen, "n of the experts", where, band["n"], c["n"])
        held.close(screen, "least of the experts", where, band["least"], c["least"])
        held.close(screen, "greatest of the experts", where, band["greatest"], c["greatest"])
        if c["n"] < 5 or c["measure"] in YES_OR_NO or band["least"] == band["greatest"]:
            held.same(screen, "of few, of those who do not vary, of yes and no: nothing", where, [None, ""], [c["place"], c["words"]])
        if c["place"] is None:
            continue
        side = "below" if c["value"] < band["least"] else "above" if c["value"] > band["greatest"] else "within"
        held.same(screen, "the place", where, side, c["place"])
        head, _, said = c["words"].partition(": ")
        held.same(screen, "the place in words", where, True, f"{side} the experts' range, " in said)
        held.measure(screen, "the value in words", where, c["measure"], c["value"], c["unit"], last_quantity(head))
        least, greatest = said.partition("range, ")[2].rpartition(" (")[0].split(" to ")
        held.measure(screen, "the range in words", where, c["measure"], band["least"], c["unit"], least)
        held.measure(screen, "the range in words", where, c["measure"], band["greatest"], c["unit"], greatest)
    for ident in facts.reference(s["exercise_id"]):
        held.same(screen, "a reference session was passed", ident, True, facts.by_id[ident]["verdict"])
        measures = {m["measure"]: m["value"] for m in json.loads(facts.newest_score(facts.by_id[ident])["measures"])}
        held.same(screen, "no hazard and no bone was touched in a reference", ident, [0, 0], [measures["hazards_touched"], measures["bone_contacts"]])


def spreadsheet_csv(held, lab, s, g):
    """The CSV without --every-tick: of each 4 ms since the first sample the one with the greatest force, rounded."""
    screen, ident = "admin session export, CSV for a spreadsheet", s["uuid"]
    file = lab.folder / f"{ident}-spreadsheet.csv"
    lab.admin("session", "export", ident, "--out", file)
    with open(file, newline="") as lines:
        rows = list(csv.DictReader(lines))
    force = [sum(g.columns[c][i] ** 2 for c in (10, 11, 12)) for i in range(g.count)]
    best = {}
    for i in range(g.count):
        part = (g.time_ns[i] - g.time_ns[0]) // 4_000_000
        if part not in best or force[i] > force[best[part]]:
            best[part] = i
    kept = [best[part] for part in sorted(best)]
    held.same(screen, "ticks", ident, [g.tick[i] for i in kept], [int(row["tick"]) for row in rows])
    for i, row in list(zip(kept, rows))[::5]:
        for name, column, digits in (("px_m", 2, 6), ("fz_n", 12, 3)):
            where = f"{ident} tick {g.tick[i]}"
            held.same(screen, name, where, True, abs(float(row[name]) - g.columns[column][i]) <= 0.5000001 * 10 ** -digits)
            held.same(screen, f"decimals of {name}", where, True, len(row[name].partition(".")[2]) <= digits)
    held.same(screen, "two minutes take at most 10 MB", ident, True, file.stat().st_size / s["samples"] * 120_000 <= 10e6)


def exports(held, facts, lab, s, gesture):
    """`session export` of one session in three formats."""
    ident, g = s["uuid"], gesture
    names = ("t_s,tick,time_ns,px_m,py_m,pz_m,qx,qy,qz,qw,speed_m_s,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,wx_m,wy_m,wz_m,phase,layer,"
             "insertion_m,lateral_error_m,plunger,buttons,device_ns,engine_ns,flags,fault").split(",")
    place = dict(zip("px_m py_m pz_m qx qy qz qw speed_m_s fx_n fy_n fz_n tx_nm ty_nm tz_nm wx_m wy_m wz_m insertion_m "
                     "lateral_error_m plunger device_ns engine_ns".split(), range(2, 24)))
    place |= {"tick": 0, "time_ns": 1, "buttons": 26, "layer": 27, "phase": 28, "fault": 29}

    def expected(name, i):
        if name == "t_s":
            return (g.time_ns[i] - g.time_ns[0]) / 1e9
        if name == "flags":
            return g.flags[i]
        return g.columns[place[name]][i]

    file = lab.folder / f"{ident}.csv"
    lab.admin("session", "export", ident, "--every-tick", "--out", file)
    with open(file, newline="") as lines:
        rows = list(csv.reader(lines))
    held.same("admin session export, CSV", "columns", ident, names, rows[0])
    held.same("admin session export, CSV", "rows", ident, s["samples"], len(rows) - 1)
    for c, name in enumerate(names):
        whole = name in ("tick", "time_ns", "phase", "layer", "buttons", "device_ns", "engine_ns", "flags", "fault")
        for i in range(0, len(rows) - 1, 7):
            value, text = expected(name, i), rows[i + 1][c]
            seen = int(text) if whole else float(text)
            held.same("admin session export, CSV", name, f"{ident} row {i}", math.nan if value is None else value, seen)
    spreadsheet_csv(held, lab, s, g)
    file = lab.folder / f"{ident}.json"
    lab.admin("session", "export", ident, "--format", "json", "--out", file, "--from", "1", "--to", "1.5")
    rows = json.loads(file.read_text())["rows"]
    within = [i for i in range(g.count) if 1_000_000_000 <= g.time_ns[i] - g.time_ns[0] < 1_500_000_000]
    held.same("admin session export, JSON", "samples from 1 s to 1.5 s", ident, [g.tick[i] for i in within], [r["tick"] for r in rows])
    for i, row in zip(within[::5], rows[::5]):
        held.same("admin session export, JSON", "t_s, since the first sample", ident, (g.time_ns[i] - g.time_ns[0]) / 1e9, row["t_s"])
        held.same("admin session export, JSON", "fz_n", ident, g.columns[12][i], row["fz_n"])
    file = lab.folder / f"{ident}.rec"
    lab.admin("session", "export", ident, "--format", "recording", "--out", file)
    data = file.read_bytes()
    held.same("admin session export, recording", "holds every chunk, byte for byte", ident, True, all(c in data for c in facts.chunks(s)))
    # the same recording scored away from the server, and the result computed from the samples
    profile = lab.folder / "profile.json"
    profile.write_text(s["profile_json"])
    report = lab.folder / "score.json"
    run([lab.bin / "needlelab-sim", "score", "--profile", profile, "--recorded", file, f"--json={report}"], "UTC0")
    own, text = measures_of(g), json.loads(report.read_text())
    seen = {m["measure"]: m["value"] for m in text["rows"]}
    for name, value in own.items():
        held.close("needlelab-sim score --recorded", "every measure", f"{ident} {name}", float(value), seen.get(name), 1e-8)


def events(held, facts, lab, s, strokes, gesture):
    rows = lab.admin_rows("session", "events", s["uuid"])
    screen = "admin session events"
    held.same(screen, "aspirations and injections", s["uuid"], [k for k, *_ in strokes], [r["event"] for r in rows])
    for (kind, first, last, level, to), row in zip(strokes, rows):
        where = f"{s['uuid']} {kind}"
        held.close(screen, "begin_s", where, gesture.at_s[first], row["begin_s"])
        held.close(screen, "end_s", where, gesture.at_s[last], row["end_s"])


def progress(held, facts, lab, now_ns):
    for zone, name in zip(ZONES * 50, sorted({s["trainee"] for s in facts.sessions})):
        screen = "admin progress"
        mine = sorted((s for s in facts.sessions if s["trainee"] == name), key=lambda s: (s["started_unix_ns"], s["number"]))
        rows = table(lab.admin("progress", name, zone=zone).stdout)
        held.same(screen, "attempts, in order of time", name, [s["uuid"] for s in mine], [r["SESSION"] for r in rows])
        for s, row in zip(mine, rows):
            held.same(screen, "ATTEMPT: number among the exercise's", s["uuid"], str(s["attempt"]), row["ATTEMPT"])
            held.same(screen, "BEGUN, local time", s["uuid"], local(s["started_unix_ns"], zone), row["BEGUN"])
            held.same(screen, "VERDICT", s["uuid"], VERDICT[s["verdict"]], row["VERDICT"])
            held.same(screen, "EXCUSED", s["uuid"], "yes" if s["excused"] else "no", row["EXCUSED"])
            held.same(screen, "LATE: begun after the due date", s["uuid"], "yes" if facts.late(s) else "no", row["LATE"])


def iso_ms(unix_ns):
    """A moment in ISO 8601 UTC, rounded down to milliseconds."""
    moment = datetime.datetime.fromtimestamp(unix_ns // 1_000_000_000, datetime.timezone.utc)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{unix_ns % 1_000_000_000 // 1_000_000:03}Z"


def scores(held, facts, lab, better):
    file = lab.folder / "scores.csv"
    said = lab.admin("scores", "export", "--out", file).stdout
    scored = [s for s in facts.sessions if facts.newest_score(s)]
    held.same("admin scores export", "scores, as it says", "", len(scored), int(said.split()[0]))
    with open(file, newline="", encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    held.same("admin scores export", "rows: one a measure", "", sum(len(json.loads(facts.newest_score(s)["measures"])) for s in scored), len(rows))
    screen, measures = "admin scores export", {}
    for row in rows:
        if row["measure"] in better:
            held.same(screen, "better", row["measure"], better[row["measure"]], row["better"])
        s = facts.by_id[row["session"]]
        score = facts.newest_score(s)
        if s["number"] not in measures:
            measures[s["number"]] = {m["measure"]: m for m in json.loads(score["measures"])}
        m = measures[s["number"]][row["measure"]]
        where = f"{s['uuid']} {row['measure']}"
        for name, expected in (("trainee", s["trainee"]), ("exercise", s["exercise_id"]), ("attempt", str(s["attempt"])),
                               ("started", iso_ms(s["started_unix_ns"])), ("definition_version", str(score["definition_version"])),
                               ("unit", m["unit"])):
            held.same(screen, name, where, expected, row[name])
        for name in ("value", "min", "max"):
            expected = m.get(name)
            held.same(screen, name, where, None if expected is None else float(expected), float(row[name]) if row[name] else None)
        held.same(screen, "met or not", where, {True: "1", False: "0", None: ""}[m.get("passed")], row["passed"])
        if m.get("value") is not None and m.get("passed") is not None:
            right = (m.get("min") is None or m["value"] >= m["min"]) and (m.get("max") is None or m["value"] <= m["max"])
            held.same(screen, "met: value against min and max", where, right, row["passed"] == "1")


def references(held, facts, lab):
    screen = "admin reference show"
    for exercise in facts.exercises:
        if not facts.reference(exercise):
            continue
        rows = {r["MEASURE"]: r for r in table(lab.admin("reference", "show", exercise).stdout)}
        for measure, band in facts.bands(exercise).items():
            if measure == "dtw_distance_m":
                continue
            row, where = rows[measure], f"{exercise} {measure}"
            held.same(screen, "N", where, str(band["n"]), row["N"])
            for title, key in (("MEAN", "mean"), ("SD", "sd"), ("P10", "p10"), ("MEDIAN", "median"), ("P90", "p90")):
                if band[key] is None:
                    held.same(screen, title, where, "-", row[title])
                else:
                    # a spread of pure rounding errors has no digits
                    most = max(abs(band["least"]), abs(band["greatest"]))
                    held.same(screen, title, where, float(band[key]), float(row[title]), 0.51e-5 * abs(band[key]) + 1e-15 * most)


def lists(held, facts, lab):
    zone = ZONES[1]
    rows = table(lab.admin("audit", "--limit", "0", zone=zone).stdout)
    held.same("admin audit", "lines", "", len(facts.audit), len(rows))
    for line, row in zip(facts.audit, rows):
        held.same("admin audit", "ID, WHEN in local time, WHO, ACTION", line["id"],
                  [str(line["id"]), local(line["unix_ns"], zone), line["who"], line["action"]],
                  [row["ID"], row["WHEN"], row["WHO"], row["ACTION"]])
    held.same("admin audit --limit", "lines", "5", 5, len(lab.admin_rows("audit", "--limit", "5")))
    rows = table(lab.admin("assignments", zone=zone).stdout)
    held.same("admin assignments", "lines", "", len(facts.assignments), len(rows))
    for a, row in zip(facts.assignments, rows):
        held.same("admin assignments", "NUMBER, DUE and SINCE in local time", a["id"],
                  [str(a["id"]), local(a["due_unix_ns"], zone), local(a["created_unix_ns"], zone)], [row["NUMBER"], row["DUE"], row["SINCE"]])
    rows = table(lab.admin("user", "list", zone=zone).stdout)
    held.same("admin user list", "names", "", sorted(facts.people), [r["NAME"] for r in rows])
    for row in rows:
        p = facts.people[row["NAME"]]
        said = facts.rows("SELECT given FROM consents WHERE person = ? ORDER BY id DESC LIMIT 1", p["name"])
        held.same("admin user list", "role, groups, consent, code, SINCE in local time", p["name"],
                  [ROLES[p["role"]], ", ".join(facts.groups_of(p["name"])) or "-", ("yes" if said[0]["given"] else "no") if said else "-",
                   "yes" if p["code_hash"] else "no", local(p["created_unix_ns"], zone)],
                  [row["ROLE"], row["GROUPS"], row["CONSENTS"], row["CODE"], row["SINCE"]])
        rows_of = lab.admin_rows("consent", "list", p["name"]) if said else []
        held.same("admin consent list", "statements and their times", p["name"],
                  [c["unix_ns"] for c in facts.rows("SELECT unix_ns FROM consents WHERE person = ? ORDER BY id", p["name"])],
                  sorted(r["unix_ns"] for r in rows_of))


def records(held, facts, lab):
    """export-all, person export, study export: the number of rows of each kind, and the numbers in them."""
    rows = [json.loads(line) for line in lab.admin("export-all").stdout.splitlines()]
    tables = {}
    for row in rows:
        tables.setdefault(row.get("kind") or row.get("table"), []).append(row)
    held.same("admin export-all", "sessions", "", len([s for s in facts.sessions if s["state"] != 1]),
              len(tables.get("session", tables.get("sessions", []))))
    consenting = {p for p in facts.people
                  if [c for c in facts.rows("SELECT given FROM consents WHERE person = ? ORDER BY id DESC LIMIT 1", p) if c["given"]]}
    wanted = [s for s in facts.sessions if s["trainee"] in consenting and s["state"] != 1]
    rows = [json.loads(line) for line in lab.admin("study", "export", "numbers").stdout.splitlines()]
    screen, head = "admin study export", rows[0]
    held.same(screen, "people and sessions, as it says", "", [len({s["trainee"] for s in wanted} & consenting), len(wanted)],
              [head["people"], head["sessions"]])
    sessions = [r for r in rows if r["kind"] == "session"]

    def key(s, first):
        return (s["exercise_id"], s["attempt"], bool(s["excused"]), (s["started_unix_ns"] - first[s["trainee"]]) // 86_400_000_000_000,
                s["samples"], s["chunks"], str(s["verdict"]))
    first = {}
    for s in wanted:
        first[s["trainee"]] = min(first.get(s["trainee"], s["started_unix_ns"]), s["started_unix_ns"])
    held.same(screen, "exercise, attempt, excused, days, samples, verdict", "", sorted(key(s, first) for s in wanted),
              sorted((r["exercise_id"], r["attempt"], r["excused"], r["begun_after_first_days"], r["samples"], r["chunks"], str(r["passed"]))
                     for r in sessions))
    values = lambda measures: json.dumps([(m["measure"], m["value"], m["unit"]) for m in measures])
    held.same(screen, "values of every measure", "", sorted(values(json.loads(r["measures"])) for s in wanted for r in
              facts.rows("SELECT measures FROM scores WHERE session = ?", s["number"])), sorted(values(r["measures"]) for r in rows if r["kind"] == "score"))
    names = [n for n in facts.people if facts.people[n]["role"] == 1] + [s["station"] for s in wanted]
    held.same(screen, "no name, no station", "", [], sorted({n for n in names if f'"{n}"' in json.dumps(sessions)}))
    held.same(screen, "no time of day", "", [], [r["session"] for r in sessions if any("unix" in name for name in r)])
