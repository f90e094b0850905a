#!/usr/bin/env python3
"""Runs the labs of a table by needlelab-load, in turn, and writes medians as a page and all numbers as JSON beside it.

  growth   1 to 1,000 stations on SQLite (load.md), some five minutes
  stores   1,000 stations on SQLite, on PostgreSQL, with a synchronous standby, and half of them there with one server, and with two servers and NATS; also what a second of one
           station costs in each process (load_stores.md), some fifteen minutes.

PostgreSQL's clusters are those of tests/bench/ingest/ingest_clusters (with fsync, on /tmp).
"""
import argparse
import dataclasses
import datetime
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
CLUSTERS = HERE.parent / "bench" / "ingest" / "ingest_clusters"
FOLDER = pathlib.Path("/tmp/needlelab-labs")


@dataclasses.dataclass(frozen=True)
class Row:
    """A lab. `viewers` share its stations. `cluster`: from tests/bench/ingest/ingest_clusters; None: SQLite. `servers`: the names, if several."""
    name: str
    stations: int = 1000
    viewers: int = 10
    cluster: str | None = None
    servers: str = ""


GROWTH = tuple(Row(f"{stations:,}", stations, min(stations, 10)) for stations in (1, 10, 50, 100, 200, 500, 1000))
STORES = (Row("SQLite"),
          Row("PostgreSQL", cluster="alone"),
          Row("PostgreSQL, a synchronous standby", cluster="primary"),
          Row("PostgreSQL, a synchronous standby, half of the stations", 500, cluster="primary"),
          Row("two servers and NATS, a synchronous standby, half of the stations", 500, 10, "primary", "a,b"),
          Row("two servers and NATS, watched by nobody", 500, 0, "primary", "a,b"))
ONE_SERVER, TWO_SERVERS, UNWATCHED = STORES[2], STORES[4], STORES[5]
MOST_LIVE_P99_MS = 50  # the goal of tests/bench/README.md
WRONG = ("lost", "duplicated", "different", "foreign")
COSTS = (  # key of a process, column, unit of a station-second
    ("cpu_s", "CPU µs", 1e6), ("log_bytes", "log bytes", 1), ("disk_bytes", "bytes to disk", 1), ("sent_bytes", "bytes sent", 1),
    ("received_bytes", "bytes received", 1), ("messages_out", "messages out", 1), ("messages_in", "messages in", 1))


def median(values):
    """None if any of them is None."""
    values = list(values)
    return None if not values or None in values else statistics.median(values)


def wrong(run):
    return sum(run[key] for key in WRONG)


def use_of(run, process, key):
    """For one process; for "servers", all of them together. None: unknown, or no such process."""
    found = [one[key] for one in run["processes"]
             if one["name"] == process or (process == "servers" and one["name"].split()[0] == "server")]
    return None if not found or None in found else sum(found)


def cost(runs, process, key):
    """Median over the runs of the cost of one station for one second: µs, bytes, messages. None: unknown."""
    scale = next(scale for name, _, scale in COSTS if name == key)
    used = [(use_of(run, process, key), run["station_s"]) for run in runs]
    return median(None if value is None else scale * value / station_s for value, station_s in used)


def share_elsewhere(run):
    """Of the frames that viewers saw, the share from stations at another server."""
    return run["live_frames_elsewhere"] / run["live_frames_seen"] if run["live_frames_seen"] else 0


def numbered(value, digits=0):
    return "" if value is None else f"{value:,.{digits}f}"


def markdown(head, lines, left=1):
    """A table; the first `left` columns are texts."""
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, *lines]).replace(
        "\n", "\n|" + "---|" * left + "---:|" * (len(head) - left) + "\n", 1) + "\n"


def costs_table(runs_of):
    """`runs_of`: row -> its runs. One line per process."""
    lines = []
    for row, runs in runs_of.items():
        for index, process in enumerate(one["name"] for one in runs[0]["processes"]):
            # messages with one decimal, other numbers whole
            cells = [numbered(cost(runs, process, key), 1 if key.startswith("messages") else 0) for key, _, _ in COSTS]
            lines.append([row.name if index == 0 else "", process, *cells])
    return markdown(["store", "process", *(column for _, column, _ in COSTS)], lines, 2)


def write(path, about, runs_of):
    """One run per line. `about`: a dict with commit and time."""
    rows = ",\n".join(f'  {{"row": {json.dumps(row.name)}, "runs": [\n' + ",\n".join("   " + json.dumps(run) for run in runs) + "\n  ]}"
                      for row, runs in runs_of.items())
    path.write_text(json.dumps(about)[:-1] + f', "rows": [\n{rows}\n]}}\n', encoding="utf-8")


