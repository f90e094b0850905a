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
    yield "straight in is not warned of", lambda: "points out" in score("t.csv", text(stroke(100))).err
    yield from recorded(lab)


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
