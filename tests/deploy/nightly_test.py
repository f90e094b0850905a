#!/usr/bin/env python3
"""deploy/nightly: its table of pieces, its report of pieces that pass, fail, hang or cannot run, and the committed results."""
import contextlib
import dataclasses
import importlib.machinery
import importlib.util
import io
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(sys.argv.pop(1)).resolve()
sys.path.insert(0, str(ROOT / "deploy"))
import nightly_pieces  # noqa: E402


def nightly():
    """A fresh copy of the script, as a module."""
    loader = importlib.machinery.SourceFileLoader("nightly", str(ROOT / "deploy" / "nightly"))
    spec = importlib.util.spec_from_loader("nightly", loader)
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def gone(pid_file):
    """Whether the process has ended, or ends within a minute."""
    for _ in range(1200):
        try:
            if pathlib.Path("/proc", pid_file.read_text(encoding="ascii").strip(), "stat").read_text(encoding="ascii").split()[2] == "Z":
                return True
        except FileNotFoundError:
            return True
        time.sleep(0.05)
    return False


class Committed(unittest.TestCase):
    """The committed results in this folder."""

    def setUp(self):
        self.nightly = nightly()

    def test_no_piece_is_longer_than_35_minutes_and_all_fit_into_seven_hours(self):
        pieces = self.nightly.PIECES
        self.assertEqual(len({piece.name for piece in pieces}), len(pieces))
        for piece in pieces:
            self.assertLessEqual(piece.minutes, self.nightly.LIMIT_MIN, piece.name)
        self.assertLess(sum(piece.minutes for piece in pieces), 420)

    def test_every_program_and_every_test_that_a_piece_names_is_there(self):
        lists = "\n".join(path.read_text(encoding="utf-8") for path in ROOT.glob("**/CMakeLists.txt") if "build" not in path.parts)
        targets = set(re.findall(r"(?:needlelab_test|needlelab_program|bench_program|add_executable)\((\S+)", lists))
        targets |= set(re.findall(r"add_library\((\S+) MODULE", lists))  # preloaded by a test
        sources = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*_test.cpp"))
        tests = {f"{suite}.{name}" for suite, name in re.findall(r"\bTEST(?:_F|_P)?\((\w+),\s*(\w+)\)", sources)}
        for piece in self.nightly.PIECES:
            for program in piece.needs():
                self.assertIn(program, targets, piece.name)
            for wanted in re.findall(r"--gtest_filter=(\S+)", " ".join(piece.commands)):
                for one in wanted.removeprefix("-").split(":"):
                    pattern = re.compile(re.escape(one).replace(r"\*", ".*"))
                    self.assertTrue(any(pattern.fullmatch(test) for test in tests), f"{piece.name}: no test {one}")
            for path in re.findall(r"\{source\}/(\S+)", " ".join(piece.commands)):
                self.assertTrue((ROOT / path).exists(), path)

    def test_every_file_with_a_long_form_is_of_a_program_that_some_piece_runs(self):
        run = {program for piece in self.nightly.PIECES for program in piece.needs()}
        lists = {path: path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("CMakeLists.txt")}
        programs = {}  # by source file
        for path, text in lists.items():
            for name, rest in re.findall(r"needlelab_test\((\S+)(.*?)\bDEPS\b", text, re.DOTALL):
                names = re.findall(r"foreach\(name ([^)]+)\)", text) if "${name}" in name else [""]
                for each in " ".join(names).split() or [""]:
                    for source in re.findall(r"\S+\.cpp", rest):
                        programs.setdefault((path.parent / source.replace("${name}", each)).resolve(), set()).add(name.replace("${name}", each))
        for source in (ROOT / "tests").rglob("*_test.cpp"):
            if re.search(r"\blongForm\(\)", source.read_text(encoding="utf-8")):
                self.assertTrue(programs.get(source.resolve(), set()) & run, f"{source.relative_to(ROOT)} runs in no piece")

    def test_every_fuzzer_runs_in_some_piece(self):
        text = (ROOT / "tests" / "fuzz" / "run").read_text(encoding="utf-8")
        named = re.findall(r"--only (\w+)", " ".join(" ".join(piece.commands) for piece in self.nightly.PIECES))
        self.assertEqual(sorted(named), sorted(re.search(r"^targets=\((.*)\)", text, re.MULTILINE)[1].split()))

    def test_the_table_is_made_from_the_results_and_has_a_row_for_every_piece(self):
        _, shown, _ = self.nightly.table_in(self.nightly.README.read_text(encoding="utf-8"))
        self.assertEqual(shown, self.nightly.table(), "write it again: deploy/nightly --table")
        for piece in self.nightly.PIECES:
            row = next(line for line in shown.splitlines() if line.startswith(f"| `{piece.name}` |"))
            self.assertEqual("never run" in row, self.nightly.result_of(piece) is None, row)

    def test_every_result_is_that_of_a_piece_and_says_when_where_and_what(self):
        names = {piece.name for piece in self.nightly.PIECES}
        for path in self.nightly.RESULTS.glob("*"):
            result = json.loads(path.read_text(encoding="utf-8"))
            self.assertIn(path.stem, names)
            self.assertEqual(result["piece"], path.stem)
            self.assertRegex(result["date"], r"^20\d\d-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
            self.assertRegex(result["commit"], r"^[0-9a-f]{7,}(-dirty)?$")
            self.assertEqual(sorted(result["machine"]), ["cores", "cpu", "kernel"])
            self.assertGreaterEqual(result["seconds"], 0)
            self.assertIn(result["verdict"], ("passed", "failed", "could not run"))
            self.assertEqual(result["why"] == "", result["verdict"] == "passed", result)


class Running(unittest.TestCase):
    """The script with shell scripts as pieces."""

    def setUp(self):
        self.nightly = nightly()
        folder = tempfile.TemporaryDirectory(prefix="needlelab-nightly-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "bin").mkdir()
        self.nightly.RESULTS, self.nightly.LOGS = self.folder / "results", self.folder / "logs"
        self.nightly.README = self.folder / "README.md"
        self.nightly.README.write_text(f"before\n{self.nightly.BEGIN}\n{self.nightly.END}\nafter\n", encoding="utf-8")
        self.nightly.commit = lambda build=None: "abc1234"

    def piece(self, name, script, numbers=(), programs=()):
        program = self.folder / "bin" / name
        program.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        program.chmod(0o755)
        return nightly_pieces.Piece(name, 1, f"what {name} shows", (f"{{bin}}/{name}",), numbers, programs)

    def run_pieces(self, *pieces, arguments=()):
        """(exit code, output, {piece: result})."""
        self.nightly.PIECES = pieces
        with contextlib.redirect_stdout(io.StringIO()) as said:
            code = self.nightly.main(["--build", str(self.folder), "--fuzz-build", str(self.folder), *arguments])
        return code, said.getvalue(), {piece.name: self.nightly.result_of(piece) for piece in pieces}

    def test_the_rows_of_a_table_that_a_piece_prints_are_kept(self):
        piece = self.piece("rows", "printf '| scenario | labs | seeds |\\n| --- | ---: | --- |\\n| kill | 2 | 7 8 |\\n| other-way | 10 | 9 |\\n2 labs played\\n'")
        piece = dataclasses.replace(piece, rows="scenario")
        code, said, results = self.run_pieces(piece)
        self.assertEqual(code, 0, said)
        self.assertEqual(results["rows"]["rows"], [{"scenario": "kill", "labs": 2, "seeds": "7 8"}, {"scenario": "other-way", "labs": 10, "seeds": "9"}])

    def test_a_piece_that_passes_leaves_its_numbers_and_a_row(self):
        number = nightly_pieces.Number
        piece = self.piece("good", "echo '3 kills'; echo '4 kills'; echo $NEEDLELAB_LONG", (
            number("last", r"(\d+) kills"), number("sum", r"(\d+) kills", "sum"), number("most", r"(\d+) kills", "max"),
            number("times", r"kills", "count"), number("long", r"^(1)$"), number("absent", r"no such (\d+)")))
        code, said, results = self.run_pieces(piece)
        self.assertEqual((code, results["good"]["verdict"]), (0, "passed"), said)
        self.assertEqual(results["good"]["numbers"], {"last": 4, "sum": 7, "most": 4, "times": 2, "long": 1})
        text = self.nightly.README.read_text(encoding="utf-8")
        self.assertIn("| `good` | what good shows |", text)
        self.assertIn("Commit `abc1234`.\n\n| piece |", text)
        self.assertRegex(text, r"\| `good` \| .* \| 20\d\d-\d\d-\d\d, passed \|")
        self.assertTrue(text.startswith("before\n") and text.endswith("after\n"), text)
        self.assertEqual(self.nightly.table_in(text)[1], self.nightly.table())

    def test_a_failure_a_skip_and_a_missing_program_are_told_apart(self):
        code, said, results = self.run_pieces(
            self.piece("bad", "echo all begins well; echo '[  FAILED  ] Herd.isWhole'; exit 3"),
            self.piece("unable", "echo 'skipped: only root may'; exit 77"),
            self.piece("skips", "echo '[==========] 1 test ran'; echo '[  PASSED  ] 0 tests.'; echo '[  SKIPPED ] 1 test, listed below:'"),
            self.piece("lost", "true", programs=("needlelab-nowhere",)))
        self.assertEqual(code, 1, said)
        told = {name: (result["verdict"], result["why"]) for name, result in results.items()}
        self.assertEqual(told, {"bad": ("failed", "exit code 3; [  FAILED  ] Herd.isWhole"), "unable": ("could not run", "only root may"),
                                "skips": ("could not run", "every test was skipped"),
                                "lost": ("could not run", "needlelab-nowhere is not built")})

    def test_a_piece_that_hangs_is_ended_with_all_that_it_started(self):
        self.nightly.LIMIT_MIN = 1 / 60
        pid = self.folder / "pid"
        piece = self.piece("hang", f"sleep 60 & echo $! >{pid}; sleep 60")
        code, said, results = self.run_pieces(piece)
        self.assertEqual((code, results["hang"]["verdict"]), (1, "failed"), said)
        self.assertIn("not ended within", results["hang"]["why"])
        self.assertLess(results["hang"]["seconds"], 15)
        self.assertTrue(gone(pid), "it still runs")

    def test_what_ran_at_this_commit_does_not_run_again_unless_asked(self):
        count = self.folder / "count"
        good, bad = self.piece("good", f"echo x >>{count}"), self.piece("bad", f"echo x >>{count}; exit 1")
        runs = lambda: len(count.read_text(encoding="ascii").split())  # noqa: E731
        self.assertEqual(self.run_pieces(good, bad)[0], 1)
        code, said, _ = self.run_pieces(good, bad)
        self.assertEqual((code, runs()), (1, 2), "a piece that failed stays failed")
        self.assertIn("good: ran at this commit, passed; --again", said)
        self.assertEqual(self.run_pieces(good, bad, arguments=["--again", "good"])[0], 0)
        self.assertEqual(runs(), 3)
        self.nightly.commit = lambda build=None: "def5678"
        self.run_pieces(good, bad)
        self.assertEqual(runs(), 5)

    def test_the_table_says_its_commit_once_and_where_a_piece_ran_on_another(self):
        pieces = [self.piece(name, "true") for name in ("first", "second", "third")]
        self.run_pieces(*pieces)
        self.nightly.commit = lambda build=None: "def5678"
        self.run_pieces(*pieces, arguments=["first", "third"])
        text = self.nightly.README.read_text(encoding="utf-8")
        self.assertIn("Commit `def5678`.", text)
        self.assertEqual([line.split("`")[1] for line in text.splitlines() if "`abc1234`, passed" in line], ["second"])

    def test_a_piece_of_the_fuzzers_has_the_commit_of_their_build(self):
        fuzzers = self.folder / "fuzzers"
        (fuzzers / "bin").mkdir(parents=True)
        count, fuzzer = self.folder / "count", fuzzers / "bin" / "fuzz_chunk"
        fuzzer.write_text(f"#!/bin/sh\necho x >>{count}\n", encoding="utf-8")
        fuzzer.chmod(0o755)
        commits = {self.folder: "abc1234", fuzzers: "def5678"}
        self.nightly.commit = lambda build=None: commits[build]
        pieces = (nightly_pieces.Piece("fuzz", 1, "what fuzz shows", ("{fuzz}/bin/fuzz_chunk --only chunk",)), self.piece("good", "true"))
        code, said, results = self.run_pieces(*pieces, arguments=["--fuzz-build", str(fuzzers)])
        self.assertEqual((code, results["fuzz"]["commit"], results["good"]["commit"]), (0, "def5678", "abc1234"), said)
        commits[self.folder] = "123abcd"
        self.run_pieces(*pieces, arguments=["--fuzz-build", str(fuzzers)])
        self.assertEqual(len(count.read_text(encoding="ascii").split()), 1, "its sources are the same")

    def test_a_piece_that_cannot_run_leaves_the_earlier_result(self):
        self.run_pieces(self.piece("systemd", "true"))
        self.nightly.commit = lambda build=None: "def5678"
        code, said, results = self.run_pieces(self.piece("systemd", "echo 'skipped: no root'; exit 77"))
        self.assertEqual((code, results["systemd"]["verdict"], results["systemd"]["commit"]), (1, "passed", "abc1234"), said)
        self.assertIn("could not run: no root", said)

    def test_when_it_is_told_to_end_it_ends_what_it_started(self):
        pid = self.folder / "pid"
        self.piece("needlelab-admin", "true")
        for name in ("needlelab-station", "needlelab-server", "needlelab-instructor"):
            self.piece(name, "true")
        script = self.folder / "deploy" / "nightly"
        script.parent.mkdir()
        script.write_text((ROOT / "deploy" / "nightly").read_text(encoding="utf-8"), encoding="utf-8")
        text = (ROOT / "deploy" / "nightly_pieces.py").read_text(encoding="utf-8")
        script.with_name("nightly_pieces.py").write_text(text.replace("{source}/tests/netfaults/namespaces", "{source}/hang"), encoding="utf-8")
        hang = self.folder / "hang"
        hang.write_text(f"#!/bin/sh\necho $$ >{pid}.new; mv {pid}.new {pid}; sleep 600\n", encoding="utf-8")
        hang.chmod(0o755)
        subprocess.run(["git", "init", "-q", str(self.folder)], check=True)
        subprocess.run(["git", "-C", str(self.folder), "-c", "user.name=x", "-c", "user.email=x@x", "commit", "-qm", "x", "--allow-empty"],
                       check=True)
        child = subprocess.Popen([sys.executable, "-B", script, "--build", self.folder, "namespaces"], stdout=subprocess.DEVNULL,
                                 stderr=subprocess.PIPE)
        for _ in range(1200):
            if pid.exists():
                break
            time.sleep(0.05)
        child.terminate()
        self.assertIn(b"stopped", child.communicate(timeout=60)[1])
        self.assertEqual(child.returncode, 130)
        self.assertTrue(gone(pid), "it still runs")


if __name__ == "__main__":
    unittest.main()
