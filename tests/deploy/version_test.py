#!/usr/bin/env python3
"""deploy/cmake/NeedlelabVersion.cmake: a clone, a changed clone and an archive of it say which commit they are; a bare folder only the number."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(sys.argv.pop(1))


def run(folder, *command):
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, encoding="utf-8")


def version(folder):
    return run(folder, "cmake", "-D", f"SOURCE={folder}", "-D", "NUMBER=1.0.0", "-P", ROOT / "deploy/cmake/NeedlelabVersion.cmake").stderr.strip()


class Version(unittest.TestCase):
    def test_names_the_commit(self):
        scratch = tempfile.TemporaryDirectory(prefix="needlelab-version-")
        self.addCleanup(scratch.cleanup)
        clone, archive = (pathlib.Path(scratch.name, name) for name in ("clone", "archive"))
        (clone / "deploy").mkdir(parents=True)
        archive.mkdir()
        shutil.copy(ROOT / "deploy/version.txt", clone / "deploy")
        shutil.copy(ROOT / ".gitattributes", clone)
        (clone / "CMakeLists.txt").write_text("project(needlelab)\n", encoding="ascii")
        self.assertEqual(version(clone), "1.0.0", "no git, no archive")

        git = ("git", "-c", "user.name=a", "-c", "user.email=a@b")
        run(clone, *git, "init", "--quiet")
        run(clone, *git, "add", "-A")
        run(clone, *git, "commit", "--quiet", "-m", "first", "--date", "2026-11-29T12:00:00Z")
        commit = run(clone, "git", "log", "-1", "--format=%cd.%H", "--date=format:%Y%m%d").stdout
        named = "1.0.0~git" + commit[:8 + 1 + 8]
        self.assertEqual(version(clone), named)
        subprocess.run("git archive HEAD | tar -x -C ../archive", shell=True, cwd=clone, check=True)
        self.assertEqual(version(archive), named)
        (clone / "CMakeLists.txt").write_text("project(other)\n", encoding="ascii")
        self.assertEqual(version(clone), named + "+changed")


if __name__ == "__main__":
    unittest.main()
