#!/usr/bin/env python3
"""deploy/OPERATIONS.md, "A lab in 15 minutes": its ten steps in order, on this machine alone.

usage: ten_steps_test.py SOURCE_FOLDER BIN_FOLDER
The programs' commands run as they are written, at a terminal that types the passwords, with other names only: localhost for the lab's, folders of
the test's for the server's and the station's. Of what would change the machine (deploy/, sudo, systemctl, a firewall) files, options,
packages, units and ports are compared with the sources.
"""
import os
import pathlib
import pty
import re
import select
import signal
import ssl
import sys
import tempfile
import unittest
import urllib.request

ROOT, BIN = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
del sys.argv[1:3]
sys.path.insert(0, str(ROOT / "tests/support"))
from programs import PATIENCE_S, Failed, start, stop  # noqa: E402

PASSWORDS = {"ada": "a needle in the hay 1", "ines": "three blind mice 22"}


def steps():
    """[[block, …], …]: the commands of each step."""
    text = (ROOT / "deploy/OPERATIONS.md").read_text(encoding="utf-8").split("## A lab in 15 minutes\n")[1].split("\n## ")[0]
    parts = re.split(r"^(\d+)\. ", text, flags=re.MULTILINE)
    numbers = [int(number) for number in parts[1::2]]
    assert numbers == list(range(1, 11)), f"the steps are {numbers}"
    return [[re.sub("^ +", "", block, flags=re.MULTILINE).strip() for block in re.findall(r"^ *```\n(.*?)^ *```$", part, re.DOTALL | re.MULTILINE)]
            for part in parts[2::2]], text


def at_a_terminal(script, folder):
    """The script's output when a person types the passwords it asks for. Raises Failed if it fails."""
    child, terminal = pty.fork()
    if child == 0:
        environment = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}", "LC_ALL": "C.UTF-8"}
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):
            environment.pop(name, None)
        os.chdir(folder)
        os.execvpe("bash", ["bash", "-euc", script], environment)
    said, asked, who = "", 0, ""
    while True:
        if not select.select([terminal], [], [], PATIENCE_S)[0]:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise Failed(f"{script}: waits for something\n{said}")
        try:
            got = os.read(terminal, 4096).decode(errors="replace")
        except OSError:  # the other end is closed
            break
        if not got:
            break
        said += got
        question = re.search(r"(?:[Pp]assword of (\w+)|the same again): *$", said[asked:])
        if question:
            who, asked = question[1] or who, len(said)
            os.write(terminal, (PASSWORDS[who] + "\n").encode())
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    os.close(terminal)
    if code != 0:
        raise Failed(f"{script}: exit code {code}\n{said}")
    return said


class TenSteps(unittest.TestCase):
    def setUp(self):
        self.steps, self.text = steps()
        scratch = tempfile.TemporaryDirectory(prefix="needlelab-readme-")
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        self.port = self.web = None

    def here(self, script):
        """The same commands, with this test's names."""
        for was, now in (("sudo -u needlelab ", ""), ("sudo install", "install"), ("/var/lib/needlelab", f"{self.folder}/server"),
                         ("lab.example.org", f"localhost:{self.port}"), ("--enrolled", f"--enrolled {self.folder}/enrolled --headless --seconds 3 --spool {self.folder}/spool"),
                         ("--enrol station-1.enrol", f"--enrol station-1.enrol --enrolled {self.folder}/enrolled"),
                         ("--user ines", "--user ines --headless --seconds 2")):
            script = script.replace(was, now)
        return script

    def installs(self, block):
        """Checks that scripts, options and packages exist."""
        for name, words in re.findall(r"deploy/(\w+)([^&\n]*)", block):
            script = (ROOT / "deploy" / name).read_text(encoding="utf-8")
            for option in re.findall(r"--[a-z-]+", words):
                self.assertIn(f"{option})", script, f"deploy/{name} has no {option}")
        packages = re.findall(r"^Package: (\S+)$", (ROOT / "deploy/debian/control").read_text(encoding="utf-8"), re.MULTILINE)
        for package in re.findall(r"apt install (?:--\S+ )*(\S+)", block):
            self.assertIn(package, packages)

    def starts(self, options, command):
        units = re.findall(r"needlelab-\w+\.\w+", command)
        self.assertEqual(units, ["needlelab-server.socket", "needlelab-server.service", "needlelab-backup.timer"])
        for unit in units:
            self.assertTrue((ROOT / "deploy/systemd" / unit).exists(), unit)
        name, _, words = options.partition("=")
        self.assertIn(f"${name}", (ROOT / "deploy/systemd/needlelab-server.service").read_text(encoding="utf-8"))
        words = words.replace("lab.example.org", "localhost").replace("0.0.0.0:7751", "127.0.0.1:0").split()
        files = [self.folder / "port", self.folder / "web-port"]
        with open(self.folder / "server.log", "wb") as log:
            server = start([BIN / "needlelab-server", "--data", self.folder / "server", "--listen", "127.0.0.1:0", "--port-file", files[0], *words,
                            "--web-port-file", files[1], "--web-root", ROOT / "client/web"], files, log)
        self.addCleanup(stop, server)
        self.port, self.web = (file.read_text().strip() for file in files)

    def test_two_computers_have_a_lesson(self):
        install, administrator, names, ports, certificate, people, course, station, other, lesson = self.steps
        self.installs("\n".join(install + other[:1]))
        self.assertIn("added administrator 'ada'", at_a_terminal(self.here(administrator[0]), self.folder))
        self.starts(*names)
        listens = (ROOT / "deploy/systemd/needlelab-server.socket").read_text(encoding="utf-8")
        for line in ports[0].splitlines():
            self.assertEqual(re.findall(r"\b77\d\d\b", line.split("#")[0]), ["7750", "7751"], line)
        self.assertIn("ListenStream=7750\n", listens)
        at_a_terminal(self.here(certificate[0]), self.folder)
        variable = self.here(people[0].splitlines()[0]) + "\n"
        said = at_a_terminal(self.here(people[0]), self.folder)
        self.assertIn("added instructor 'ines'", said)
        self.assertIn("added trainee 'tom'", said)
        for block in (course[0], station[0]):
            at_a_terminal(variable + self.here(block), self.folder)
        for line in other[0].splitlines():
            if line.startswith("needlelab-"):
                at_a_terminal(self.here(line), self.folder)
        self.assertFalse((self.folder / "station-1.enrol").exists(), "the file with the key is removed")
        station_says, instructor_sees = (at_a_terminal(self.here(line), self.folder) for line in lesson[0].splitlines())
        self.assertIn("session COMPLETE", station_says)
        self.assertIn("station-1", instructor_sees)
        listed = at_a_terminal(variable + "needlelab-admin $lab session list", self.folder)
        self.assertRegex(listed, r"station-1 +tom +shoulder-median +complete")
        table = re.search(r"`(needlelab-admin \$lab results [^`]*)`", self.text)[1]
        at_a_terminal(variable + table, self.folder)
        self.assertIn("Person", (self.folder / "results.csv").read_text(encoding="utf-8"))
        self.assertIn("https://lab.example.org:7751", self.text)
        context = ssl.create_default_context(cafile=str(self.folder / "ca.crt"))
        with urllib.request.urlopen(f"https://localhost:{self.web}/", context=context, timeout=60) as page:
            self.assertIn(b"<title>", page.read())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v"])
