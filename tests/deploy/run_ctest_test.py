#!/usr/bin/env python3
"""deploy/run_ctest's output for tests that pass, fail, crash, hang or are skipped, and its exit code."""
import importlib.machinery
import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

RUN_CTEST = sys.argv.pop(1)


def run(*tests, skips=None, ci=False, arguments=()):
    """Exit code and lines of run_ctest on tests given as lines of a CTestTestfile.cmake. `skips`: the list of allowed skips."""
    environment = {**os.environ, "NEEDLELAB_CI": "1" if ci else ""}
    with tempfile.TemporaryDirectory(prefix="needlelab-run-ctest-") as parent:
        folder = f"{parent}/build"
        pathlib.Path(folder).mkdir()
        pathlib.Path(folder, "CTestTestfile.cmake").write_text("\n".join(tests), encoding="utf-8")
        command = [RUN_CTEST]
        if skips is not None:
            pathlib.Path(folder, "skips.txt").write_text(skips, encoding="utf-8")
            command += ["--skips", f"{folder}/skips.txt"]
        done = subprocess.run([*command, folder, "--test-dir", folder, "--output-on-failure", "-j", "4", *arguments],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False, env=environment)
    return done.returncode, done.stdout.splitlines()


def passing(count):
    return [f"add_test(good{i} true)" for i in range(count)]


def printing(name, text, code=0):
    """A test that prints `text` and exits with `code`."""
    return f'add_test({name} printf [[%s]] [[{text}]])' if code == 0 else \
        f'add_test({name} sh -c [[printf %s "$0"; exit {code}]] [[{text}]])'


BY_CODE = ['add_test(shy sh -c "echo looking; echo skipped: there is no browser; exit 77")',
           "set_tests_properties(shy PROPERTIES SKIP_RETURN_CODE 77)"]
# a GoogleTest program that runs as one test; its output is longer than what ctest keeps for a passed test
GTEST = """[ RUN      ] Disk.isFull
/src/disk_test.cpp:12: Skipped
this user may not mount a small disk

[  SKIPPED ] Disk.isFull (0 ms)
[ RUN      ] Disk.isEmpty
""" + "word\n" * 2000 + """[       OK ] Disk.isEmpty (1 ms)
[  PASSED  ] 1 test.
[  SKIPPED ] 1 test, listed below:
[  SKIPPED ] Disk.isFull
"""


