"""What the screens should show, computed only from the rows of the database: db/migrations and the pages of db/ define their meaning."""
import json
import os
import sqlite3
import time
import uuid

OPEN, COMPLETE, INTERRUPTED = 1, 2, 3
STATES = {OPEN: "open", COMPLETE: "complete", INTERRUPTED: "interrupted"}
ROLES = {1: "trainee", 2: "instructor", 3: "curriculum-manager", 4: "administrator", 6: "researcher"}

S = 1_000_000_000


def local(unix_ns, zone, form="%Y-%m-%d %H:%M:%S %Z"):
    """A moment in a zone in POSIX's form, as a clock there shows it; seconds are truncated, not rounded."""
    if not unix_ns:
        return "-"
    before = os.environ.get("TZ")
    os.environ["TZ"] = zone
    time.tzset()
    text = time.strftime(form, time.localtime(unix_ns // S))
    if before is None:
        del os.environ["TZ"]
    else:
        os.environ["TZ"] = before
    time.tzset()
    return text


def size_text(count):
    """Three digits and a decimal unit: 33.7 kB."""
    if count < 1000:
        return f"{count} B"
    value, name = float(count), ""
    for name in ("kB", "MB", "GB", "TB"):
        value /= 1000
        if value < 999.5:
            break
    return f"{value:.3g} {name}"


class Facts:
    def __init__(self, path):
        self.db = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        self.db.row_factory = sqlite3.Row
        self.names = {"@%d" % p: n for p, n in self.db.execute("SELECT person, name FROM names")}
        self.sessions = self.rows("SELECT * FROM sessions ORDER BY number")
        for s in self.sessions:
            s["uuid"] = str(uuid.UUID(bytes=s["id"]))
            s["score"] = json.loads(s["score_json"]) if s["score_json"] else None
            s["verdict"] = None if s["passed"] is None else bool(s["passed"])
        self.by_id = {s["uuid"]: s for s in self.sessions}
        self.newest_first = sorted(self.sessions, key=lambda s: (s["started_unix_ns"], s["number"]), reverse=True)
        for s in self.sessions:
            mates = [t for t in self.sessions if (t["trainee"], t["exercise_id"]) == (s["trainee"], s["exercise_id"])]
            mates.sort(key=lambda t: (t["started_unix_ns"], t["number"]))
            s["attempt"] = mates.index(s) + 1
        self.exercises = {e["id"]: e for e in self.rows("SELECT * FROM exercises ORDER BY curriculum_id, position")}
        for e in self.exercises.values():
            e["json"] = json.loads(e["json"])
        self.people = {p["name"]: p for p in self.rows("SELECT * FROM accounts")}
        self.assignments = self.rows("SELECT * FROM assignments ORDER BY id DESC")
        self.members = {}
        for row in self.rows("SELECT group_id, person FROM group_members"):
            self.members.setdefault(row["group_id"], []).append(row["person"])
        for people in self.members.values():
            people.sort()
        self.audit = self.rows("SELECT * FROM audit ORDER BY id DESC")

    def rows(self, sql, *values):
        """Rows with names instead of people's refs."""
        return [{k: self.names.get(v, v) if isinstance(v, str) else v for k, v in dict(row).items()} for row in self.db.execute(sql, values)]

    def one(self, sql, *values):
        return self.db.execute(sql, values).fetchone()[0]

    def chunks(self, session):
        return [row["bytes"] for row in self.rows("SELECT bytes FROM chunks WHERE session = ? ORDER BY seq", session["number"])]

    def groups_of(self, name):
        return [g for g, people in sorted(self.members.items()) if name in people]

    def course(self, course):
        return sorted((e for e in self.exercises.values() if e["curriculum_id"] == course), key=lambda e: e["position"])

    # --- who has done what

    def counted(self, trainee, exercise):
        return [s for s in self.sessions if (s["trainee"], s["exercise_id"]) == (trainee, exercise) and not s["excused"]]

    def passed(self, trainee, exercise):
        """Whether any attempt that counts was passed; None: none has a verdict."""
        verdicts = [s["verdict"] for s in self.counted(trainee, exercise) if s["verdict"] is not None]
        return any(verdicts) if verdicts else None

    def done(self, trainee, exercise):
        """Passed; or, if nothing is required, tried."""
        text = self.exercises[exercise]["json"]
        if not text.get("requirements") and "time_limit_s" not in text:
            return bool(self.counted(trainee, exercise))
        return bool(self.passed(trainee, exercise))

    def locked_by(self, trainee, exercise):
        return [p for p in self.exercises[exercise]["json"].get("prerequisites", []) if not self.done(trainee, p)]

    def left(self, trainee, exercise):
        most = self.exercises[exercise]["json"].get("attempts")
        return None if most is None else max(0, most - len(self.counted(trainee, exercise)))

    def due(self, trainee, exercise):
        """db/teaching/assignments.h: a person's date before a group's, an exercise's before its course's, the latest of several; otherwise the
        course's own."""
        course = self.exercises[exercise]["curriculum_id"]
        dates = {}
        for a in self.assignments:
            of_group = a["group_id"] is not None
            if a["due_unix_ns"] is None or not (a["exercise_id"] == exercise or a["course_id"] == course):
                continue
            if trainee != a["trainee"] and trainee not in self.members.get(a["group_id"], []):
                continue
            dates.setdefault((of_group, a["exercise_id"] is None), []).append(a["due_unix_ns"])
        if dates:
            return max(dates[min(dates)])
        return self.exercises[exercise]["json"].get("due_unix_ms", 0) * 1_000_000

    def overdue(self, trainee, exercise, now_ns):
        due = self.due(trainee, exercise)
        return bool(due) and due < now_ns and not self.done(trainee, exercise)

    def trainees_of(self, course):
        """Everyone assigned the course or an exercise of it, or who tried one."""
        ids = {e["id"] for e in self.course(course)}
        names = {s["trainee"] for s in self.sessions if s["exercise_id"] in ids and s["trainee"] and not s["erased"]}
        for a in self.assignments:
            if a["course_id"] == course or a["exercise_id"] in ids:
                names |= {a["trainee"]} if a["trainee"] else set(self.members.get(a["group_id"], []))
        return sorted(names)

    def best(self, trainee, exercise):
        """Passed before not passed, then most requirements met, then newest."""
        tried = [s for s in self.counted(trainee, exercise) if s["state"] != OPEN]
        met = lambda s: sum(1 for row in s["score"] or [] if row.get("passed"))
        return max(tried, key=lambda s: (bool(s["verdict"]), met(s), s["attempt"]), default=None)

    def late(self, session):
        if session["exercise_id"] not in self.exercises:
            return False
        due = self.due(session["trainee"], session["exercise_id"])
        return bool(due) and session["started_unix_ns"] > due

    def reference(self, exercise):
        rows = self.rows("SELECT * FROM exercise_references WHERE exercise_id = ? ORDER BY revision DESC LIMIT 1", exercise)
        return json.loads(rows[0]["sessions"]) if rows else []

    def newest_score(self, session):
        rows = self.rows("SELECT * FROM scores WHERE session = ? ORDER BY definition_version DESC LIMIT 1", session["number"])
        return rows[0] if rows else None

    def bands(self, exercise):
        """measure -> (n, mean, sd, p10, median, p90) of the reference sessions' newest scores."""
        values = {}
        for ident in self.reference(exercise):
            for row in json.loads(self.newest_score(self.by_id[ident])["measures"]):
                if row["value"] is not None:
                    values.setdefault(row["measure"], []).append(row["value"])
        bands = {}
        for name, all_of in values.items():
            all_of.sort()
            n = len(all_of)
            mean = sum(all_of) / n
            sd = (sum((v - mean)**2 for v in all_of) / (n - 1))**0.5 if n > 1 else None

            def share(p):
                place = p * (n - 1)
                low = int(place)
                return all_of[low] + (place - low) * (all_of[min(low + 1, n - 1)] - all_of[low])
            few = n < 5
            bands[name] = {"n": n, "mean": mean, "sd": sd, "least": all_of[0], "greatest": all_of[-1], "median": share(0.5),
                           **{f"p{p}": None if few else share(p / 100) for p in (10, 25, 75, 90)}}
        return bands


def trend(values):
    """Theil-Sen slope and Kendall's tau of values over attempts, from 4 attempts on."""
    if len(values) < 4:
        return None
    slopes = sorted((values[j] - values[i]) / (j - i) for i in range(len(values)) for j in range(i + 1, len(values)))
    half = len(slopes) // 2
    signs = sum((s > 0) - (s < 0) for s in slopes)
    return {"slope": slopes[half] if len(slopes) % 2 else (slopes[half - 1] + slopes[half]) / 2, "tau": signs / len(slopes)}
