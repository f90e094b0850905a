"""Exported tables: a course's results from the console and needlelab-admin, as read by Python's CSV reader."""
import csv
import http.client
import io
import json
import re
import ssl

from lab import SAMPLES, says, until
from lists import log_in

COURSE, EXERCISE = "rheumatology-basics", "shoulder-bursa"
EXERCISES = len(json.loads((SAMPLES / "curriculum.json").read_text(encoding="utf-8"))["exercises"])
# separator, decimal sign
STYLES = {"comma": (",", "."), "semicolon": (";", ","), "tab": ("\t", ".")}
# what a spreadsheet could mistake for the end of a cell, for a formula, or for Windows-1252
NAMES = {"zoe": '=1+1; "Zoë", ß', "yan": "Łukasz Дмитрий"}


def rows(lab):
    made = []

    def lesson():
        """Two people in two groups, and a lesson by one of them."""
        if made:
            return
        listed = io.StringIO()
        csv.writer(listed).writerows([("name", "full_name", "group"), *((name, full, "autumn;spring") for name, full in NAMES.items())])
        for said in (lab.admin("user", "import", lab.programs.file("people.csv", listed.getvalue())), lab.admin("assign", "--group", "autumn", "--course", COURSE),
                     lab.station("--trainee", "zoe", "--exercise", EXERCISE, "--seconds", "3")):
            if said.code != 0:
                raise SystemExit(f"tables: {said.all[-300:]}")

        def attempt():
            return json.loads(lab.admin("progress", "zoe", "--exercise", EXERCISE, "--json").out)["rows"][0]

        until(lambda: attempt()["verdict"] != "-", "the lesson has its score")
        made.append(attempt())

    def by_console(query):
        cookie, _ = log_in(lab)
        connection = http.client.HTTPSConnection("localhost", lab.web, context=ssl.create_default_context(cafile=str(lab.ca)))
        connection.request("GET", f"/api/v1/courses/{COURSE}/results.csv?group=autumn&{query}", headers={"Cookie": cookie})
        return connection.getresponse().read()

    def by_command(*words):
        file = lab.programs.folder / "results.csv"
        said = lab.admin("results", COURSE, "--group", "autumn", "--out", file, "--replace", *words)
        return says(said, 0, f"{len(NAMES) * EXERCISES} rows of {len(NAMES)} people"), file.read_bytes() if said.code == 0 else b""

    def wrong(content, style):
        separator, sign = STYLES[style]
        if not content.startswith(b"\xef\xbb\xbf") or content.count(b"\r\n") != content.count(b"\n"):
            return "no byte order mark, or another line end than CRLF"
        head, *table = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), delimiter=separator, strict=True)
        if {len(row) for row in table} != {len(head)} or len(table) != len(NAMES) * EXERCISES:
            return f"{len(table)} rows of {sorted({len(row) for row in table})} cells, the header has {len(head)}"
        table = [dict(zip(head, row)) for row in table]
        if {(row["Person"], row["Full name"].removeprefix("'"), row["Groups"]) for row in table} != {(*both, "autumn; spring") for both in NAMES.items()}:
            return f"people: {table[0]}"
        if any(cell[:1] in "=+@" for row in table for cell in row.values() if cell):
            return "a cell begins like a formula"
        tried = [row for row in table if row["Attempts"] != "0"]
        if len(tried) != 1 or tried[0]["Verdict"] != made[0]["verdict"] or any(row["Verdict"] != "not tried" for row in table if row not in tried):
            return f"tried: {tried}"
        measures = {measure["measure"]: measure["value"] for measure in made[0]["measures"]}
        for title, name, factor in (("Peak force [N]", "peak_force_n", 1), ("Largest distance from the needle's own line [mm]", "largest_lateral_error_m", 1000)):
            seen, value = tried[0][title], measures.get(name)
            if (seen == "") != (value is None) or (seen and abs(float(seen.replace(sign, ".")) - value * factor) > 1e-6):
                return f"{title} is {seen}, not {value} * {factor}"
        date = tried[0]["Date of best attempt (UTC)"]
        return "" if re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d", date) else f"date {date}"

    def command(style):
        lesson()
        fault, content = by_command("--separator", style)
        return fault or wrong(content, style)

    def console(style):
        lesson()
        return wrong(by_console(f"separator={style}"), style)

    for style in STYLES:
        yield f"results with a {style}, by needlelab-admin", lambda style=style: command(style)
        yield f"results with a {style}, by the console", lambda style=style: console(style)

    def without():
        lesson()
        fault, content = by_command()
        return fault or wrong(content, "comma") or wrong(by_console(""), "comma")

    yield "without a separator it is a comma", without
