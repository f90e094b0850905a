#!/usr/bin/env python3
"""The attacks' own arithmetic, plan and table, and their network where namespaces are available; no server is started."""
import collections
import importlib.machinery
import importlib.util
import json
import os
import pathlib
import socket
import sys
import tempfile
import threading
import time
import types
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))
import attacks_test  # noqa: E402
from attacks import UNTOUCHED_S, is_caught, untouched  # noqa: E402
from attacks_test import KNOWN, PLANTED, SCENARIOS, SUFFIX, Planned, Table, plan  # noqa: E402
from cables import NoNamespaces, Switch, lost_ways  # noqa: E402
from fault_lab import Judgement  # noqa: E402
from measures import AckTimes, Away, Fault, longest_silence, missing, percentile  # noqa: E402
from peers import CALL_STOP_LESSON, PING, PONG, REPLY, REQUEST, STOP_LESSON, SUBSCRIBE, message, pong  # noqa: E402
from rude_client import field  # noqa: E402
from viewers import Viewer  # noqa: E402

S = 10**9


def nightly():
    sys.path.insert(0, str(ROOT / "deploy"))  # its pieces lie beside it
    loader = importlib.machinery.SourceFileLoader("nightly", str(ROOT / "deploy" / "nightly"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("nightly", loader))
    sys.modules["nightly"] = module  # dataclasses look it up there
    loader.exec_module(module)
    return module


class Silences(unittest.TestCase):
    def test_the_longest_begins_with_the_last_event_before(self):
        self.assertEqual(longest_silence([1, 2, 10, 11], 5, 12), (2, 10))
        self.assertEqual(longest_silence([1, 2, 3, 4, 9], 2, 9), (4, 9))

    def test_one_that_lasts_still_has_no_end(self):
        self.assertEqual(longest_silence([1, 2], 2, 30), (2, None))
        self.assertEqual(longest_silence([], 2, 30), (2, None))

    def test_who_streams_and_is_lost_again_is_measured_by_the_longer_one(self):
        self.assertEqual(longest_silence([0, 2, 3, 9, 10], 1, 10), (3, 9))

    def test_percentiles_are_of_the_nearest_rank(self):
        values = list(range(1, 11))
        self.assertEqual((percentile(values, 0.5), percentile(values, 0.9), percentile([7], 0.9), percentile([], 0.9)), (5, 9, 7, None))

    def test_again_counts_from_what_is_healed_and_away_from_the_fault(self):
        away = Away()
        away.add([10 * S, 20 * S, 23 * S, 24 * S], Fault(begin=11 * S, healed=18 * S, stations=[]), 24 * S)
        self.assertEqual((away.again, away.away), ([2.0], [9.0]))
        # before it was healed: no station had to wait for that
        away.add([10 * S, 13 * S, 14 * S], Fault(begin=11 * S, healed=18 * S, stations=[]), 14 * S)
        self.assertEqual((away.again[1], away.away[1]), (0, 2.0))

    def test_who_noticed_nothing_is_not_measured_by_a_later_pause(self):
        away = Away()
        away.add([10 * S, 11 * S, 11 * S + S // 2, 12 * S + S // 4], Fault(begin=10 * S + S // 2, healed=10 * S + S // 2, stations=[]), 13 * S)
        self.assertEqual((away.again, away.away), ([0.5], [0.5]))

    def test_the_goal_is_of_the_p90(self):
        away = Away()
        away.again, away.away = [1.0] * 9 + [60.0], [1.0] * 10
        self.assertIsNone(away.over_goal())
        away.again.append(7.0)
        self.assertEqual(away.over_goal(), 7.0)
        self.assertEqual(away.text()[0], "1.0 / 7.0")
        self.assertIsNone(Away().over_goal())
        self.assertEqual(Away().text(), ("", ""))

    def test_viewers_may_be_healed_later(self):
        self.assertEqual(Fault(1, 2, []).for_viewers().healed, 2)
        self.assertEqual(Fault(1, 2, [], viewers_healed=3).for_viewers().healed, 3)


class Ledgers(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, station, text):
        with open(self.folder / f"{station}.jsonl", "a", encoding="ascii") as file:
            file.write(text)

    @staticmethod
    def ack(session, t, committed):
        # as nlohmann::json writes it
        return json.dumps({"committed": committed, "e": "ack", "id": session, "safe": committed, "t": t}, separators=(",", ":"), sort_keys=True) + "\n"

    def test_acks_are_read_as_they_come_and_cut_off_lines_later(self):
        acks = AckTimes(self.folder)
        self.write("station-1", '{"e":"s","t":5,"v":[0]}\n' + self.ack("x", 10, 1) + self.ack("x", 20, 3)[:9])
        self.assertEqual(acks.read().times["station-1"], [10])
        self.write("station-1", self.ack("x", 20, 3)[9:])
        self.write("station-2", self.ack("y", 15, 2))
        acks.read()
        self.assertEqual((acks.times["station-1"], acks.committed), ([10, 20], {"x": 3, "y": 2}))
        self.assertEqual((acks.since(["station-1", "station-2"], 15), acks.since(["station-1"], 9)), (1, 2))

    def test_a_clock_that_is_ahead_is_taken_back(self):
        acks = AckTimes(self.folder, {"station-1": 100})
        self.write("station-1", self.ack("x", 110, 1))
        self.assertEqual(acks.read().times["station-1"], [10])

    def test_what_is_acknowledged_and_not_stored_is_named(self):
        self.assertEqual(missing({"x": 3, "y": 2}, {"x": 3, "y": 2, "z": 1}), [])
        self.assertEqual(len(missing({"x": 3, "y": 2}, {"x": 2})), 2)

    def test_a_lesson_that_nothing_may_touch_and_that_waits_is_a_finding(self):
        now = time.time_ns()
        acks = AckTimes(self.folder)
        self.write("station-1", "".join(self.ack("x", now - k * S, 1) for k in (29, 28, 4, 1)))
        lab = types.SimpleNamespace(names=["station-1"], acks=acks, findings=[], plant=None)
        untouched(lab, Fault(now - 2 * S, now, []))
        self.assertEqual(lab.findings, [])
        untouched(lab, Fault(now - 27 * S, now - 20 * S, []))
        self.assertEqual([name for name, _ in lab.findings], ["lesson-touched"])
        self.assertLess(UNTOUCHED_S, 24)
        self.assertFalse(is_caught(lab), "nothing is planted")


class Plans(unittest.TestCase):
    def test_scenarios_are_named_before_or_behind_the_options(self):
        for words in (["bin", "stop", "access", "--long"], ["bin", "--long", "--seed", "21", "stop", "access"]):
            given = attacks_test.arguments(words)
            self.assertEqual((str(given.bin), given.names, given.long), ("bin", ["stop", "access"], True))

    def test_the_long_form_has_all_scenarios_and_each_bug(self):
        labs = list(plan([], True, 7))
        for name, scenario in SCENARIOS.items():
            self.assertEqual(sum(lab.rounds for lab in labs if lab.name == name), 2 * scenario.rounds)
        self.assertEqual({lab.name for lab in labs}, set(KNOWN))
        self.assertEqual({lab.stations for lab in labs if not lab.scenario.few and not lab.bug}, {50})

    def test_there_are_twenty_kills_of_each_and_six_faults_of_every_other_kind(self):
        for name, scenario in SCENARIOS.items():
            self.assertEqual(scenario.rounds * attacks_test.SEEDS, 20 if name.endswith("-killed") else 6, name)

    def test_the_short_form_has_some_once_and_each_bug(self):
        labs = list(plan([], False, 7))
        self.assertEqual({lab.rounds for lab in labs}, {1})
        self.assertEqual({lab.bug for lab in labs} - {None}, set(PLANTED))
        # waiting for what never comes is bounded; what must come may take its time beside other tests
        self.assertTrue(all(lab.is_timed == (lab.bug is not None) for lab in labs))
        self.assertTrue(all(lab.is_timed for lab in plan([], True, 7)))
        self.assertLess(len([lab for lab in labs if not lab.bug]), len(SCENARIOS))

    def test_a_scenario_alone_has_the_seeds_that_it_has_among_all(self):
        among = {(lab.name, lab.seed) for lab in plan([], True, 7)}
        for name in KNOWN:
            for is_long in (True, False):
                alone = list(plan([name], is_long, 7))
                self.assertTrue(alone)
                self.assertTrue({(lab.name, lab.seed) for lab in alone} <= among)

    def test_bugs_are_those_of_the_programs(self):
        # bugs of branches that are not merged yet are not in the header
        names = (ROOT / "common/base/planted_bug.h").read_text(encoding="utf-8")
        if "takeover-unfenced" in names:
            for bug in PLANTED:
                self.assertIn(f'"{bug}"', names)
        for bug, (scenario, _) in PLANTED.items():
            self.assertIn(scenario, SCENARIOS)
            self.assertEqual(next(plan([bug + SUFFIX], False, 1)).bug, bug)

    def test_names_that_revoke_stations_have_enough_of_them(self):
        for lab in plan(["access"], True, 1):
            self.assertGreaterEqual(lab.stations, lab.rounds)


class Tables(unittest.TestCase):
    def table(self):
        table, away = Table(), Away()
        away.again, away.away = [1.0, 2.0], [3.0, 4.0]
        judgement = Judgement()
        judgement.acknowledged, judgement.samples = 5, 60
        table.add(Planned("server-killed", 11, 10, 50), judgement, 10, away, away)
        table.add(Planned("server-killed", 12, 10, 50), judgement, 10, away, away)
        judgement = Judgement()
        judgement.faults.append(("token-outlives-access", "…"))
        table.add(Planned("revoked-token-honoured" + SUFFIX, 13, 1, 6), judgement, 1, Away(), Away())
        return table

    def test_deploy_nightly_reads_it(self):
        rows = nightly().rows_in("seed 7\n" + self.table().text() + "\n3 labs played\n", "scenario")
        self.assertEqual(rows[0]["scenario"], "server-killed")
        self.assertEqual((rows[0]["labs"], rows[0]["faults played"], rows[0]["samples compared"], rows[0]["chunks lost"]), (2, 20, 120, 0))
        self.assertEqual((rows[0]["stations again, s"], rows[0]["viewers away, s"], rows[0]["seeds"]), ("1.0 / 2.0", "3.0 / 4.0", "11 12"))
        self.assertEqual(rows[1]["stations again, s"], "")

    def test_who_is_over_the_goal_is_named(self):
        table = self.table()
        self.assertEqual(list(table.slow()), [])
        table.viewers["server-killed"].again += [9.0] * 10
        self.assertEqual(list(table.slow()), ["server-killed: viewers again after 9.0 s (p90), the goal is 5 s"])

    def test_its_pieces_play_every_scenario_once(self):
        played = [word for piece in nightly().PIECES for command in piece.commands if "attacks_test.py" in command
                  for word in command.split() if word in KNOWN]
        self.assertEqual(sorted(played), sorted(KNOWN))


class Speech(unittest.TestCase):
    def test_lines_of_a_viewer(self):
        viewer = Viewer.__new__(Viewer)
        viewer._lines, viewer._notes, viewer._online = collections.defaultdict(list), [], {}  # pylint: disable=protected-access
        for now, line in enumerate(['{"type":"update","station":"x","time_s":1}', '{"type":"note","text":"lost; connecting again"}', "no JSON",
                                    '{"type":"update","station":"y","online":false}', '{"type":"update","station":"x","online":true}']):
            viewer.take(line, now)
        self.assertEqual((viewer.times("x"), viewer.times("y"), viewer.notes()), ([0, 4], [], ["lost; connecting again"]))
        self.assertTrue(viewer.says_offline("y"))
        self.assertFalse(viewer.says_offline("x") or viewer.says_offline("z"))
        self.assertTrue(viewer.sees_since(["x"], 3))
        self.assertFalse(viewer.sees_since(["x", "y"], 3))

    def test_a_pong_echoes_the_ping(self):
        fields = message(pong(field(1, 7) + field(2, 300)))
        self.assertEqual((fields[1], fields[2]), (7, 300))
        self.assertGreater(fields[3], 0)

    def test_numbers_are_those_of_the_protocol(self):
        texts = {name: (ROOT / f"proto/needlelab/{name}.proto").read_text(encoding="utf-8") for name in ("envelope", "control", "live")}
        for text in (f"Ping ping = {PING};", f"Pong pong = {PONG};", f"Request request = {REQUEST};", f"Reply reply = {REPLY};",
                     f"Subscribe subscribe = {SUBSCRIBE};", f"StopLesson stop_lesson = {STOP_LESSON};"):
            self.assertIn(text, texts["envelope"])
        self.assertIn(f"StopLesson stop_lesson = {CALL_STOP_LESSON};", texts["control"])
        stop = texts["live"][texts["live"].index("message StopLesson"):]
        self.assertIn("string station = 1;", stop)
        self.assertIn("string reason = 3;", stop)


class Network(unittest.TestCase):
    def test_each_direction_vanishes_and_comes_back_and_others_stay(self):
        self.assertEqual((lost_ways("a", "b", "to"), lost_ways("a", "b", "from")), ([("a", "b")], [("b", "a")]))
        if os.getuid() != 0:
            return  # Switch reports it
        try:
            switch = Switch(["a", "b", "c"])
        except NoNamespaces as why:
            print(f"not tried: {why}")
            return
        self.addCleanup(switch.close)
        took = {}
        for name in ("a", "b", "c"):
            machine = switch.machines[name]
            listener = took[name] = machine.call(lambda here=machine: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            listener.bind((machine.address, 5000))
            self.addCleanup(listener.close)

        def arrives(sender, receiver, expected):
            took[receiver].settimeout(60 if expected else 0.4)
            took[sender].sendto(b"x", (switch.machines[receiver].address, 5000))
            try:
                return took[receiver].recv(10) == b"x"
            except TimeoutError:
                return False
        pairs = [("a", "b"), ("b", "a"), ("a", "c"), ("b", "c")]
        def expect(ways, text=""):
            self.assertEqual([arrives(*pair, expected) for pair, expected in zip(pairs, ways)], ways, text)
        expect([True] * 4)
        for way, found in (("to", [False, True]), ("from", [True, False]), ("both", [False, False])):
            switch.cut("a", "b", way)
            expect([*found, True, True], way)
            switch.heal()
            expect([True] * 4, way)

    def test_an_error_inside_comes_out(self):
        if os.getuid() != 0:
            return
        try:
            switch = Switch(["a"])
        except NoNamespaces:
            return
        self.addCleanup(switch.close)
        with self.assertRaises(ZeroDivisionError):
            switch.machines["a"].call(lambda: 1 // 0)
        # the caller's thread is unaffected
        self.assertEqual(threading.current_thread(), threading.main_thread())
        self.assertNotEqual(os.readlink(f"/proc/{switch.machines['a'].pid}/ns/net"), os.readlink("/proc/thread-self/ns/net"))


if __name__ == "__main__":
    unittest.main()
