#!/usr/bin/env python3
"""Toward 100,000 stations, on paper: what tests/load/labs.py and ingest_bench measured, multiplied; writes load_scale.md beside them.

usage: tests/load/scale.py tests/bench/results/MACHINE    (wants load_stores.json and ingest.md there)
"""
import argparse
import dataclasses
import math
import pathlib
import re

from labs import ONE_SERVER, TWO_SERVERS, UNWATCHED, cost, markdown, median, numbered, read, share_elsewhere

SIZES = (1_000, 10_000, 100_000)
# assumed
HOURS, DAYS = 4, 150  # of streaming of each station a day, and such days a year
WATCHED = 0.1  # of the stations, at full rate, by one person each, who may be at any server
BUSY = 0.5  # as much is planned of a writer, a link or a core
LINK = 125e6  # bytes a second: 1 Gbit/s
STANDBYS = 1
# of the code: server/live/remote_live.h, LoadStation, deploy/OPERATIONS.md
PRESENCE_HZ, PRESENCE_BYTES, WATCH_HZ, MOST_ELSEWHERE, MOST_SERVERS = 10, 60 << 10, 1, 20_000, 256
FRAMES_HZ, CONNECTIONS = 50, 20


def ceiling_of(text):
    """Chunks a second that one writer stored on PostgreSQL with a standby, of ingest.md: the least of the larger groups."""
    part = text[text.index("## PostgreSQL with a synchronous standby"):]
    rates = {int(group): int(rate) for group, rate in re.findall(r"^\| (\d+) \| (\d+) \|", part, re.MULTILINE)}
    return min(rate for group, rate in rates.items() if group >= 32)


@dataclasses.dataclass
class Costs:
    """Of a second of one station: µs, bytes, messages."""
    stations: int  # of the largest measured run, on one server
    together: int  # … on two
    server_us: float  # that nobody watches
    server_watched_us: float  # more, where somebody watches
    postgres_us: float
    standby_us: float
    log: float
    disk: float  # written by PostgreSQL's processes
    database: float  # that stay
    presence: float  # published to NATS of a station that nobody watches, with two servers
    frame_messages: float  # published to NATS of a station that is watched elsewhere, beyond presence
    frame_bytes: float
    nats_message_us: float  # of NATS, in or out


def known(value, what):
    if value is None:
        raise SystemExit(f"scale: the runs do not say {what}; measure on a machine with all processes, as root")
    return value


def costs_of(runs_of):
    watched, unwatched = runs_of[TWO_SERVERS], runs_of[UNWATCHED]

    def of(runs, process, key):
        return known(cost(runs, process, key), f"{key} of {process}")

    elsewhere = median(share_elsewhere(run) for run in watched)
    messages = of(watched, "NATS", "messages_in") + of(watched, "NATS", "messages_out")
    return Costs(
        stations=runs_of[ONE_SERVER][0]["stations"],
        together=watched[0]["stations"],
        server_us=of(unwatched, "servers", "cpu_s"),
        server_watched_us=max(0, of(watched, "servers", "cpu_s") - of(unwatched, "servers", "cpu_s")),
        postgres_us=of(watched, "PostgreSQL", "cpu_s"),
        standby_us=of(watched, "standby", "cpu_s"),
        log=of(watched, "PostgreSQL", "log_bytes"),
        disk=of(watched, "PostgreSQL", "disk_bytes"),
        database=median(run["database_bytes"] / run["station_s"] for run in watched),
        presence=of(unwatched, "NATS", "received_bytes"),
        frame_messages=max(0, of(watched, "NATS", "messages_in") - of(unwatched, "NATS", "messages_in")) / elsewhere,
        frame_bytes=max(0, of(watched, "NATS", "received_bytes") - of(unwatched, "NATS", "received_bytes")) / elsewhere,
        nats_message_us=of(watched, "NATS", "cpu_s") / messages)


