"""Trajectories and recordings: rates, times, ticks, and a needle the wrong way round."""
from lab import SAMPLES, near, number, says

HEADER = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw"
PROFILE = SAMPLES / "paper-1dof.json"
WAY_M, DEEP_M, SPEED, REST_S = 0.04, 0.03, 0.04, 1.0  # from 10 mm above the skin to 30 mm below, and back


def stroke(rate_hz=1000, quaternion="1,0,0,0"):
    rows, down_s = [], WAY_M / SPEED
    for k in range(int((2 * down_s + REST_S) * rate_hz) + 1):
        t = k / rate_hz
        way = SPEED * t if t < down_s else WAY_M if t < down_s + REST_S else WAY_M - SPEED * (t - down_s - REST_S)
        rows.append(f"{t:.6f},0,0,{WAY_M - DEEP_M - way:.9f},{quaternion}")
    return rows


def text(rows, header=HEADER):
    return "\n".join([header, *rows]) + "\n"


def rows(lab):
    run, file = lab.programs.run, lab.programs.file

    def score(name, content, *words):
        return run("sim", "score", "--profile", PROFILE, "--trajectory", file(name, content), *words)

    def in_tissue(name, content, *words):
        said = score(name, content, *words)
        right = REST_S + 2 * DEEP_M / SPEED
        return says(said, 0) or near(number(said.out, "Time in tissue"), right, 0.01, "time in tissue")

    def played(words, code, *texts):
        return says(run("station", "--headless", "--profile", PROFILE, "--spool", lab.programs.folder / "tracks", "--seconds", "5", *words), code, *texts)

    def kept():
        there = file("there.csv", "mine\n")
        words = ["sim", "run", "--profile", PROFILE, "--trajectory", file("t.csv", text(stroke(100))), "--out", there]
        wrong = says(run(*words), 2, "is there already", "--replace") or ("" if there.read_text() == "mine\n" else "the file was replaced")
        return wrong or says(run(*words, "--replace"), 0) or ("" if there.read_text() != "mine\n" else "the file was not replaced")

    mixed = stroke()
    mixed[100], mixed[900] = mixed[900], mixed[100]
    equal = [row.replace(row.split(",")[0], "1.500000", 1) for row in stroke()]
    hole = stroke()[:500] + stroke()[600:]
    for rate in (50, 100, 500, 1000, 2000):
        yield f"score of a file of {rate} Hz has the file's times", lambda rate=rate: in_tissue("t.csv", text(stroke(rate)))
    yield "score of a file with semicolons and decimal commas", lambda: in_tissue(
        "t.csv", text([row.replace(",", ";").replace(".", ",") for row in stroke()], HEADER.replace(",", ";")))
    yield "score of a file with tabs, capitals and units in brackets", lambda: in_tissue(
        "t.csv", text([row.replace(",", "\t") for row in stroke()], "T [s]\tPX (m)\tPY_M\tpz [m]\tQX\tQY\tQZ\tQW"))
    yield "score of a file with lines above the header", lambda: in_tissue("t.csv", "Instrument 7\n" + text(stroke()), "--lines-above", "1")
    for name, content, why in (("rows out of order", mixed, "row 102 (line 103)"), ("equal times", equal, "the same as 1.5"),
                               ("a hole", hole, "t_s jumps from 0.499 to 0.6")):
        yield f"score refuses {name}", lambda content=content, why=why: says(score("t.csv", text(content)), 2, why)
        yield f"run refuses {name}", lambda content=content, why=why: says(
            run("sim", "run", "--profile", PROFILE, "--trajectory", file("t.csv", text(content)), "--out", lab.programs.folder / "o.csv"), 2, why)
        yield f"recording:FILE refuses {name}", lambda content=content, why=why: played(["--device", f"recording:{file('t.csv', text(content))}"], 2, why)
        yield f"--hand-plan refuses {name}", lambda content=content, why=why: played(["--hand-plan", file("t.csv", text(content))], 2, why)
    yield "a result that is there already is kept", lambda: kept()
    yield "a header without the column is shown", lambda: says(score("t.csv", text(stroke(), "time,x,y,z,a,b,c,d")), 2, "'t_s' is missing", "'time,x,y,z,a,b,c,d'")
    yield "hub first is warned of", lambda: says(score("t.csv", text(stroke(100, "0,0,0,1"))), 0, "points out of the skin", "w, x, y, z")
    yield "straight in is not warned of", lambda: score("t.csv", text(stroke(100))).err
    half_w, half_z = "0.965925826", "0.258819045"  # half a turn about x, then 30° about the y of the limb: x, y, z, w and w, x, y, z
    yield "a tilt of 30° is not warned of", lambda: score("t.csv", text(stroke(100, f"{half_w},0,0,{half_z}"))).err
    first = text(stroke(100, f"{half_z},{half_w},0,0"))
    yield "a tilt of 30° with w first is warned of by score", lambda: says(score("t.csv", first), 0, "w, x, y, z", "tilted by 30°")
    yield "and by run", lambda: says(run("sim", "run", "--profile", PROFILE, "--trajectory", file("t.csv", first), "--out", lab.programs.folder / "o.csv", "--replace"),
                                     0, "tilted by 30°")
    yield "and by recording:FILE", lambda: played(["--device", f"recording:{file('t.csv', first)}"], 0, "tilted by 30°")
    yield "and by --hand-plan", lambda: played(["--hand-plan", file("t.csv", first)], 0, "tilted by 30°")
    yield from other_units(lab, score, played)
    yield from other_texts(in_tissue)
    gap = stroke(60)[:90] + stroke(60)[96:]  # at rest
    yield "a tracker's gap is bridged by --damaged, and the measures are marked", lambda: in_tissue("t.csv", text(gap), "--damaged") or says(
        score("t.csv", text(gap), "--damaged"), 0, "row 91 (line 92)", "a straight line bridges it", "incomplete: measures of a gesture with 1 gap")
    yield "without it the refusal names the option", lambda: says(score("t.csv", text(gap)), 2, "row 91 (line 92)", "--damaged")
    yield "run bridges it too", lambda: says(run("sim", "run", "--profile", PROFILE, "--trajectory", file("t.csv", text(gap)), "--damaged", "--out",
                                                 lab.programs.folder / "o.csv", "--replace"), 0, "a straight line bridges it")
    yield from recorded(lab)


