"""Shared by the Python harnesses: waiting, commands, servers and their reports, and the stations' ledgers."""
import argparse
import collections
import json
import os
import pathlib
import random
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

PATIENCE_S = 120  # a wait that reaches it is a hang
PG = pathlib.Path("/usr/lib/postgresql/15/bin")


class Failed(Exception):
    """The harness could not continue: something did not start, end or answer."""


def until(holds, what, seconds=PATIENCE_S, pause=0.02):
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            raise Failed(f"{what}: not within {seconds} s")
        time.sleep(pause)


def run(*arguments, text_in=None, environment=None, code=0):
    """The command's output; with another `code` also its errors. Raises Failed with both if the exit code differs."""
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, timeout=PATIENCE_S, input=text_in, cwd="/", check=False,
                          env={**os.environ, "HOME": "/", **(environment or {})})
    if done.returncode != code:
        raise Failed(f"{' '.join(map(str, arguments))}: exit code {done.returncode}, wanted {code}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr if code else done.stdout


def free_port():
    """A port below those that the system assigns to connections (32768 and above): a client of a dead server there could connect to itself."""
    while True:
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", random.SystemRandom().randrange(20_000, 32_000)))
            except OSError:
                continue
            return probe.getsockname()[1]


def start(command, files, log, environment=None, what="the server"):
    """Starts a program and waits for the files that it writes once it listens. `log`: an open file."""
    for file in files:
        file.unlink(missing_ok=True)
    process = subprocess.Popen([str(a) for a in command], env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log)  # pylint: disable=consider-using-with
    try:
        until(lambda: all(file.exists() and file.read_text().strip() for file in files) or process.poll() is not None, f"{what} starts")
        if process.poll() is not None:
            raise Failed(f"{what} ended with {process.returncode}")
    except BaseException:
        process.kill()
        process.wait()
        raise
    return process


def stop(process, what="the server"):
    """With SIGTERM; it must end cleanly."""
    process.terminate()
    if process.wait(PATIENCE_S) != 0:
        raise Failed(f"{what} ended with {process.returncode} at SIGTERM")


def fetched(port_file, path, host="127.0.0.1"):
    """(status, text) of a server monitor's answer."""
    try:
        with urllib.request.urlopen(f"http://{host}:{port_file.read_text().strip()}{path}", timeout=PATIENCE_S) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as refused:
        return refused.code, refused.read().decode()


def metric_in(text, name):
    found = re.search(rf"^{re.escape(name)} (\S+)$", text, re.MULTILINE)
    if found is None:
        raise Failed(f"the server has no metric {name}")
    return float(found[1])


class Monitored:
    """Requires `metrics_file`: the port of its server's --metrics."""

    def health(self):
        return json.loads(fetched(self.metrics_file, "/healthz")[1])

    def metric(self, name):
        return metric_in(fetched(self.metrics_file, "/metrics")[1], name)


class LedgerFolder:
    """Requires `folder`; its ledger/ contains the events recorded by stations and harness."""

    def __init__(self):
        (self.folder / "ledger").mkdir()
        self._read, self._counts = {}, collections.Counter()  # bytes by file, events by kind

    def note(self, **event):
        with open(self.folder / "ledger" / "harness.jsonl", "a", encoding="ascii") as file:
            file.write(json.dumps(event) + "\n")

    def count(self, kind):
        """The events of this kind ("s", "ack", "closed") in all stations' ledgers so far."""
        for path in (self.folder / "ledger").glob("station-*.jsonl"):
            with open(path, "rb") as file:
                file.seek(self._read.get(path, 0))
                data = file.read()
            data = data[:data.rfind(b"\n") + 1]
            self._read[path] = self._read.get(path, 0) + len(data)
            for name in ("s", "ack", "closed"):
                self._counts[name] += data.count(f'"e":"{name}"'.encode())
        return self._counts[kind]

    def wait_for_more(self, kind, count, seconds=PATIENCE_S):
        goal = self.count(kind) + count
        until(lambda: self.count(kind) >= goal, f"{count} more events '{kind}'", seconds)


def main_on_postgres(text, prefix, play):
    """main() of a test that takes the folder of the programs: `play(bin, scratch)`; 77 without PostgreSQL. `text`: for --help."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    given = parser.parse_args()
    if not os.access(PG / "initdb", os.X_OK):
        print("PostgreSQL 15 is not installed; deploy/setup installs it")
        return 77
    # a socket's path has at most 107 bytes, and the user postgres must be able to enter the folder
    scratch = pathlib.Path(tempfile.mkdtemp(prefix=prefix, dir="/tmp"))
    scratch.chmod(0o755)
    try:
        play(given.bin.resolve(), scratch)
        return 0
    except BaseException:
        for log in sorted([*scratch.rglob("*.log"), *scratch.rglob("log")]):
            print(f"--- {log.relative_to(scratch)}\n" + log.read_text(errors="replace")[-3000:], file=sys.stderr)
        raise
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
