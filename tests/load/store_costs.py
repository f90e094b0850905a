"""What runs of needlelab-load cost, for tests/load/stores and tests/load/scale: medians over runs, and what a second of one station costs in each process."""
import dataclasses
import json
import statistics


@dataclasses.dataclass(frozen=True)
class Row:
    """A way to run the lab. `cluster`: of tests/bench/ingest_clusters; None: SQLite. `servers`: names of several. `watched`: by ten viewers, else by nobody.
    `half`: so many of the stations, where all of them and two servers would be more than the machine."""
    name: str
    cluster: str | None = None
    servers: str = ""
    watched: bool = True
    half: bool = False


ROWS = (Row("SQLite"),
        Row("PostgreSQL", "alone"),
        Row("PostgreSQL, a synchronous standby", "primary"),
        Row("PostgreSQL, a synchronous standby, half of the stations", "primary", half=True),
        Row("two servers and NATS, a synchronous standby, half of the stations", "primary", "a,b", half=True),
        Row("two servers and NATS, watched by nobody", "primary", "a,b", False, True))
ONE_SERVER, TWO_SERVERS, UNWATCHED = ROWS[2], ROWS[4], ROWS[5]
WRONG = ("lost", "duplicated", "different", "foreign")
COSTS = (  # key of a process, column, unit of a station-second
    ("cpu_s", "CPU µs", 1e6), ("log_bytes", "log bytes", 1), ("disk_bytes", "bytes to disk", 1), ("sent_bytes", "bytes sent", 1),
    ("received_bytes", "bytes received", 1), ("messages_out", "messages out", 1), ("messages_in", "messages in", 1))


def median(values):
    """None if any of them is."""
    values = list(values)
    return None if not values or None in values else statistics.median(values)


def wrong(run):
    return sum(run[key] for key in WRONG)


def use_of(run, process, key):
    """Of one process; of "servers", all of them together. None: unknown, or there is no such process."""
    found = [one[key] for one in run["processes"]
             if one["name"] == process or (process == "servers" and one["name"].split()[0] == "server")]
    return None if not found or None in found else sum(found)


def cost(runs, process, key):
    """Median over the runs of what a second of one station costs there: µs, bytes, messages. None: unknown."""
    scale = next(scale for name, _, scale in COSTS if name == key)
    used = [(use_of(run, process, key), run["station_s"]) for run in runs]
    return median(None if value is None else scale * value / station_s for value, station_s in used)


def share_elsewhere(run):
    """Of the frames that viewers saw, those of stations at another server."""
    return run["live_frames_elsewhere"] / run["live_frames_seen"] if run["live_frames_seen"] else 0


def numbered(value, digits=0):
    return "" if value is None else f"{value:,.{digits}f}"


def markdown(head, lines, left=1):
    """A table; the first `left` columns are texts."""
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, *lines]).replace(
        "\n", "\n|" + "---|" * left + "---:|" * (len(head) - left) + "\n", 1) + "\n"


def costs_table(runs_of):
    """`runs_of`: row -> its runs. One line a process."""
    lines = []
    for row, runs in runs_of.items():
        for index, process in enumerate(one["name"] for one in runs[0]["processes"]):
            # messages of a tenth of a second, other numbers whole
            cells = [numbered(cost(runs, process, key), 1 if key.startswith("messages") else 0) for key, _, _ in COSTS]
            lines.append([row.name if index == 0 else "", process, *cells])
    return markdown(["store", "process", *(column for _, column, _ in COSTS)], lines, 2)


def write(path, about, runs_of):
    """A run a line. `about`: a dict of commit and when."""
    rows = ",\n".join(f'  {{"row": {json.dumps(row.name)}, "runs": [\n' + ",\n".join("   " + json.dumps(run) for run in runs) + "\n  ]}"
                      for row, runs in runs_of.items())
    path.write_text(json.dumps(about)[:-1] + f', "rows": [\n{rows}\n]}}\n', encoding="utf-8")


def read(path):
    """(about, runs_of); a row that the file lacks is not there."""
    whole = json.loads(path.read_text(encoding="utf-8"))
    by_name = {row.name: row for row in ROWS}
    return whole, {by_name[one["row"]]: one["runs"] for one in whole["rows"]}