def read(path):
    """(about, runs_of); rows missing in the file are omitted."""
    whole = json.loads(path.read_text(encoding="utf-8"))
    by_name = {row.name: row for row in STORES}
    return whole, {by_name[one["row"]]: one["runs"] for one in whole["rows"]}


def per_s(process, key="cpu_s", scale=1):
    def value(run):
        used = use_of(run, process, key)
        return None if used is None else scale * used / run["streamed_s"]
    return value


def where(is_there, key):
    return lambda run: run[key] if run[is_there] else None


COLUMNS = {  # name: format, value
    "stations": ("{:,}", lambda run: run["stations"]),
    "viewers": ("{}", lambda run: run["viewers"]),
    "server cores": ("{:.2f}", per_s("servers")),
    "PostgreSQL cores": ("{:.2f}", per_s("PostgreSQL")),
    "standby cores": ("{:.2f}", per_s("standby")),
    "NATS cores": ("{:.2f}", per_s("NATS")),
    "generator cores": ("{:.2f}", per_s("generator")),
    "PostgreSQL's log, MB/s": ("{:.1f}", per_s("PostgreSQL", "log_bytes", 1e-6)),
    "server MiB": ("{:.1f}", lambda run: run["server_rss_kib"] / 1024),
    "ack p50 ms": ("{:.1f}", lambda run: run["ack_p50_ms"]),
    "ack p99 ms": ("{:.1f}", lambda run: run["ack_p99_ms"]),
    "live p50 ms": ("{:.1f}", where("live_frames_seen", "live_p50_ms")),
    "live p99 ms": ("{:.1f}", where("live_frames_seen", "live_p99_ms")),
    "live max ms": ("{:.1f}", where("live_frames_seen", "live_max_ms")),
    "… elsewhere": ("{:.1f}", where("live_frames_elsewhere", "live_elsewhere_p99_ms")),
    "frames not seen": ("{:.0f}", where("live_frames_sent", "live_dropped_frames")),
    "generator late p99 ms": ("{:.1f}", lambda run: run["late_p99_ms"]),
    "database MB": ("{:.1f}", lambda run: run["database_bytes"] * 1e-6),
    "bytes/sample": ("{:.2f}", lambda run: run["bytes_per_sample"]),
    "lost": ("{:.0f}", lambda run: run["lost"]),
    "doubled": ("{:.0f}", lambda run: run["duplicated"]),
    "wrong": ("{:.0f}", wrong),
}
COUNTED = ("stations", "viewers", "lost", "doubled", "wrong")
OF_GROWTH = tuple(name for name in COLUMNS if name not in ("PostgreSQL cores", "standby cores", "NATS cores", "PostgreSQL's log, MB/s", "… elsewhere", "lost", "doubled"))
OF_STORES = tuple(name for name in COLUMNS if name not in ("viewers", "live p50 ms", "live max ms", "bytes/sample"))


def table(runs_of, columns):
    """The maximum for error counts, medians of the rest."""
    lines = []
    for row, runs in runs_of.items():
        cells = []
        for column in columns:
            format_, value = COLUMNS[column]
            values = [value(run) for run in runs]
            found = max(values) if column in COUNTED else median(values)
            cells.append("" if found is None else format_.format(found))
        lines.append([row.name, *cells])
    return markdown(["lab", *columns], lines)


def goals(runs_of):
    """(met, text) for each, over all sizes; latency at the largest."""
    most, bad = list(runs_of.values())[-1], sum(wrong(run) for runs in runs_of.values() for run in runs)
    whole = all(run["good"] for runs in runs_of.values() for run in runs)
    live = median(COLUMNS["live p99 ms"][1](run) for run in most)
    return [(whole and bad == 0, f"samples lost, doubled or different, over all sizes: {bad}, all sessions complete: {'yes' if whole else 'no'}"),
            (live is not None and live < MOST_LIVE_P99_MS,
             f"capture to viewer p99 at {most[0]['stations']:,} stations: {'unknown' if live is None else f'{live:.1f} ms'}, below {MOST_LIVE_P99_MS} ms (the oldest sample of a frame, from when it was due)")]


def head_of(runs_of, about, title):
    first = next(iter(runs_of.values()))
    return (f"# {title}\n\n{first[0]['machine']}; {about['when']}; commit {about['commit']}\n\n"
            f"Written by `tests/load/labs.py`: `needlelab-load` for {first[0]['seconds']:g} s, {len(first)} runs of each row in turn, medians. "
            "Servers, PostgreSQL, its standby, NATS and the generator share the machine's cores, its disk and its loopback: the columns say what each of them takes. ")


