"""The pieces of deploy/nightly: what each runs, what it shows, and which numbers of its output are kept."""
import dataclasses
import re


@dataclasses.dataclass(frozen=True)
class Number:
    """What matters in a piece's output: `pattern`'s only group in its last match, the sum or the greatest over all matches, or
    the number of matches."""
    name: str
    pattern: str
    how: str = "last"

    def of(self, text):
        found = re.findall(self.pattern, text, re.MULTILINE)
        if self.how == "count":
            return len(found)
        if not found:
            return None
        if self.how == "last" and not re.fullmatch(r"[-+]?\d+(\.\d+)?", found[-1]):
            return found[-1]
        numbers = [float(one) for one in ([found[-1]] if self.how == "last" else found)]
        number = max(numbers) if self.how == "max" else sum(numbers)
        return int(number) if number == int(number) else round(number, 3)


@dataclasses.dataclass(frozen=True)
class Piece:
    """A line of `commands` is a command; {bin}, {fuzz}, {build}, {source}, {out} are folders. `programs` are those of {bin}
    that the commands start without naming them."""
    name: str
    minutes: float
    proves: str
    commands: tuple
    numbers: tuple = ()
    programs: tuple = ()
    targets: tuple = ()  # built beside the programs, with a build of its own
    rows: str = ""  # the first heading of a table in Markdown that the commands print; its rows are kept

    def needs(self):
        """The programs of {bin}."""
        return sorted(set(re.findall(r"\{bin\}/([\w-]+)", " ".join(self.commands))) | set(self.programs))

    def fuzzes(self):
        """It runs what another build made, perhaps of other sources."""
        return any("{fuzz}" in command for command in self.commands)


LIBRARIES = ("needlelab", "needlelab-haptics")
LAB = ("needlelab-admin", "needlelab-server", "needlelab-station")
DURABILITY = ("needlelab-admin", "needlelab-durability-server", "needlelab-durability-station")
CUTS = (Number("power cuts", r"runs, (\d+) cuts", "sum"), Number("disk states judged", r"(\d+) outcomes", "sum"),
        Number("bad", r"^(?!with ).*, bad in (\d+)$", "sum"))
MEMORY = tuple(Number(f"KiB/min of the {name}", rf"^memory of the {name}, growth after .*? s +(\S+ ± \S+) ")
               for name in ("server", "station", "viewer"))
PASSIVITY = ("CounterExampleFile.*:Observer.*:PassivityControlCases.*:RandomEnergy*:RandomGesture.*:Regressions.*:RoundNumber.*:"
             "Shrink*:ToolGestures.*")
TESTS = Number("tests passed", r"^\[  PASSED  \] (\d+) test", "sum")


def fuzz(name, minutes, what, *targets):
    """10 min of processor time for each; half as long by the clock on two cores."""
    only = " ".join(f"--only {target}" for target in targets)
    return Piece(f"fuzz-{name}", minutes, f"10 min each of {what}", (f"{{source}}/tests/fuzz/run --bin {{fuzz}}/bin {only}",),
                 (Number("inputs tried", r"^\w+: (\d+) runs in", "sum"),))


def attacks(name, minutes, what, scenarios):
    """Scenarios of tests/faculty under 50 stations; all of them take longer than a piece may."""
    p90 = r"again \d+\.\d / (\d+\.\d) s, away"
    return Piece(f"faculty-{name}", minutes, f"50 stations: {what}",
                 (f"python3 -B {{source}}/tests/faculty/attacks_test.py {{bin}} --long --seed 21 {scenarios}",),
                 (Number("seed", r"^seed (\d+)"), Number("labs", r"^(\d+) labs played"), Number("planted faults caught", r"(\d+) planted faults caught"),
                  Number("chunks acknowledged", r"(\d+) chunks acknowledged", "sum"), Number("samples compared", r"(\d+) samples compared", "sum"),
                  Number("s until stations stream again, the slowest lab's p90", r"stations " + p90, "max"),
                  Number("s until people see again, the slowest lab's p90", r"viewers " + p90, "max")),
                 (*DURABILITY, "needlelab-instructor", "needlelab_clock_shim"), "scenario")