def scaled(time, place):
    rows = []
    for row in stroke(100):
        cells = row.split(",")
        rows.append(",".join([f"{float(cells[0]) * time:.6f}", *(f"{float(cell) * place:.9f}" for cell in cells[1:4]), *cells[4:]]))
    return text(rows)


def other_units(lab, score, played):
    """Right names, other units: a depth of 30 mm, a step of 10 ms."""
    file = lab.programs.file
    units = {"millimetres": (1, 1000), "centimetres": (1, 100), "milliseconds": (1000, 1), "microseconds": (1e6, 1), "milliseconds ": (1000, 1000)}
    for unit, (time, place) in units.items():
        content = scaled(time, place)
        yield f"score asks for {unit}", lambda unit=unit, content=content: says(score("t.csv", content), 2, f"looks like {unit.strip()}")
    for unit in ("millimetres", "milliseconds"):
        content = scaled(*units[unit])
        yield f"recording:FILE asks for {unit}", lambda unit=unit, content=content: played(["--device", f"recording:{file('t.csv', content)}"], 2, f"looks like {unit}")
        yield f"--hand-plan asks for {unit}", lambda unit=unit, content=content: played(["--hand-plan", file("t.csv", content)], 2, f"looks like {unit}")
    poses = {"--tool": {"0,0,130": "130 millimetres are 0.13 m", "0,0,5.2": "5.2 inches are 0.13208 m"}, "--placement": {"0,0,-20": "20 millimetres are 0.02 m"}}
    for option, texts in poses.items():
        for pose, why in texts.items():
            words = [option, f"{pose},0,0,0,1"]
            yield f"score refuses {option} {pose}", lambda words=words, why=why: says(score("t.csv", text(stroke(100)), *words), 2, words[0], why)
            yield f"the station refuses {option} {pose}", lambda words=words, why=why: played(words, 2, words[0], why)
    yield "a needle that never meets the skin is warned of", lambda: says(
        score("t.csv", text(stroke(100)), "--placement", "0,0,-0.05,0,0,0,1"), 0, "never meets the skin; the nearest row is 0.02 m above it")


