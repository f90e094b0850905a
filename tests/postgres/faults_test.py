#!/usr/bin/env python3
"""Stations stream to a server whose PostgreSQL is killed, stopped for a while, and restarted: nothing acknowledged is lost or doubled.

usage: faults_test.py BIN [--seconds N] [--stations N] [--seed N]

The judge is needlelab-load: it compares every stored sample with what was generated, and its exit code is 0 only if nothing is lost,
doubled or different. The server must live through it all, say while PostgreSQL is gone that it cannot store, and be healthy afterwards.
Without PostgreSQL 15 it says so and exits with 77.
"""
import argparse
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

CLUSTER = pathlib.Path(__file__).resolve().parent / "cluster"
PG = "/usr/lib/postgresql/15/bin"
PASSWORD = "correct horse battery 15"


def run(*arguments):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, timeout=120)
    if done.returncode != 0:
        sys.exit(f"faults_test: {' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


class Postgres:
    """A cluster that keeps its promises (fsync), with one database of the lab's."""

    def __init__(self, folder):
        self.folder = folder
        run(CLUSTER, "start", folder, "durable")
        run(f"{PG}/psql", "-h", folder, "-U", "needlelab", "-d", "postgres", "-qc",
            "CREATE DATABASE lab TEMPLATE template0 ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C'")
        self.url = f"postgresql://needlelab@/lab?host={folder}"

    def postmaster(self):
        return int((pathlib.Path(self.folder) / "data/postmaster.pid").read_text().split()[0])

    def everybody(self):
        """The postmaster and its children."""
        parent = self.postmaster()
        return [parent] + [int(p) for p in run("ps", "-o", "pid=", "--ppid", parent).split()]

    def kill(self):
        gone = self.everybody()
        os.kill(gone[0], signal.SIGKILL)
        # its children see it and end: before that a new one is refused
        while any(pathlib.Path(f"/proc/{pid}").exists() for pid in gone):
            time.sleep(0.02)

    def start(self):
        self.pg_ctl("-l", f"{self.folder}/log", "-o", f"-k {self.folder} -c listen_addresses= -c max_connections=300 -c shared_buffers=64MB", "start")

    def pg_ctl(self, *arguments):
        as_user = ["setpriv", "--reuid", "postgres", "--regid", "postgres", "--clear-groups"] if os.getuid() == 0 else []
        subprocess.run([*as_user, f"{PG}/pg_ctl", "-D", f"{self.folder}/data", "-w", *arguments], cwd="/", check=True, stdout=subprocess.DEVNULL,
                       timeout=120)

    def pause(self, seconds):
        stopped = self.everybody()
        for pid in stopped:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(seconds)
        for pid in stopped:
            try:
                os.kill(pid, signal.SIGCONT)
            except ProcessLookupError:
                pass

    def restart(self):
        self.pg_ctl("-m", "fast", "stop")
        self.start()


def health(port):
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=10) as answer:
            return json.load(answer)
    except urllib.error.HTTPError as refused:
        return json.load(refused)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--stations", type=int, default=12)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    given = parser.parse_args()
    if not os.access(f"{PG}/initdb", os.X_OK):
        print("PostgreSQL 15 is not installed; deploy/setup installs it")
        return 77
    print(f"seed {given.seed}")
    dice = random.Random(given.seed)
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="nl-pg-"))
    scratch.chmod(0o755)  # the user postgres goes through it
    postgres, server = None, None
    try:
        postgres = Postgres(f"{scratch}/c")
        (scratch / "password").write_text(PASSWORD + "\n")
        (scratch / "password").chmod(0o600)
        data = scratch / "data"
        run(given.bin / "needlelab-admin", "--data", data, "--store", postgres.url, "user", "add", "ada", "--role", "administrator",
            "--password-file", scratch / "password")
        log = open(scratch / "server.log", "w", encoding="utf-8")
        server = subprocess.Popen([given.bin / "needlelab-server", "--data", data, "--listen", "127.0.0.1:0", "--port-file", scratch / "port",
                                   "--metrics", "0", "--metrics-port-file", scratch / "metrics", "--web", "off", "--durability", "power-cut"],
                                  stdout=log, stderr=log)
        while not (scratch / "port").exists():
            if server.poll() is not None:
                sys.exit("faults_test: the server ended:\n" + (scratch / "server.log").read_text())
            time.sleep(0.05)
        port, metrics = (scratch / "port").read_text().strip(), (scratch / "metrics").read_text().strip()
        found = health(metrics)
        assert found["healthy"] and found["ack_survives"] == "a power cut", found
        load = subprocess.Popen([given.bin / "needlelab-load", "--stations", str(given.stations), "--seconds", str(given.seconds), "--viewers", "0",
                                 "--server", f"127.0.0.1:{port}", "--ca", data / "tls/ca.crt", "--user", "ada", "--password-file", scratch / "password",
                                 "--quiet", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        faults = []
        end = time.monotonic() + given.seconds
        time.sleep(given.seconds * 0.2)
        while time.monotonic() < end and load.poll() is None:
            fault = ["kill", "restart", "pause"][len(faults) % 3]
            if fault == "kill":
                postgres.kill()
                gone = health(metrics)
                assert not gone["healthy"], gone
                postgres.start()
            elif fault == "restart":
                postgres.restart()
            else:
                postgres.pause(dice.uniform(0.5, 2))
            faults.append(fault)
            time.sleep(dice.uniform(0.3, given.seconds * 0.15))
        out, err = load.communicate(timeout=300)
        print(f"faults: {faults}")
        print(out[-3000:])
        if load.returncode != 0 or len(faults) < 2:
            print(err[-3000:], (scratch / "server.log").read_text()[-3000:], sep="\n", file=sys.stderr)
            return 1
        found = health(metrics)
        assert found["healthy"], found
        assert server.poll() is None, "the server ended"
        check = json.loads(run(given.bin / "needlelab-admin", "--server", f"127.0.0.1:{port}", "--ca", data / "tls/ca.crt", "--user", "ada",
                               "--password-file", scratch / "password", "check", "--json"))
        assert check["rows"][0]["ok"], check
        server.send_signal(signal.SIGTERM)
        assert server.wait(timeout=60) == 0, "the server did not end in order"
        return 0
    finally:
        if server is not None and server.poll() is None:
            server.kill()
        if postgres is not None:
            subprocess.run([CLUSTER, "stop", postgres.folder], check=False)
        shutil.rmtree(scratch, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
