#!/usr/bin/env python3
"""What deploy/run_ctest says of tests that pass, fail, crash, hang, are skipped, and its exit code."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

RUN_CTEST = sys.argv.pop(1)


def run(*tests, stat="/dev/null", wake_us=15):
    """Exit code and lines of run_ctest on tests given as lines of a CTestTestfile.cmake. `stat` stands for /proc/stat, and
    `wake_us` for what is measured."""
    with tempfile.TemporaryDirectory(prefix="needlelab-run-ctest-") as folder:
        pathlib.Path(folder, "CTestTestfile.cmake").write_text("\n".join(tests), encoding="utf-8")
        done = subprocess.run([RUN_CTEST, folder, "--test-dir", folder, "--output-on-failure", "-j", "4"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", check=False,
                              env={**os.environ, "NEEDLELAB_PROC_STAT": str(stat), "NEEDLELAB_WAKE_US": str(wake_us)})
    return done.returncode, done.stdout.splitlines()


def passing(count):
    return [f"add_test(good{i} true)" for i in range(count)]


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

    def test_a_skipped_test_is_no_failure(self):
        code, lines = run('add_test(skipped sh -c "exit 77")', "set_tests_properties(skipped PROPERTIES SKIP_RETURN_CODE 77)")
        self.assertEqual(code, 0, lines)
        self.assertFalse([line for line in lines if "failed: " in line])
        self.assertIn("not run: skipped: it said nothing", lines)

    def test_a_skipped_test_says_why(self):
        code, lines = run('add_test(shy sh -c "echo looking; echo skipped: there is no browser; exit 77")',
                          "set_tests_properties(shy PROPERTIES SKIP_RETURN_CODE 77)", *passing(3))
        self.assertEqual(code, 0, lines)
        self.assertIn("not run: shy: skipped: there is no browser", lines)

    def test_what_keeps_real_time_has_a_second_run_alone_and_is_named(self):
        with tempfile.TemporaryDirectory() as seen:
            # fails the first time, passes the second
            once = f"test -e {seen}/$0 || {{ touch {seen}/$0; echo too late; exit 1; }}"
            late = [f'add_test({name} sh -c "{once}" {name})' for name in ("late", "alone")]
            late.append("set_tests_properties(late PROPERTIES LABELS unit-threads)")
            late.append("set_tests_properties(alone PROPERTIES RUN_SERIAL ON)")
            code, lines = run(*passing(3), *late)
        self.assertEqual(code, 0, lines)
        self.assertTrue([line for line in lines if line.startswith("==== failed: late: Failed")], "shown all the same")
        self.assertEqual(lines[-1][:len("2 of 2 passed in a second run, alone: ")], "2 of 2 passed in a second run, alone: ")

    def test_no_second_run_for_other_tests_for_findings_and_for_many(self):
        with tempfile.TemporaryDirectory() as seen:
            once = f"test -e {seen}/$0 || {{ touch {seen}/$0; echo $1; exit 1; }}"
            plain = f'add_test(plain sh -c "{once}" plain)'
            code, lines = run(plain)
            self.assertEqual((code, lines[-1]), (8, "1 failed: plain"))
            race = [f'add_test(race sh -c "{once}" race "WARNING: ThreadSanitizer: data race")',
                    "set_tests_properties(race PROPERTIES LABELS net)"]
            code, lines = run(*race)
            self.assertEqual((code, lines[-1]), (8, "1 failed: race"))
            many = [f'add_test(many{i} sh -c "{once}" many{i})' for i in range(6)]
            many += [f"set_tests_properties(many{i} PROPERTIES LABELS net)" for i in range(6)]
            code, lines = run(*many)
            self.assertEqual(code, 8)
            self.assertNotIn("second run", "\n".join(lines))

    def test_a_test_that_fails_twice_has_failed(self):
        code, lines = run("add_test(bad false)", "set_tests_properties(bad PROPERTIES LABELS net)")
        self.assertEqual(code, 8, lines)
        self.assertIn("==== second run, alone: bad", lines)

    def while_the_host_steals(self, words, properties, count=1):
        """Runs `count` tests that each time add an hour to what was stolen and then do as `words` (shell) say."""
        with tempfile.TemporaryDirectory() as folder:
            stat = pathlib.Path(folder, "stat")
            stat.write_text("cpu 1 2 3 4 5 6 7 0 0 0\n", encoding="ascii")
            script = pathlib.Path(folder, "late.sh")
            script.write_text(f"cat $0.$1 2>/dev/null; echo run >> $0.$1\n"
                              f"n=$(cat $0.* | wc -l); echo cpu 1 2 3 4 5 6 7 $((360000 * n)) 0 0 > {stat}\n{words}\n",
                              encoding="ascii")
            tests = [f"add_test(late{i} sh {script} {i})" for i in range(count)]
            tests += [f"set_tests_properties(late{i} PROPERTIES {properties})" for i in range(count)]
            return run(*passing(2), *tests, stat=stat)

    def test_while_the_host_takes_the_cores_a_run_that_fails_does_not_count(self):
        third = 'test "$(wc -l < $0.$1)" -ge 3'
        code, lines = self.while_the_host_steals(third, "LABELS net")
        self.assertEqual(code, 0, lines)
        self.assertIn("==== once more, alone: late0", lines)
        code, lines = self.while_the_host_steals('test "$(wc -l < $0.$1)" -ge 2', "LABELS net", count=7)
        self.assertEqual(code, 0, lines)
        self.assertTrue(lines[-1].startswith("7 of 7 passed in a second run, alone: "), lines[-1])

    def test_without_a_calm_run_only_what_runs_alone_is_not_judged(self):
        code, lines = self.while_the_host_steals("false", "RUN_SERIAL ON")
        self.assertEqual(code, 0, lines)
        self.assertEqual(lines[-1], "NOT JUDGED, this machine kept no real time in any run: late0")
        code, lines = self.while_the_host_steals("false", "LABELS net")
        self.assertEqual(code, 8, lines)
        code, lines = self.while_the_host_steals('echo "runtime error: x"; false', "RUN_SERIAL ON")
        self.assertEqual(code, 8, lines)
        self.assertNotIn("second run", "\n".join(lines))

    def test_slow_wake_ups_are_unfair_too(self):
        bad = ["add_test(bad false)", "set_tests_properties(bad PROPERTIES RUN_SERIAL ON)"]
        code, lines = run(*bad, wake_us=90)
        self.assertEqual((code, lines[-1]), (0, "NOT JUDGED, this machine kept no real time in any run: bad"))
        self.assertIn("meanwhile waking a thread and being woken took 90 µs: that was no fair run", lines)
        code, lines = run(*bad, wake_us=35)
        self.assertEqual(code, 8, lines)

    def test_no_tests_and_wrong_arguments_keep_ctests_exit_code(self):
        with tempfile.TemporaryDirectory(prefix="needlelab-run-ctest-") as folder:
            pathlib.Path(folder, "CTestTestfile.cmake").write_text("", encoding="utf-8")
            done = subprocess.run([RUN_CTEST, folder, "--test-dir", folder, "--no-tests=error"], capture_output=True, check=False)
        self.assertNotEqual(done.returncode, 0)


if __name__ == "__main__":
    unittest.main()