class RunCtest(unittest.TestCase):
    def test_passes_are_counted_and_not_listed(self):
        code, lines = run(*passing(205))
        self.assertEqual(code, 0, lines)
        text = "\n".join(lines)
        self.assertIn("100 of 205 tests done, 0 failed", text)
        self.assertIn("200 of 205 tests done, 0 failed", text)
        self.assertNotIn("Passed", text)
        self.assertIn("The 15 slowest of 205 tests", text)
        self.assertLess(len(lines), 40)

    def test_a_failed_test_is_at_the_very_end_with_its_last_words(self):
        code, lines = run(*passing(20), 'add_test("bad <one>" sh -c "seq 1 100; echo last word; exit 3")')
        self.assertEqual(code, 8, lines)
        self.assertEqual(lines.count("1"), 1, "its whole output stands above")
        self.assertTrue(any("bad <one> ...***Failed" in line for line in lines), "without hundreds of dots")
        self.assertEqual(lines[-1], "1 failed: bad <one>")
        self.assertEqual(lines[-3], "  last word")
        at = next(i for i, line in enumerate(lines) if line.startswith("==== failed: bad <one>: Failed"))
        self.assertEqual(lines[at + 1], "  62")
        self.assertEqual(len(lines) - at, 43)
        self.assertGreater(at, lines.index("The following tests FAILED:"))

    def test_crashes_hangs_missing_programs_and_silence_are_failures(self):
        code, lines = run('add_test(crash sh -c "echo before; kill -SEGV $$")', 'add_test(hang sleep 30)',
                          'set_tests_properties(hang PROPERTIES TIMEOUT 1)', 'add_test(mute false)',
                          'add_test(gone /no/such/program)')
        self.assertEqual(code, 8, lines)
        text = "\n".join(lines)
        self.assertIn("==== failed: crash: Exception: SegFault", text)
        self.assertIn("==== failed: hang: Timeout after ", text)
        self.assertIn("==== failed: mute: Failed", text)
        self.assertIn("it said nothing", text)
        self.assertIn("==== failed: gone: Not Run", text)
        self.assertEqual(sorted(lines[-1].removeprefix("4 failed: ").split(", ")), ["crash", "gone", "hang", "mute"])

    def test_a_test_that_fails_has_failed_whatever_its_labels_and_is_run_once(self):
        for properties in ("LABELS unit", "LABELS net-threads RUN_SERIAL ON"):
            with tempfile.TemporaryDirectory() as seen:
                code, lines = run(f'add_test(bad sh -c "echo run >> {seen}/runs; test -e {seen}/again; r=$?; touch {seen}/again; exit $r")',
                                  f"set_tests_properties(bad PROPERTIES {properties})")
                runs = pathlib.Path(seen, "runs").read_text(encoding="utf-8").splitlines()
            self.assertEqual((code, lines[-1]), (8, "1 failed: bad"), properties)
            self.assertEqual(len(runs), 1, properties)

    def test_what_failed_in_a_program_of_node_is_printed_however_much_follows(self):
        told = ["not ok 3 - a list", "  ---", "  failureType: 'testCodeFailure'", "  error: 'seven is not eight'"]
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "out").write_text("\n".join(told + [f"ok {i}" for i in range(100)]), encoding="utf-8")
            _, lines = run(f'add_test(web sh -c "cat {folder}/out; exit 1")')
        self.assertIn("  not ok 3 - a list", lines)
        self.assertIn("    error: 'seven is not eight'", lines)
        self.assertIn("  ok 99", lines)

    def test_false_fails_however_busy_the_machine_is(self):
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
        try:
            code, lines = run("add_test(bad false)", "set_tests_properties(bad PROPERTIES RUN_SERIAL ON)")
        finally:
            for one in busy:
                one.kill()
                one.wait()
        self.assertEqual((code, lines[-1]), (8, "1 failed: bad"))

    def test_a_skip_is_printed_with_its_reason_and_without_a_list_is_no_error(self):
        code, lines = run(*BY_CODE, printing("disk", GTEST), *passing(3))
        self.assertEqual(code, 0, lines)
        self.assertFalse([line for line in lines if "failed: " in line])
        self.assertIn("skipped: shy: there is no browser", lines)
        self.assertIn("skipped: Disk.isFull: this user may not mount a small disk", lines)

    def test_a_skip_that_the_list_does_not_allow_is_an_error(self):
        skipping = {
            "shy": BY_CODE,
            "Disk.isFull": [printing("disk", GTEST)],
            "judge": [printing("judge", "Ran 9 tests in 1 s\n\nOK (skipped=2)\n")],
            "web": [printing("web", "# pass 4\n# skipped 1\n")],
            "program": [printing("program", "[  PASSED  ] 4 tests.\n\n  YOU HAVE 1 DISABLED TEST\n\n")],
            "console": [printing("console", "ℹ pass 4\nℹ skipped 1\n")],
            "off": ["add_test(off true)", "set_tests_properties(off PROPERTIES DISABLED ON)"],
            "regex": [printing("regex", "no luck"),
                      "set_tests_properties(regex PROPERTIES SKIP_REGULAR_EXPRESSION luck)"]}
        tests = [line for lines in skipping.values() for line in lines] + passing(3)
        code, lines = run(*tests, skips="")
        self.assertEqual(code, 1, lines)
        self.assertTrue(lines[-1].startswith("8 skipped, which "), lines)
        self.assertTrue(lines[-1].endswith("does not allow: " + ", ".join(sorted(skipping))), lines)
        code, lines = run(*tests, skips="# allowed\n" + "".join(f"{name}  because of the test\n" for name in skipping))
        self.assertEqual(code, 0, lines)
        code, lines = run(*tests, skips="".join(f"{name[:-1]}*  because of the test\n" for name in list(skipping)[1:]))
        self.assertEqual(code, 1, lines)
        self.assertTrue(lines[-1].startswith("1 skipped, which ") and lines[-1].endswith("does not allow: shy"), lines)

    def test_words_that_only_resemble_a_skip_are_none(self):
        code, lines = run(printing("fine", "OK\n# skipped 0\nℹ skipped 0\nnothing was skipped=3\n"), skips="")
        self.assertEqual(code, 0, lines)

    def test_a_failure_keeps_ctests_exit_code_beside_a_skip_that_is_not_allowed(self):
        code, lines = run(*BY_CODE, "add_test(bad false)", skips="")
        self.assertEqual(code, 8, lines)
        self.assertIn("1 failed: bad", lines)
        self.assertTrue(lines[-1].endswith("does not allow: shy"), lines)

    def test_a_listed_test_may_run(self):
        code, lines = run(*passing(3), printing("disk", GTEST), skips="good1  needs a display\nDisk.*  needs root\n")
        self.assertEqual(code, 0, lines)

    def test_a_line_without_its_test_is_an_error_if_all_tests_were_selected(self):
        code, lines = run(*passing(3), skips="good1  reason\nold*  reason\n")
        self.assertEqual(code, 1, lines)
        self.assertTrue(lines[-1].endswith("names tests that do not exist: old*"), lines)
        for selection in (["-R", "good"], ["--label-regex", ".*"], ["-E", "nothing"]):
            code, lines = run(*passing(3), "set_tests_properties(good0 good1 good2 PROPERTIES LABELS unit)",
                              skips="good1  reason\nold*  reason\n", arguments=selection)
            self.assertEqual(code, 0, lines)

    def test_a_line_may_hold_in_some_builds_only_or_only_for_users_that_are_not_root(self):
        for where, code_wanted in (("@release", 1), ("@tsan,build", 0), ("@build", 0), ("@user", 0 if os.geteuid() else 1)):
            code, lines = run(*BY_CODE, skips=f"shy {where}  reason\n")
            self.assertEqual(code, code_wanted, (where, lines))
        code, lines = run(*BY_CODE, skips="shy @build\n")
        self.assertEqual(code, 1, lines)
        self.assertIn("'shy' has no reason", lines[-1])

    def test_a_line_may_hold_only_where_there_is_one_core(self):
        every = os.sched_getaffinity(0)
        try:
            for cores in (every, {min(every)}):
                os.sched_setaffinity(0, cores)  # the child inherits it
                code, lines = run(*BY_CODE, skips="shy @one-core  reason\n")
                self.assertEqual(code, 0 if len(cores) == 1 else 1, (cores, lines))
        finally:
            os.sched_setaffinity(0, every)

    def test_a_line_may_hold_only_on_other_systems_than_debian_12(self):
        module = importlib.util.module_from_spec(importlib.util.spec_from_loader(
            "run_ctest", importlib.machinery.SourceFileLoader("run_ctest", RUN_CTEST)))
        module.__loader__.exec_module(module)
        with tempfile.TemporaryDirectory() as folder:
            module.OS_RELEASE = pathlib.Path(folder, "os-release")
            self.assertIn("other-system", module.places(pathlib.Path("build")), "without that file")
            for text, other in (('ID=debian\nVERSION_ID="12"\n', False), ('ID=debian\nVERSION_ID="13"\n', True),
                                ('ID=ubuntu\nVERSION_ID="12"\n', True)):
                module.OS_RELEASE.write_text(text, encoding="utf-8")
                self.assertEqual("other-system" in module.places(pathlib.Path("build")), other, text)

    def test_a_list_that_cannot_be_read_or_a_line_without_reason_is_an_error(self):
        code, lines = run(*passing(3), skips="good1\n")
        self.assertEqual(code, 1, lines)
        self.assertIn("skips.txt:1: 'good1' has no reason", lines[-1])

    def test_in_ci_the_committed_list_holds_without_being_asked_for(self):
        code, lines = run(*BY_CODE, *passing(3), ci=True, arguments=["-R", "."])
        self.assertEqual(code, 1, lines)
        self.assertTrue(lines[-1].endswith("tests/allowed_skips.txt does not allow: shy"), lines)

    def test_the_committed_list_can_be_read(self):
        code, lines = run(*passing(3), ci=True, arguments=["-R", "good"])
        self.assertEqual(code, 0, lines)

    def test_no_tests_and_wrong_arguments_keep_ctests_exit_code(self):
        code, _ = run(arguments=["--no-tests=error"])
        self.assertNotEqual(code, 0)
        code, lines = run(arguments=["--no-tests=ignore"], skips="")
        self.assertEqual(code, 0, lines)
        self.assertEqual(subprocess.run([RUN_CTEST], capture_output=True, check=False).returncode, 2)


if __name__ == "__main__":
    unittest.main()