PIECES = (
    Piece("kills", 2, "100 kills of a server and 100 of stations lose nothing",
          ("python3 -B {source}/tests/durability/harness/campaign.py --bin {bin} --kills 100 --station-kills 100",),
          (Number("kills of the server", r"^(\d+) kills of the server"),
           Number("within a commit or checkpoint", r"server, (\d+) of them within"),
           Number("kills of stations", r"checkpoint; (\d+) of stations"),
           Number("samples compared", r"acknowledged, (\d+) samples")), DURABILITY),
    Piece("histories", 4, "60 random histories of kills, backups, restores lose nothing",
          ("python3 -B {source}/tests/durability/harness/histories.py --bin {bin} --count 60 --steps 12",),
          (Number("histories", r"^history \d+: \d+ steps, no fault", "count"),
           Number("steps", r"^history \d+: (\d+) steps, no fault", "sum")), DURABILITY),
    Piece("postgres-faults", 22, "faults of PostgreSQL, alone and under two-disks, lose nothing acknowledged",
          ("python3 -B {source}/tests/postgres/faults/faults_test.py {bin} --long --seed 20",),
          (Number("seed", r"^seed (\d+)"), Number("labs", r"^(\d+) labs played"), Number("planted faults caught", r"(\d+) planted faults caught"),
           Number("power cuts", r"^(\d+) power cuts below", "sum"),
           Number("chunks acknowledged", r"(\d+) chunks acknowledged", "sum"), Number("samples compared", r"(\d+) samples compared", "sum")),
          (*DURABILITY, "needlelab-load", "needlelab_cut_shim"), "scenario"),
    Piece("offline-kills", 7, "200 kills of a station lose only its last moment",
          ("{bin}/integration_test --gtest_filter=OfflineKillTest.*",),
          (Number("kills", r"^(\d+) kills, seeds"), Number("ms lost at most", r"median .* ms, most (\S+) ms")), LAB),
    Piece("power-cuts", 14, "thousands of power cuts lose nothing that was acknowledged",
          ("{bin}/powercut_test",), CUTS),
    Piece("full-disks", 5.5, "full and failing disks, jumping clocks, flipped bits spoil nothing",
          ("{bin}/diskfault_test",), (*CUTS, TESTS), ("needlelab-admin", "needlelab-server")),
    Piece("herd", 1, "1,000 stations reconnect at once after a kill",
          ("{bin}/netfaults_live_test --gtest_filter=HerdTest.aThousandStationsAreWholeAgainAfterAKill",),
          (Number("s until the median is whole", r"acknowledged\) after the server listens: median (\S+) s"),
           Number("s until the last is", r", last (\S+) s;")), LAB),
    Piece("mix", 3, "30 random bad networks lose and double nothing",
          ("{bin}/netfaults_test --gtest_filter=FaultMixTest.*",),
          (Number("rounds", r"^seed \d+: \d+ stations", "count"), Number("connections", r"stations, (\d+) connections", "sum"),
           Number("cut", r"connections, (\d+) cut", "sum"))),
    Piece("half-open", 1, "both ends notice a dead network within the real limits",
          ("{bin}/netfaults_test --gtest_filter=HalfOpenTest.bothEndsNoticeWithinTheRealLimits",),
          (Number("ms at the station", r"limit 30000 ms: .* station after (\d+) ms"),
           Number("ms at the server", r"limit 30000 ms: .* server after (\d+) ms"))),
    Piece("handshakes", 1, "silent strangers keep no station out",
          ("{bin}/handshake_bench",),
          (Number("log-ins", r"^\| \d+ \| \d+ \(\d+ refused\) \| (\d+) \|", "sum"),
           Number("% within 1 s from 2 addresses", r"^\| 2 \| .*? \| (\S+) % \|"),
           Number("% within 1 s from 20 addresses", r"^\| 20 \| .*? \| (\S+) % \|")), ("needlelab-server",)),
    Piece("namespaces", 1, "a pulled cable disturbs one station only",
          ("{source}/tests/netfaults/namespaces {bin}",), (Number("checks", r"^ok: ", "count"), Number("s until it counts as offline", r"go offline\n\s+after (\d+) s")),
          (*LAB, "needlelab-instructor")),
    Piece("soak", 32, "half an hour of a lesson: memory flat, nothing lost",
          ("{source}/tests/soak/run --minutes 30 --bin {bin} --out {out}",),
          (*MEMORY, Number("samples", r"^samples in the server's database +(\d+)")),
          ("needlelab-soak", "needlelab-load", *LAB, "needlelab-instructor")),
    Piece("soak-200", 31, "200 stations, lost connections, kills: nothing lost, memory flat",
          ("{bin}/needlelab-load --stations 200 --viewers 10 --seconds 1500 --faults --out {out}",),
          (Number("KiB/min of the server's live heap", r"^live heap of the server, growth after .*? s +(\S+ ± \S+) "),
           Number("KiB/min of its resident memory", r"^resident memory of the server, growth after .*? s +(\S+ ± \S+)"),
           Number("samples lost", r"^samples lost +(\d+)")), ("needlelab-load", "needlelab-server")),
    fuzz("network", 21, "messages, chunks of samples, live frames, what a browser asks", "envelope", "chunk", "live", "http"),
    fuzz("files", 31, "damaged recordings, spools, trajectories, patient profiles, curricula", "recording", "spool", "trajectory", "profile", "curriculum"),
    Piece("fuzz-planted", 2, "each fuzzer finds its planted fault",
          ("{source}/tests/fuzz/run --planted --bin {fuzz}/bin",), (Number("faults found", r"^\w+: found: ", "count"),)),
    Piece("systemd", 1, "install, kill, restart, backup under a real systemd",
          ("{source}/tests/operations/live_systemd {source} {build}",), (Number("checks", r"^ok: ", "count"),),
          (*LAB, "needlelab-instructor")),
    Piece("packages", 20, "packages in a bare Debian 12: install, a lesson, upgrade, versions apart, remove, purge",
          ("{source}/tests/operations/live_packages {source} {build}",),
          (Number("checks", r"^ok: ", "count"), Number("MB for a server", r"^needlelab-server: (\S+) MB"), Number("MB for a lesson", r"^needlelab: (\S+) MB"),
           Number("s from nothing to a scored lesson", r"scored lesson: (\d+) s"), Number("values equal from Python", r"^(\d+) values equal those")),
          (*LAB, "needlelab-instructor", "needlelab-sim"), (*LIBRARIES, "needlelab-python")),
    Piece("library-abi", 1, "the libraries have the interface that was committed",
          ("{source}/tests/library/abi {build}",), (Number("functions", r"^lib\S+: (\d+) functions", "sum"),), targets=LIBRARIES),
    Piece("fit", 22, "the law behind measured curves is named, where any one of its numbers differs between specimens",
          ("env NEEDLELAB_LONG=1 /usr/bin/python3 -B {source}/tests/library/fit_test.py --build {build}",),
          (Number("sets", r"^(\d+) sets, "), Number("answered wrongly", r" sets, (\d+) answered wrongly")), targets=(*LIBRARIES, "needlelab-python")),
    Piece("faculty", 3, "PostgreSQL as FACULTY.md says, on one machine and on three",
          ("{source}/tests/operations/live_faculty {source} {build}",), (Number("checks", r"^ok: ", "count"),),
          (*LAB, "needlelab-instructor")),
    attacks("attacks-kills", 11, "each of them killed twenty times, the primary with promotion", "server-killed primary-killed standby-killed nats-killed"),
    attacks("attacks-stops", 8, "a server, the primary, the standby, NATS stopped for 10 s", "server-stopped primary-stopped standby-stopped nats-stopped"),
    attacks("attacks-cuts", 9, "cut networks; a replaced primary that lives on",
            "server-from-postgres server-from-nats stations-from-server primary-deposed"),
    attacks("attacks", 6, "a deposed server, slow viewers, clocks nine hours apart, ended accesses, planted faults",
            "server-deposed slow-viewers clocks-apart presence access stop takeover-unfenced-planted revoked-token-honoured-planted "
            "epoch-ignored-planted presence-for-ever-planted"),
    Piece("faculty-haproxy", 1, "through HAProxy, stations and people are back within 5 s of a kill, 10 s of a hang",
          ("python3 -B {source}/tests/faculty/haproxy_test.py {bin} --long --seed 21",),
          (Number("samples compared", r"(\d+) samples compared"), Number("s until all are back after a kill", r"killed: .* sees all within (\d+\.\d) s"),
           Number("s after a server stood still", r"still: .* sees all within (\d+\.\d) s")), (*DURABILITY, "needlelab-instructor")),
    Piece("passivity", 7, "44,000 random gestures get no energy from the wall",
          ("{bin}/stability_test --gtest_filter=" + PASSIVITY,),
          (TESTS, Number("the wall's worst, in mJ", r"^the enhanced tracking wall: worst (\S+) mJ"))),
    Piece("hard-cases", 3, "the hard cases with ten times the hands",
          ("{bin}/stability_test --gtest_filter=-" + PASSIVITY,), (TESTS,)),
    Piece("engine", 4, "engine and measures against references, many more gestures",
          ("{bin}/haptics_test", "{bin}/fem_test", "{bin}/scoring_test --gtest_filter=Invariance.*", "{bin}/profile_test --gtest_filter=SteeredPaths.*",
           "python3 -B {source}/tests/unit/common/profile/solids_test.py"), (TESTS,)),
    Piece("reader", 4, "a stranger who only reads the screen passes a first lesson in each region",
          ("{bin}/windows_test --gtest_filter=*Reader.passes*",), (TESTS,), ("needlelab-admin", "needlelab-server", "needlelab-station")),
    Piece("pictures", 6, "the pictures of client/sim show what its studies print",
          ("{source}/client/sim/pictures/draw --check {bin}/needlelab-sim",),
          (Number("columns compared", r"^(\d+) columns compared"), Number("changed", r"columns compared, (\d+) changed"))),
    Piece("virtuose-worlds", 4, "100,000 simulated lessons with a Virtuose in trouble keep the rules",
          ("{bin}/device_world_test --gtest_filter=VirtuoseSeeds.*",), (TESTS,)),
    Piece("falcon-worlds", 20, "200,000 simulated lessons with a Falcon in trouble keep the rules",
          ("{bin}/device_world_test --gtest_filter=FalconSeeds.*",), (TESTS,)),
    Piece("falcon-plugs", 1, "a Falcon that is unplugged 1,000 times comes back and leaks nothing",
          ("{source}/tests/support/falcon_emulator/mocked_usb.sh {bin}/falcon_usb_test --gtest_filter=FalconUsbSmoke.unpluggedAndPluggedInAgainItReportsAndLeaksNothing",
           "{source}/tests/support/falcon_emulator/mocked_usb.sh {bin}/falcon_station_test --gtest_filter=FalconUsbStation.aCrash*"), (TESTS,)),
    Piece("isolation", 5, "interleaved statements of two servers on PostgreSQL act as one after the other",
          ("{source}/tests/postgres/cluster run /tmp/needlelab-pg-nightly {bin}/postgres_isolation_test",), (TESTS,)),
    Piece("second-engine", 16, "what deploy/test leaves out on PostgreSQL, in short form",
          ("env -u NEEDLELAB_LONG ctest --test-dir {build} -C Long -R _on_postgres$|^postgres_|^faculty_attacks$|^faculty_haproxy$ --output-on-failure",),
          (Number("programs passed", r"tests passed, \d+ tests failed out of (\d+)"),),
          (*DURABILITY, "db_test", "http_net_test", "load_test", "postgres_durable_test", "postgres_isolation_test", "postgres_servers_test",
           "postgres_test", "security_test", "server_net_test", "service_records_test", "service_test")),
    Piece("data", 8, "10,000 mutants of each format crash nothing; sums stay those of a full count; a tick costs what it cost",
          ("{bin}/fuzz_test", "{bin}/service_test --gtest_filter=AttemptSumsTest.*", "{bin}/sim_test --gtest_filter=MeasureCosts.*"), (TESTS,)),
    Piece("numbers", 8, "every number of a class in commands, exports and web addresses equals the database's",
          ("env NEEDLELAB_CLASS_OUT={out} NEEDLELAB_CLASS_COURSE=injection-steps {source}/deploy/demo --class --once --bin {bin}",
           "python3 -B {source}/tests/numbers/numbers_test.py --bin {bin} --class {out} --sessions 24 --all"),
          (Number("comparisons", r"^(\d+) comparisons of"), Number("kinds of numbers", r"^\d+ comparisons of (\d+) kinds")),
          (*LAB, "needlelab-instructor", "needlelab-class", "needlelab-sim")),
    Piece("spreadsheet", 1, "LibreOffice opens a course's results with each separator",
          ("python3 -B {source}/tests/numbers/libreoffice_test.py --bin {bin} --out {out}",),
          (Number("comparisons", r"^(\d+) comparisons in"), Number("sheets", r"^\d+ comparisons in (\d+) sheets")),
          (*LAB, "needlelab-instructor", "needlelab-class", "needlelab-sim")),
    Piece("files", 3, "h5py, h5dump, h5wasm and bids-validator read what needlelab-admin writes for them",
          ("env NEEDLELAB_CLASS_OUT={out} NEEDLELAB_CLASS_COURSE=injection-steps {source}/deploy/demo --class --once --small --bin {bin}",
           "/usr/bin/python3 -B {source}/tests/numbers/files_test.py --bin {bin} --class {out} --npm"),
          (Number("values compared", r"^(\d+) values, "), Number("comparisons", r"values, (\d+) comparisons"),
           Number("of the CSV's bytes at most", r"^HDF5 takes \S+ to (\S+) of the CSV")),
          (*LAB, "needlelab-instructor", "needlelab-class", "needlelab-sim")),
    Piece("console-large", 8, "the console's pages with 3,000 people and 120,000 sessions, on both stores",
          ("{source}/tests/web/console/walk_large {bin}",),
          (Number("pages walked", r"^pages walked: (\d+)", "sum"), Number("ms until the slowest has its content", r"content after (\d+) ms", "max"),
           Number("s to build the slower database", r"^built in (\d+) s", "max")), ("lists_bench", *LAB)),
    Piece("lab", 4, "floods, 500 closes at once, an hour as CSV",
          ("{bin}/security_test --gtest_filter=Flood.*",
           "{bin}/server_net_test --gtest_filter=ConnectionLogin.doesNotWaitForTheScoresOfManySessions",
           "{bin}/http_net_test --gtest_filter=WebLessons.aLongCsvTakesConstantMemoryForASlowReader",
           "{bin}/admin_test --gtest_filter=ExportMemory.*",
           "{bin}/integration_test --gtest_filter=LessonTest.theStationIsKilledManyTimesAndNothingIsLostOrDoubled"), (TESTS,), LAB),
)
