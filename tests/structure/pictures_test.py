#!/usr/bin/env python3
"""What is noted of the pictures of client/sim."""
import importlib.machinery
import importlib.util
import os
import sys
import tempfile
import unittest

SIM = os.path.join(os.path.dirname(os.path.realpath(__file__)), "../../client/sim")

loader = importlib.machinery.SourceFileLoader("draw", os.path.join(SIM, "pictures/draw"))
draw = importlib.util.module_from_spec(importlib.util.spec_from_loader("draw", loader))
sys.modules["draw"] = draw
loader.exec_module(draw)


class Numbers(unittest.TestCase):
    def summary(self, text):
        with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
            file.write(text)
            file.flush()
            return draw.summary(draw.rows_of(file.name))

    def test_a_column_is_its_least_number_mean_and_greatest_or_how_many_texts(self):
        self.assertEqual(self.summary("# by hand\nmodel,error_n,p50_ns\nVOIGT,1,300\nDAHL,2.5,\nDAHL,-0.5,500\n"),
                         {"rows": 3, "model": 2, "error_n": [-0.5, 1.0, 2.5], "p50_ns": [300, 400, 500]})
        self.assertEqual(self.summary("a,b,c\nnan,1,nan\n2,,nan\n"), {"rows": 2, "a": [2, 2, 2], "b": [1, 1, 1], "c": 1})
        self.assertEqual(self.summary(""), {"rows": 0})

    def changed(self, noted, now):
        return draw.differences("figures", {"a.csv": noted}, {"a.csv": now})

    def test_a_number_may_differ_by_a_thousandth_of_the_greatest_and_a_time_by_a_factor_of_ten(self):
        self.assertEqual(self.changed({"rows": 3, "error_n": [-1, 0, 2]}, {"rows": 3, "error_n": [-1.0019, 0.0019, 2.0019]}), [])
        self.assertEqual(self.changed({"error_n": [-1, 0, 2]}, {"error_n": [-1, 0.0021, 2]}),
                         ["figures: a.csv, error_n: [-1, 0, 2] was drawn, now it is [-1, 0.0021, 2]"])
        self.assertEqual(self.changed({"p50_ns": [300, 400, 500]}, {"p50_ns": [2900, 3900, 9999]}), [])
        self.assertEqual(len(self.changed({"p50_ns": [300, 400, 500]}, {"p50_ns": [300, 4100, 500]})), 1)

    def test_rows_texts_columns_and_tables_that_come_or_go_are_changes(self):
        for now in ({"rows": 4, "model": 2}, {"rows": 3, "model": 3}, {"rows": 3, "model": [1, 1, 1]}, {"rows": 3}, {"rows": 3, "model": 2, "new": 1}):
            self.assertEqual(len(self.changed({"rows": 3, "model": 2}, now)), 1, now)
        self.assertEqual(draw.differences("figures", {"a.csv": {"rows": 1}}, {}), ["figures: no table a.csv"])
        self.assertEqual(len(draw.differences("figures", {}, {"a.csv": {"rows": 1}})), 1)

    def test_a_results_rows_are_noted_for_each_case(self):
        with tempfile.TemporaryDirectory() as folder:
            out = draw.pathlib.Path(folder)
            (out / "result.json").write_text('{"rows": [{"case": "a", "measured": 1, "note": ""}, {"case": "b", "measured": null, "note": "x"},'
                                             ' {"case": "a", "measured": 3, "note": ""}]}', encoding="utf-8")
            self.assertEqual(draw.tables_in("stability", out), {"a": {"rows": 2, "case": 1, "measured": [1, 2, 3], "note": 0},
                                                                "b": {"rows": 1, "case": 1, "measured": 0, "note": 1}})

    def test_every_picture_of_a_part_is_there_and_has_noted_numbers(self):
        noted = draw.json.loads(draw.NOTED.read_text(encoding="utf-8"))
        self.assertEqual(sorted(noted), sorted(draw.PARTS))
        for name, part in draw.PARTS.items():
            self.assertTrue(noted[name], name)
            for place in (*part.pictures.values(), *filter(None, (part.text,))):
                self.assertTrue((draw.HERE.parent / place).exists(), place)


if __name__ == "__main__":
    unittest.main()