@dataclasses.dataclass
class Lab:
    """What `stations` of one lab need: one database, one NATS, every server hears of all stations."""
    stations: int
    costs: Costs
    ceiling: int

    @property
    def servers(self):
        """As many stations each as were measured, and one to spare."""
        return math.ceil(self.stations / self.costs.stations) + 1

    @property
    def server_us(self):
        return self.stations * (self.costs.server_us + WATCHED * self.costs.server_watched_us)

    @property
    def writer(self):
        """Of what one writer can; a station sends a chunk a second."""
        return self.stations / self.ceiling

    @property
    def elsewhere(self):
        """Stations that are watched at another server than their own."""
        return self.stations * WATCHED * (self.servers - 1) / self.servers

    @property
    def presence_in(self):
        return self.stations * self.costs.presence

    @property
    def nats_in(self):
        """(messages, bytes) a second."""
        presence = max(self.servers * PRESENCE_HZ, self.presence_in / PRESENCE_BYTES)
        return (presence + self.elsewhere * self.costs.frame_messages, self.presence_in + self.elsewhere * self.costs.frame_bytes)

    @property
    def nats_out(self):
        """Presence, and who watches what, goes to each other server; frames go to the one that watches. Of who watches what the bytes count once: they are few."""
        messages, bytes_ = self.nats_in
        others = self.servers - 2  # one is counted already
        presence = max(self.servers * PRESENCE_HZ, self.presence_in / PRESENCE_BYTES)
        return messages + others * (presence + self.elsewhere * WATCH_HZ), bytes_ + others * self.presence_in

    @property
    def log_day(self):
        return self.stations * self.costs.log * HOURS * 3600

    @property
    def database_year(self):
        return self.stations * self.costs.database * HOURS * 3600 * DAYS

    @property
    def rows_year(self):
        return self.stations * HOURS * 3600 * DAYS

    def too_much(self):
        """Which of the planned limits it is over."""
        return {"writer": self.writer > BUSY, "log": self.stations * self.costs.log * STANDBYS > BUSY * LINK, "presence": self.nats_out[1] > BUSY * LINK,
                "elsewhere": self.stations * (self.servers - 1) / self.servers > MOST_ELSEWHERE, "servers": self.servers > MOST_SERVERS}


def largest(costs, ceiling, limit):
    """The most stations of one lab within a limit of Lab.too_much(), to some percent."""
    stations = 100
    while not Lab(stations, costs, ceiling).too_much()[limit] and stations < 10**8:
        stations = math.ceil(stations * 1.02)
    return stations


def size(value):
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if value < 1000:
            return f"{value:.0f} {unit}" if value >= 10 or unit == "B" else f"{value:.1f} {unit}"
        value /= 1000
    return f"{value:,.1f} PB"


def cores(microseconds):
    value = microseconds * 1e-6
    return f"{value:.2f}" if value < 1 else f"{value:.1f}"


def rounded(value):
    """Two digits: more would say more than is known."""
    if value <= 0:
        return "0"
    digits = max(0, math.floor(math.log10(value)) - 1)
    return f"{round(value / 10**digits) * 10**digits:,}"


def table(labs, count=1):
    """`count`: how many such labs there are."""
    def line(name, value, limit=None):
        cells = []
        for lab in labs:
            text = value(lab)
            cells.append(f"**{text}**" if limit and lab.too_much()[limit] else text)
        return [name, *cells]

    lines = [
        line("servers, one of them to spare", lambda lab: numbered(lab.servers), "servers"),
        line("their cores, all together", lambda lab: cores(lab.server_us)),
        line("chunks a second at PostgreSQL, of what one writer stores", lambda lab: f"{lab.stations:,}, {100 * lab.writer:.0f} %", "writer"),
        line("cores of PostgreSQL; of its standby", lambda lab: f"{cores(lab.stations * lab.costs.postgres_us)}; {cores(lab.stations * lab.costs.standby_us)}"),
        line("connections to PostgreSQL", lambda lab: numbered(CONNECTIONS * lab.servers)),
        line("log (WAL) a second, to disk and to each standby", lambda lab: size(lab.stations * lab.costs.log), "log"),
        line(f"log of a day of {HOURS} h, for an archive", lambda lab: size(lab.log_day)),
        line("bytes to the primary's disk a second, log and tables", lambda lab: size(lab.stations * lab.costs.disk)),
        line(f"database of a year of {DAYS} such days, on the primary and on each standby", lambda lab: size(lab.database_year)),
        line("rows of the table of chunks in that year", lambda lab: f"{rounded(lab.rows_year / 1e9)} billion" if lab.rows_year >= 1e10 else f"{lab.rows_year / 1e9:.1f} billion"),
        line("stations that a server hears of", lambda lab: rounded(lab.stations * (lab.servers - 1) / lab.servers), "elsewhere"),
        line("NATS: messages in and out a second", lambda lab: f"{rounded(lab.nats_in[0])} / {rounded(lab.nats_out[0])}"),
        line("NATS: bytes in and out a second", lambda lab: f"{size(lab.nats_in[1])} / {size(lab.nats_out[1])}", "presence"),
        line("cores of NATS, by its messages", lambda lab: cores(sum((lab.nats_in[0], lab.nats_out[0])) * lab.costs.nats_message_us)),
        line("frames a second to viewers; of them through NATS", lambda lab: f"{rounded(lab.stations * WATCHED * FRAMES_HZ)}; {rounded(lab.elsewhere * FRAMES_HZ)}"),
    ]
    head = [f"{lab.stations:,} stations" if count == 1 else f"each of {count} labs of {lab.stations:,}" for lab in labs]
    return markdown(["", *head], lines)