def other_texts(in_tissue):
    """Signs, comments and letters of instruments."""
    plain = stroke(100)
    signed = [",".join(f"+{float(cell):.9f}" if float(cell) >= 0 else f"\u2212{abs(float(cell)):.9f}" for cell in row.split(",")) for row in plain]
    for name, content in {
        "plus signs and true minus signs": text(signed),
        "numpy's header": "# " + text(plain),
        "comments above, between and below": "% by hand\n# needle 18G\n" + text([plain[0], "// a rest", *plain[1:], "# end"]),
        "a comment behind a row": text([plain[0] + " # touched", *plain[1:]]),
        "a degree sign in Latin-1": text([row + ",21" for row in plain], HEADER + ",t [\u00b0C]").encode("latin-1"),
    }.items():
        yield f"score of a file with {name}", lambda content=content: in_tissue("t.csv", content)


def recorded(lab):
    """A session at 500 Hz, exported as a recording and as CSV: the server's score, and tables modified by hand."""
    run, file, folder = lab.programs.run, lab.programs.file, lab.programs.folder
    once = {}

    def session():
        if not once:
            lab.admin("user", "add", "tom", "--role", "trainee")
            lab.station("--trainee", "tom", "--exercise", "shoulder-bursa", "--rate", "500", "--seconds", "8")
            once["id"] = lab.admin("session", "list", "--trainee", "tom").out.splitlines()[1].split()[0]
            lab.admin("profile", "export", "shoulder-adult", "--out", folder / "p.json")
            for ending, kind in (("nlrec", "recording"), ("csv", "csv")):
                lab.admin("session", "export", once["id"], "--every-tick", "--format", kind, "--out", folder / f"whole.{ending}")
            once["server"] = lab.admin("session", "score", once["id"]).out
        return once["id"]

    def score(path, *words):
        session()
        return run("sim", "score", "--profile", folder / "p.json", "--recorded", path, *words)

    def changed(change):
        session()
        head, *body = (folder / "whole.csv").read_text().splitlines()
        return file("changed.csv", "\n".join([head, *change(body)]) + "\n")

    def as_the_server(ending):
        said = score(folder / f"whole.{ending}")
        return says(said, 0) or near(number(said.out, "Time in tissue"), number(once["server"], "time_in_tissue_s"), 0.02, "time in tissue")

    for ending in ("nlrec", "csv"):
        yield f"score --recorded of a .{ending} of 500 Hz is the server's", lambda ending=ending: as_the_server(ending)
        yield f"score --recorded --rate 1000 of a .{ending} of 500 Hz is refused", lambda ending=ending: says(
            score(folder / f"whole.{ending}", "--rate", "1000"), 2, "was recorded at 500 Hz")
    yield "exported samples sorted by z are refused", lambda: says(score(changed(lambda body: sorted(body, key=lambda row: float(row.split(",")[5])))), 2, "ticks must ascend")
    yield "exported samples newest first are refused", lambda: says(score(changed(lambda body: body[::-1])), 2, "ticks must ascend")
    yield "exported samples with rows deleted are refused", lambda: says(score(changed(lambda body: body[:1000] + body[2000:])), 1, "are missing behind row 1000", "--damaged")
    yield "with --damaged they are scored, and the hole is named", lambda: says(
        score(changed(lambda body: body[:1000] + body[2000:]), "--damaged"), 0, "are missing behind row 1000")

    def as_a_spreadsheet(body):
        """General format: six digits of long whole numbers."""
        return [",".join(f"{float(cell):.5E}" if k == 2 else cell for k, cell in enumerate(row.split(","))) for row in body]

    def restored():
        said = score(changed(as_a_spreadsheet))
        return says(said, 0, "time_ns was rounded by a spreadsheet") or near(
            number(said.out, "Time in tissue"), number(once["server"], "time_in_tissue_s"), 0.02, "time in tissue")

    yield "exported samples that a spreadsheet saved have the times of t_s", restored

    def in_capitals():
        session()
        return score(file("WHOLE.CSV", (folder / "whole.csv").read_bytes()))

    yield "exported samples in a .CSV are read", lambda: says(in_capitals(), 0) or near(
        number(in_capitals().out, "Time in tissue"), number(once["server"], "time_in_tissue_s"), 0.02, "time in tissue")
