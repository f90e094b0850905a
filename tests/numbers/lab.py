"""The programs under test: needlelab-admin on a stopped folder or a running server, the server itself, its web interface."""
import json
import os
import pathlib
import re
import shutil
import sqlite3
import ssl
import subprocess
import sys
import urllib.error
import urllib.request
from http.cookiejar import CookieJar

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from programs import Failed as Broken, start, stop  # noqa: E402


def run(arguments, zone, timeout=120):
    environment = dict(os.environ, TZ=zone, LC_ALL="C.UTF-8")
    environment.pop("DISPLAY", None)
    done = subprocess.run([str(a) for a in arguments], env=environment, capture_output=True, text=True, timeout=timeout)
    if done.returncode != 0:
        raise Broken(f"{' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stderr[-2000:]}")
    return done


def table(text):
    """The rows of a table made for people: title -> cell. The columns begin where their titles do; the last one may have none ("")."""
    lines = text.splitlines()
    starts = [(m.start(), m[0]) for m in re.finditer(r"\S+(?: \S+)*", lines[0])]
    if lines[0].endswith("  "):
        starts.append((len(lines[0]), ""))
    rows = []
    for line in lines[1:]:
        if not line.strip():
            break
        ends = [at for at, _ in starts[1:]] + [None]
        rows.append({title: line[at:end].strip() for (at, title), end in zip(starts, ends)})
    return rows


def pairs(text):
    """"session   01a2…" lines: name -> value; ends at the first empty line."""
    found = {}
    for line in text.splitlines():
        if not line.strip():
            break
        name, _, value = re.match(r"(\S+(?: \S+)*)(  +)(.*)", line).groups()
        found[name] = value.strip()
    return found


class Lab:
    """A copy of a class's folder (deploy/demo --class), so that the original does not change."""

    def __init__(self, class_folder, bin_folder, folder):
        self.bin, self.folder = pathlib.Path(bin_folder), pathlib.Path(folder)
        self.data = self.folder / "server"
        shutil.copytree(class_folder, self.folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("spool*", "backup.db", "*.log"))
        self.process = None

    def settle(self):
        """Opens and closes the stopped server's database, so that its log is merged into the file, and the file has its stated size."""
        self.admin("check")
        db = sqlite3.connect(self.database())
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        db.close()

    def database(self):
        return self.data / "needlelab.db"

    def _peer(self):
        return ["--server", f"127.0.0.1:{(self.folder / 'port').read_text().strip()}", "--ca", self.data / "tls" / "ca.crt"]

    def _person(self, name):
        return ["--user", name, "--password-file", self.folder / f"{name}.password"]

    def admin(self, *arguments, zone="UTC0", who=None):
        """A command's output: on the stopped folder, or as `who` on the running server."""
        head = [self.bin / "needlelab-admin", *(self._peer() + self._person(who) if who else ["--data", self.data])]
        return run([*head, *arguments], zone)

    def admin_rows(self, *arguments, who=None):
        return json.loads(self.admin(*arguments, "--json", who=who).stdout)["rows"]

    def instructor(self, *arguments, zone="UTC0", who="ines"):
        return run([self.bin / "needlelab-instructor", *self._peer(), *self._person(who), *arguments], zone)

    def station(self, name, *arguments, zone="UTC0"):
        return run([self.bin / "needlelab-station", *self._peer(), "--key", self.folder / f"{name}.key", *arguments], zone)

    def start(self):
        files = [self.folder / "port", self.folder / "web-port"]
        try:
            with open(self.folder / "server.log", "wb") as log:
                self.process = start([self.bin / "needlelab-server", "--data", self.data, "--listen", "127.0.0.1:0", "--port-file", files[0], "--web", "127.0.0.1:0",
                                      "--web-port-file", files[1], "--web-root", self.folder], files, log, dict(os.environ, TZ="UTC0"))
        except Broken as error:
            raise Broken(f"{error}: " + (self.folder / "server.log").read_text()[-2000:]) from None

    def stop(self):
        process, self.process = self.process, None
        if process is not None:
            stop(process)

    def browser(self, who):
        return Browser(self, who)


class Browser:
    """A person's log-in at the web interface."""

    def __init__(self, lab, who):
        port = (lab.folder / "web-port").read_text().strip()
        self.base = f"https://127.0.0.1:{port}/api/v1"
        context = ssl.create_default_context(cafile=str(lab.data / "tls" / "ca.crt"))
        self.opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), urllib.request.HTTPSHandler(context=context),
                                                  urllib.request.HTTPCookieProcessor(CookieJar()))
        password = (lab.folder / f"{who}.password").read_text().splitlines()[0]
        self.text("/session", json.dumps({"name": who, "password": password}).encode())

    def text(self, path, body=None):
        return self.bytes(path, body).decode()

    def bytes(self, path, body=None):
        request = urllib.request.Request(self.base + path, data=body, headers={"Content-Type": "application/json"} if body else {})
        try:
            with self.opener.open(request, timeout=60) as reply:
                return reply.read()
        except urllib.error.HTTPError as error:
            raise Broken(f"GET {path}: {error.code} {error.read()[:300]}") from None

    def json(self, path):
        return json.loads(self.text(path))

    def items(self, path):
        """All pages of a list."""
        rows, page = [], ""
        while True:
            mark = "&" if "?" in path else "?"
            reply = self.json(path + (f"{mark}page={page}" if page else ""))
            rows += reply["items"]
            page = reply.get("next_page", "")
            if not page:
                return rows