def bottlenecks(labs, most):
    """`most`: limit -> stations of one lab."""
    costs, middle, last = labs[0].costs, labs[1], labs[2]
    limited = {
        "writer": (
            "one write transaction at a time for all servers (the store's lock: nothing is stored between the comparison of a claim and its COMMIT)",
            f"{rounded(most['writer'])} stations are {100 * BUSY:.0f} % of one writer; servers that take turns hand the lock on, which takes longer than one writer alone",
            "**shards by site**: a database for each site, and a directory that says where a person's and a station's data is; what asks across sites (a faculty's results) asks each. "
            "Within a site chunks could lock their station's claim in place of the store"),
        "presence": (
            f"presence of every station goes to every server, {PRESENCE_HZ} times a second",
            f"bytes out of NATS grow with stations times servers: {rounded(most['presence'])} stations fill {100 * BUSY:.0f} % of 1 Gbit/s; and each server reads all of it",
            "**a subject tree**, `nl.LAB.presence.SITE.SERVER`: a server listens to the sites that somebody looks at, and to one line a second about each other site"),
        "log": (
            "PostgreSQL's log to the standby", f"{rounded(most['log'])} stations fill {100 * BUSY:.0f} % of 1 Gbit/s", "a link of 10 Gbit/s; then shards"),
        "elsewhere": (
            f"a server takes {MOST_ELSEWHERE:,} stations of others", f"`RemoteLiveSettings`; {rounded(most['elsewhere'])} stations in one lab", "the subject tree: the bound is a site's then"),
        "servers": (f"a server takes {MOST_SERVERS} others", f"`RemoteLiveSettings`; {rounded(most['servers'])} stations in one lab", "the subject tree, or shards"),
    }
    others = [
        ("who watches what is said to all servers, once a second", f"{rounded(last.elsewhere * WATCH_HZ * (last.servers - 1))} messages a second at {last.stations:,} stations",
         "`watch` below the name of the server that has the station"),
        ("one table of chunks, one index on it",
         f"{middle.rows_year / 1e9:.0f} billion rows a year at {middle.stations:,} stations; retention deletes rows and leaves them to VACUUM; a base backup and its verification read all of it",
         "**partitioned tables**: chunks by the month of their session. Retention drops a partition, and a backup reads only what is new"),
        (f"a server's network is one thread; no run had more than {costs.stations:,} stations", "cores of a server stay idle", "more servers, also several on one machine"),
        (f"some {CONNECTIONS} connections of each server to PostgreSQL", f"{CONNECTIONS * last.servers:,} at {last.stations:,} stations in one lab",
         "shards; a pooler by transaction is no step, because locks and notices belong to connections"),
        ("one nats-server", "it carries all that is watched elsewhere", "a cluster (`deploy/faculty/nats-server.conf` has its lines), each site's servers at one of its members"),
        ("all stations log in again after an outage", "each log-in is a transaction, too; `deploy/nightly herd` has 1,000 at one server", "shards; stations wait with jitter already"),
    ]
    ordered = [limited[limit] for limit in sorted(most, key=most.get)]
    return markdown(["what", "where it shows", "the step"], [list(one) for one in ordered + others], 3)


