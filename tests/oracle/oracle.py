#!/usr/bin/env python3
"""Writes what a change that only deletes or merges must not change, a file for each subject; two runs are compared by `diff -r`.

usage: oracle.py BIN OUT [--without-postgres]

golden.csv       the engine's hashes (tests/determinism)
openapi.json     the web port's description
messages.txt     every Protobuf message, field and number
help/            the help of every program and subcommand
stability.json   every hard case's measures
lab-sqlite/, lab-postgres/  what a seeded lab answers, by needlelab-admin --json and needlelab-class
Ids, times and durations are masked. Reference pictures and the judge's ledgers are held by their own tests. The two folders of labs are equal, which is checked here.
"""
import argparse
import filecmp
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE.parent / "postgres/faults"))
from clusters import Cluster, run, until  # noqa: E402

PROGRAMS = ["admin", "class", "instructor", "load", "server", "sim", "soak", "station"]
MASKS = [(re.compile(r"\b[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}\b"), "UUID"),
         (re.compile(r"\b\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)"), "TIME"),
         (re.compile(r"\b1[789]\d{8}\b"), "TIME"),
         (re.compile(r"\b[0-9a-f]{32,}\b"), "HASH")]
# for the seeded lab's sessions: what depends on the run's clock
TIMES = re.compile(r"unix_ns|_at$|^at$|received|started|closed|stored_bytes|offset|last_seen")
EXERCISES = ["shoulder-bursa", "knee-recess"]


def masked(text):
    for pattern, word in MASKS:
        text = pattern.sub(word, text)
    return text


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(inner) for key, inner in value.items() if not TIMES.search(key)}
    if isinstance(value, list):
        return sorted((without_times(inner) for inner in value), key=lambda one: json.dumps(one, sort_keys=True))
    return value


def said(*command):
    return subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True).stdout


def write_help(program, words, out):
    text = said(program, *words, "--help")
    name = "-".join([program.name.removeprefix("needlelab-"), *words])
    (out / f"{name}.txt").write_text(text.replace(str(program), program.name))
    listed = text.partition("\nSubcommands:\n")[2]
    for word in re.findall(r"^  ([a-z][a-z-]*)(?= {2}|$)", listed, re.MULTILINE):
        write_help(program, [*words, word], out)


class Lab:
    """People, stations, patients and a course by needlelab-admin; a server; lessons by needlelab-class."""

    def __init__(self, bin_folder, folder, url=None):
        self.bin, self.folder = bin_folder, folder
        folder.mkdir()
        self.password = folder / "password"
        self.password.write_text("correct horse battery 15\n")
        self.password.chmod(0o600)
        self.data = folder / "data"
        self.store = ["--store", url] if url else []

    def admin(self, *words):
        store, self.store = self.store, []
        return said(self.bin / "needlelab-admin", "--data", self.data, *store, *words)

    def fill(self):
        self.admin("user", "add", "ada", "--role", "administrator", "--password-file", self.password)
        for name in ("tina", "tom"):
            self.admin("user", "add", name, "--role", "trainee", "--password-file", self.password)
        self.admin("user", "add", "ina", "--role", "instructor", "--password-file", self.password)
        for name in ("north", "south"):
            self.admin("station", "add", name, "--out", self.folder / f"{name}.key")
        samples = ROOT / "db/samples"
        for path in sorted(samples.glob("*.json")):
            self.admin("curriculum" if "curriculum" in path.name else "profile", "import", path)

    def practise(self, seed):
        ready = self.folder / "port"
        with subprocess.Popen([self.bin / "needlelab-server", "--data", self.data, "--listen", "127.0.0.1:0", "--port-file", ready, "--web", "off"],
                              stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server:
            try:
                until(ready.exists, "the server starts", 300)
                keys = [self.folder / f"{name}.key" for name in ("north", "south")]
                run(self.bin / "needlelab-class", "--server", f"127.0.0.1:{ready.read_text().strip()}", "--ca", self.data / "tls/ca.crt",
                    *(word for key in keys for word in ("--key", key)), "--trainee", "tina=0.4", "--trainee", "tom=0.8",
                    *(word for one in EXERCISES for word in ("--exercise", one)), "--attempts", "2", "--seed", seed, "--spool", self.folder / "spool",
                    "--out", self.folder / "class.csv")
            finally:
                server.terminate()
                if server.wait(300) != 0:
                    raise SystemExit(f"the server ended with {server.returncode}")

    def write(self, out):
        out.mkdir()
        lines = [json.dumps(without_times(json.loads(line)), sort_keys=True) for line in self.admin("export-all").splitlines()
                 if not line.startswith('{"kind":"end"')]
        (out / "everything.jsonl").write_text(masked("\n".join(sorted(map(masked, lines))) + "\n"))
        for name, words in {"sessions": ["session", "list"], "users": ["user", "list"], "stations": ["station", "list"], "profiles": ["profile", "list"],
                            "curriculum": ["curriculum", "list"], "progress": ["progress", "tina"]}.items():
            told = without_times(json.loads(self.admin(*words, "--json")))
            (out / f"{name}.json").write_text(masked(json.dumps(told, indent=1, sort_keys=True)) + "\n")
        (out / "verify.txt").write_text(masked(self.admin("check")))
        (out / "class.csv").write_text("\n".join(sorted(masked((self.folder / "class.csv").read_text()).splitlines())) + "\n")


def write_lab(bin_folder, scratch, out, url=None):
    lab = Lab(bin_folder, scratch / out.name, url)
    lab.fill()
    lab.practise(7)
    lab.write(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--without-postgres", action="store_true")
    given = parser.parse_args()
    bin_folder, out = given.bin.resolve(), given.out
    out.mkdir(parents=True)
    step = time.monotonic()

    def done(what):
        nonlocal step
        print(f"{what}: {time.monotonic() - step:.0f} s", file=sys.stderr)
        step = time.monotonic()

    subprocess.run([bin_folder / "determinism_test", "--gtest_brief=1"], check=True, stdout=subprocess.DEVNULL,
                   env={**os.environ, "NEEDLELAB_GOLDEN_OUT": str((out / "golden.csv").resolve())})
    done("golden hashes")
    (out / "openapi.json").write_text(said(bin_folder / "needlelab-server", "--openapi"))
    files = sorted((ROOT / "proto").rglob("*.proto"))
    (out / "messages.txt").write_text("\n".join(f"{path.name}\n" + re.sub(r"\s*//.*", "", path.read_text()) for path in files))
    (out / "help").mkdir()
    for name in PROGRAMS:
        write_help(bin_folder / f"needlelab-{name}", [], out / "help")
    done("help")
    (out / "stability.json").write_text(said(bin_folder / "needlelab-sim", "stability", "--json"))
    done("hard cases")
    with tempfile.TemporaryDirectory(prefix="nl-oracle-", dir="/tmp") as name:
        scratch = pathlib.Path(name)
        scratch.chmod(0o755)
        write_lab(bin_folder, scratch, out / "lab-sqlite")
        done("lab on SQLite")
        if not given.without_postgres:
            cluster = Cluster(scratch / "p")
            cluster.make()
            try:
                write_lab(bin_folder, scratch, out / "lab-postgres", f"postgresql://needlelab@/lab?host={cluster.folder}")
            finally:
                cluster.kill()
            done("lab on PostgreSQL")
    if not given.without_postgres:
        same = filecmp.cmpfiles(out / "lab-sqlite", out / "lab-postgres", os.listdir(out / "lab-sqlite"), shallow=False)
        if same[1] or same[2]:
            print(f"the engines' labs differ: {' '.join(same[1] + same[2])}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
