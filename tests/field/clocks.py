"""Stations with a wrong clock."""
import json
import shutil
import time

from lab import says

HOUR_S = 3600


def rows(lab):
    lab.admin("user", "add", "cleo", "--role", "trainee")
    lab.admin("user", "add", "carl", "--role", "trainee")

    def practise(name, **how):
        return lab.station("--trainee", name, "--exercise", "shoulder-bursa", "--seconds", "2", **how)

    def sessions(name):
        return json.loads(lab.admin("session", "list", "--trainee", name, "--json").out)["rows"]

    def connected(hours):
        before = len(sessions("cleo"))
        said = practise("cleo", clock_s=hours * HOUR_S)
        newest = sessions("cleo")
        if len(newest) != before + 1:
            return said.all[-300:]
        off_s = abs(max(row["started_unix_ns"] for row in newest) / 1e9 - time.time())
        return (says(said, 0, "this computer's clock is")) or ("" if off_s < 600 else f"the begin is off by {off_s} s")

    for hours in (-0.5, 1.5):  # the certificate of this lab is new
        yield f"connected, {hours} h off: the begin is by the server's clock, and the station says so", lambda hours=hours: connected(int(hours * 2) / 2)

    def attempts():
        return json.loads(lab.admin("progress", "carl", "--json").out)["rows"]

    def offline(clock_s, spool):
        if not attempts():
            practise("carl")
        if not (lab.programs.folder / spool).exists():
            shutil.copytree(lab.programs.folder / "spool/lessons", lab.programs.folder / spool / "lessons")
        before = len(attempts())
        practise("carl", connected=False, clock_s=clock_s, spool=spool)
        practise("carl", spool=spool)
        marked = [row for row in sessions("carl") if row.get("unknown_trainee")]
        if not marked:
            return f"no session waits: {sessions('carl')}"
        if len(attempts()) != before + 1:
            return f"{len(attempts()) - before} attempts count, not one"
        shown = lab.admin("session", "show", marked[0]["session_id"])
        if "clock was wrong" not in shown.all:
            return shown.all[-300:]
        lab.admin("session", "assign", marked[0]["session_id"], "--to", "carl", "--begin", time.strftime("%Y-%m-%dT%H:%MZ", time.gmtime(time.time() - 600)))
        return "" if len(attempts()) == before + 2 else "it does not count once its begin is corrected"

    back_s = 1420070400 - int(time.time())
    yield "off line in 2015: the session waits for its begin, and the server's log says so", lambda: offline(back_s, "spool") or (
        "" if "clock_of_station" in lab.log.read_text(errors="replace") else "the log has no word")
    yield "off line in 2015 with a new spool", lambda: offline(back_s, "spool-2")
    yield "off line a day ahead", lambda: offline(24 * HOUR_S, "spool")