def page(about, runs_of, ceiling):
    costs = costs_of(runs_of)
    first = runs_of[TWO_SERVERS][0]
    labs = [Lab(stations, costs, ceiling) for stations in SIZES]
    most = {limit: largest(costs, ceiling, limit) for limit in labs[0].too_much()}
    # shards: no limit of one lab is passed
    least = min(most.values())
    shards = math.ceil(SIZES[-1] / least)
    shard = Lab(math.ceil(SIZES[-1] / shards), costs, ceiling)
    first_of_all = min(most, key=most.get)
    names = {"writer": "one writer at a time", "log": "PostgreSQL's log on a link of 1 Gbit/s", "presence": "presence of all stations at all servers, on a link of 1 Gbit/s",
             "elsewhere": f"the bound of {MOST_ELSEWHERE:,} stations elsewhere", "servers": f"the bound of {MOST_SERVERS} servers"}
    order = sorted(most, key=most.get)
    bound = "; ".join(f"{names[limit]}: {rounded(most[limit])}" for limit in order)
    return f"""# Toward 100,000 stations, on paper

{first['machine']}; measured {about['when']}, commit {about['commit']}. Written by `tests/load/scale.py` from `load_stores.json` and `ingest.md` of this folder: no number of the tables is typed in.

**Nothing here was run at these sizes.** Measured were {costs.stations:,} stations on one server and {costs.together:,} on two, on two cores that also had PostgreSQL, its standby, NATS and the stations. The tables multiply what a second of
one station cost with two servers there. They show where the design ends, not what a faculty will see.

## What is assumed
Each station streams {HOURS} h a day on {DAYS} days a year. At any moment {100 * WATCHED:.0f} % of the stations are watched at full rate, each by one person, who may be at any server. PostgreSQL has {STANDBYS} synchronous standby. A server takes as many
stations as were measured on one ({costs.stations:,}), and one server is to spare. Of a writer or a network {100 * BUSY:.0f} % are planned; a network has 1 Gbit/s.

## What was measured
A second of one station: {costs.server_us:.0f} µs of a server ({costs.server_watched_us:.0f} more if it is watched), {costs.postgres_us:.0f} µs of PostgreSQL, {costs.standby_us:.0f} µs of its standby, {costs.log:,.0f} bytes of log, {costs.disk:,.0f} bytes to the primary's disk,
{costs.database:,.0f} bytes of database; {costs.presence:,.0f} bytes of presence to NATS, and if it is watched at another server {costs.frame_messages:.0f} messages with {costs.frame_bytes:,.0f} bytes more; {costs.nats_message_us:.0f} µs of NATS a message.
One writer alone stored {ceiling:,} chunks a second on PostgreSQL with a standby (`ingest.md`), and a station makes one a second.

## One lab, as the code is
Bold: over what is planned, or over a bound of the code.

{table(labs)}
The first limit is {names[first_of_all]}. Stations of one lab at which each is reached: {bound}.

## {SIZES[-1]:,} stations as {shards} labs
Each lab (a site, or some) has its own database with its standby, its own NATS, and its own servers; a station belongs to one.

{table([shard], shards)}
All together: {shards * shard.servers} servers, {shards} primaries and {shards * STANDBYS} standbys, {size(SIZES[-1] * costs.log)} of log a second, {size(sum(lab.database_year for lab in labs[-1:]))} of database a year on the primaries.

## The bottlenecks, and the step that removes each
First those with a number above, in the order in which they come.

{bottlenecks(labs, most)}
## What was not measured
- More than {costs.stations:,} stations, more than two servers, more than two cores, more than one machine. A network between machines: its latency is in each commit (server to PostgreSQL twice, PostgreSQL to the standby once). Here primary and standby sync to one disk.
- Servers that take turns at the store's lock when it is busy. The writer's rate is that of one store in one process on an otherwise idle machine.
- How costs fall as labs grow: the more chunks share a commit, the less processor and the fewer bytes to disk each of them takes at PostgreSQL and at its standby, and the same holds for frames that share a system call.
  The tables take the costs of {costs.together:,} stations for all sizes.
- What a server does to hear of thousands of stations elsewhere ten times a second: with two servers each heard of {costs.together // 2:,}.
- TLS to NATS and PostgreSQL; a cluster of NATS; a slow viewer beside it ("tests/faculty" has one).
- Overviews of instructors and of the console, reports, scoring, closes, exports, retention, backups, rescoring beside the streaming. Each takes processor and disk that the tables lack.
- Lessons of real length: these streamed {first['seconds']:g} s. What a session costs once (its row, profile, score) is in "bytes of database" of so short a session, so that a year's database is rather less; indexes that no longer fit the memory would make
  PostgreSQL write and read more.
- A database of a year's size; VACUUM and checkpoints over hours: the streaming had at most one checkpoint.
- Stations with a spool: load stations keep their chunks in memory.
"""


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("results", type=pathlib.Path, help="a folder of tests/bench/results")
    given = options.parse_args()
    about, runs_of = read(given.results / "load_stores.json")
    for row in (ONE_SERVER, TWO_SERVERS, UNWATCHED):
        if row not in runs_of:
            raise SystemExit(f"scale: load_stores.json has no '{row.name}': write it with tests/load/labs.py stores")
    text = page(about, runs_of, ceiling_of((given.results / "ingest.md").read_text(encoding="utf-8")))
    (given.results / "load_scale.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
