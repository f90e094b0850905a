#!/usr/bin/env python3
"""deploy/packages.txt, deploy/setup and deploy/Containerfile agree; --demo and --no-setup do what they promise."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(sys.argv.pop(1))
SETUP = ROOT / "deploy" / "setup"


def packages():
    """{name: group} from deploy/packages.txt; fails on a line in another form."""
    found = {}
    for line in (ROOT / "deploy" / "packages.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        words = re.fullmatch(r"([a-z0-9.+-]+) +(demo|faculty|test|package|nightly)( +#.*)?", line)
        assert words, line
        assert words[1] not in found, f"{words[1]} stands twice"
        found[words[1]] = words[2]
    return found


def listed(*arguments):
    return subprocess.run([SETUP, *arguments, "--list"], capture_output=True, encoding="utf-8", check=True).stdout.split()


class OtherSystem:
    """A folder of commands for PATH: those that the scripts themselves need, and `more`; no dpkg, no apt."""

    def __init__(self, test, *more):
        self.folder = tempfile.TemporaryDirectory(prefix="needlelab-other-system-")
        test.addCleanup(self.folder.cleanup)
        for name in ("bash", "env", "sed", "awk", "cmp", "date", "df", "dirname", "basename", "grep", "id", "mkdir", "mktemp",
                     "nproc", "rm", "sh", "tail", "tr"):
            os.symlink(shutil.which(name), f"{self.folder.name}/{name}")
        for name in more:
            self.add(name, "")

    def add(self, name, script):
        pathlib.Path(self.folder.name, name).write_text("#!/bin/sh\n" + script, encoding="ascii")
        os.chmod(f"{self.folder.name}/{name}", 0o755)

    def run(self, *arguments, script=SETUP):
        done = subprocess.run([script, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
                              env={"PATH": self.folder.name}, check=False)
        return done.returncode, done.stdout


class Setup(unittest.TestCase):
    def test_lists_the_packages_of_the_demo_with_those_of_the_tests_and_with_those_of_the_fuzzers(self):
        wanted = packages()
        self.assertEqual(listed("--nightly"), list(wanted))
        self.assertEqual(listed(), [name for name, group in wanted.items() if group in ("demo", "faculty", "test")])
        self.assertEqual(listed("--package"), [name for name, group in wanted.items() if group in ("demo", "faculty", "package")])
        self.assertEqual(listed("--demo"), [name for name, group in wanted.items() if group == "demo"])
        self.assertEqual(listed("--faculty"), [name for name, group in wanted.items() if group in ("demo", "faculty")])

    def test_the_tests_do_without_what_shows_the_fuzzers_reach(self):
        self.assertIn("llvm-14", packages())
        self.assertNotIn("llvm-14", listed())

    def test_the_demo_needs_no_browser_no_node_no_postgresql_no_nats_and_no_test_library(self):
        heavy = {"chromium-headless-shell", "nodejs", "npm", "valgrind", "xvfb", "libgtest-dev", "libbenchmark-dev"}
        faculty = {"libpq-dev", "postgresql-15", "libnats-dev", "nats-server"}
        self.assertLessEqual(heavy | faculty, set(packages()))
        self.assertFalse((heavy | faculty) & set(listed("--demo")))
        self.assertFalse(heavy & set(listed("--faculty")))
        self.assertLessEqual(faculty, set(listed("--faculty")))

    def test_on_another_system_it_installs_nothing_and_the_check_names_what_is_missing(self):
        bare = OtherSystem(self)
        code, text = bare.run()
        self.assertEqual(code, 1)
        self.assertIn("not a Debian system", text)
        code, text = bare.run("--demo", "--check")
        self.assertEqual(code, 1)
        self.assertIn("not found: g++", text)
        self.assertNotIn("chromium", text)
        self.assertIn("not found: chromium", bare.run("--check")[1])
        complete = OtherSystem(self, "clang++", "g++", "cmake", "ninja", "pkg-config", "protoc", "gnuplot")
        self.assertEqual(complete.run("--demo", "--check"), (0, ""))

    def test_no_setup_goes_on_to_the_build_and_names_what_is_missing(self):
        with tempfile.TemporaryDirectory() as folder:  # a checkout that the scripts may write to
            shutil.copytree(ROOT / "deploy", f"{folder}/deploy")
            system = OtherSystem(self)
            system.add("cmake", 'echo "cmake was asked: $*"; exit 1\n')
            for script, preset in (("demo", "demo"), ("test", "quick")):
                code, text = system.run(script=f"{folder}/deploy/{script}")
                self.assertEqual(code, 1)
                self.assertIn("not a Debian system", text)
                self.assertNotIn("cmake was asked", text)
                code, text = system.run("--no-setup", script=f"{folder}/deploy/{script}")
                self.assertEqual(code, 1)
                self.assertIn("not found: g++", text)
                self.assertIn(f"cmake was asked: --preset {preset}", text)
                self.assertEqual("not found: chromium" in text, script == "test", text)

    def test_the_demo_keeps_a_build_with_tests(self):
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(ROOT / "deploy", f"{folder}/deploy")
            os.makedirs(f"{folder}/build/quick")
            pathlib.Path(folder, "build/quick/CMakeCache.txt").write_text("NEEDLELAB_BUILD_TESTS:BOOL=ON\n", encoding="ascii")
            system = OtherSystem(self)
            system.add("cmake", 'echo "cmake was asked: $*"; exit 1\n')
            self.assertIn("cmake was asked: --preset quick", system.run("--no-setup", script=f"{folder}/deploy/demo")[1])

    def test_a_wrong_argument_is_refused(self):
        self.assertEqual(subprocess.run([SETUP, "--dmeo"], capture_output=True, check=False).returncode, 1)


class Containerfile(unittest.TestCase):
    def test_its_packages_are_those_of_packages_txt(self):
        """It runs deploy/setup on Debian 12 after copying everything that setup reads, and installs nothing by itself."""
        lines = [line for line in (ROOT / "deploy" / "Containerfile").read_text(encoding="utf-8").splitlines()
                 if line and not line.startswith("#")]
        self.assertEqual([line for line in lines if line.startswith("FROM")], ["FROM debian:bookworm"])
        self.assertEqual([line for line in lines if line.startswith("RUN")], ["RUN deploy/setup"])
        before = lines[:lines.index("RUN deploy/setup")]
        copied = " ".join(line for line in before if line.startswith("COPY")).split()
        with tempfile.TemporaryDirectory() as folder:  # --list and the npm packages' lock file work with only these files
            for name in copied:
                if (ROOT / name).is_file():
                    target = pathlib.Path(folder, name)
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy2(ROOT / name, target)
            done = subprocess.run([f"{folder}/deploy/setup", "--list"], capture_output=True, encoding="utf-8", check=False)
            self.assertEqual(done.stdout.split(), listed(), done.stderr)
            self.assertTrue(pathlib.Path(folder, "tests/web/package-lock.json").exists())
        self.assertEqual(lines[-1], 'CMD ["deploy/test"]')


if __name__ == "__main__":
    unittest.main()