def growth_page(runs_of, about):
    return (head_of(runs_of, about, "Load, from one station to a thousand") +
            "Each station streams 1,000 samples a second over TLS and is watched at full rate by one of the viewers. Latencies count from when a sample was due (the frame's oldest; its 20 ms are in it). "
            "Every stored sample was compared with what was generated: \"wrong\" are those lost, doubled, different or strange.\n\n" + table(runs_of, OF_GROWTH) + "\n## Goals\n\n" +
            "".join(f"- {'PASS' if met else 'FAIL'}: {text}\n" for met, text in goals(runs_of)))


def stores_page(runs_of, about):
    stations = next(iter(runs_of)).stations
    return (
        head_of(runs_of, about, f"{stations:,} stations on each store, and half of them on two servers") +
        "**Two cores cannot show how any of it "
        "scales**, and two servers here take from each other what one would have. A station watched at the other server passes two servers and NATS; two cores have no room for that and "
        f"{stations:,} stations, so the rows with two servers have half of them, as one with one server has for comparison. Each of two servers has half of those, \"server cores\" are of both, \"server MiB\" of the larger one, "
        "and each viewer watches as many stations of its own server as of the other one (\"… elsewhere\": those alone). "
        "\"Wrong\" are samples lost, doubled, different or strange; of these counts the most of any run.\n\n" + table(runs_of, OF_STORES) +
        "\n## What a second of one station costs\n\n"
        "Each process over the streaming, divided by stations × seconds of the whole run (of servers a and b together that is a station's cost). Log bytes: PostgreSQL's log (WAL). "
        "Bytes to disk: pages that became dirty, by the kernel's count; a page that is written again after a sync counts again. Bytes sent and received: of a server to and from stations, viewers and NATS, "
        "without TLS; of PostgreSQL its log to the standby (its traffic with the servers is not counted); of NATS what its messages hold. Messages: of a server what it parsed, frames and "
        "acknowledgements; what servers say of their stations counts at NATS. Log-ins before and scoring after are not part.\n\n" + costs_table(runs_of))


PAGES = {"growth": (GROWTH, 1, "load.md", growth_page), "stores": (STORES, 3, "load_stores.md", stores_page)}


def command_of(given, row, database, result):
    command = [given.bin / "needlelab-load", "--stations", str(row.stations), "--viewers", str(row.viewers), "--seconds", str(given.seconds), "--quiet", "--json", result]
    if row.cluster:
        subprocess.run(["psql", "-X", "-q", "-h", FOLDER / row.cluster, "-U", "needlelab", "-d", "postgres", "-c", f"CREATE DATABASE {database}"], check=True)
        command += ["--store", f"postgresql:///{database}?host={FOLDER / row.cluster}&user=needlelab"]
    if row.cluster == "primary":
        command += ["--standby", FOLDER / "standby" / "data" / "postmaster.pid"]
    if row.servers:
        command += ["--servers", row.servers]
    return command


def run_all(given, rows, rounds):
    runs_of = {row: [] for row in rows}
    with tempfile.TemporaryDirectory() as folder:
        for count in range(rounds):
            for number, (row, runs) in enumerate(runs_of.items()):
                result = pathlib.Path(folder) / "run.json"
                result.unlink(missing_ok=True)
                subprocess.run(command_of(given, row, f"load{count}_{number}", result), stdout=subprocess.DEVNULL, check=False)
                if not result.exists():
                    raise SystemExit(f"{row.name}: needlelab-load could not run, see above")
                runs.append(json.loads(result.read_text()))
                print(f"{row.name}: run {count + 1} of {rounds}", file=sys.stderr)
    return runs_of


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("labs", choices=PAGES)
    options.add_argument("bin", type=pathlib.Path, help="the folder of the programs, such as build/release/bin")
    options.add_argument("folder", type=pathlib.Path, help="for page and JSON, such as tests/bench/results/MACHINE")
    options.add_argument("--seconds", type=float, default=20, help="of streaming")
    given = options.parse_args()
    rows, rounds, name, page_of = PAGES[given.labs]
    about = {"commit": subprocess.run(["git", "-C", HERE, "describe", "--always", "--dirty"], check=True, capture_output=True, text=True).stdout.strip(),
             "when": f"{datetime.datetime.now(datetime.timezone.utc):%Y-%m-%d %H:%M} UTC"}
    clusters = any(row.cluster for row in rows)
    if clusters:
        subprocess.run([CLUSTERS, "start", FOLDER], check=True)
    try:
        runs_of = run_all(given, rows, rounds)
    finally:
        if clusters:
            subprocess.run([CLUSTERS, "stop", FOLDER], check=True)
    text = page_of(runs_of, about)
    (given.folder / name).write_text(text, encoding="utf-8")
    write((given.folder / name).with_suffix(".json"), about, runs_of)
    print(text)
    good = all(run["good"] for runs in runs_of.values() for run in runs)
    return 0 if good and (rows is not GROWTH or all(met for met, _ in goals(runs_of))) else 1


if __name__ == "__main__":
    sys.exit(main())
