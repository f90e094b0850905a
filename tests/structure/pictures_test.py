#!/usr/bin/env python3
"""What is noted of the pictures of client/sim, the tables of its pages, and what these say of their tables."""
import importlib.machinery
import importlib.util
import os
import sys
import tempfile
import unittest

SIM = os.path.join(os.path.dirname(os.path.realpath(__file__)), "../../client/sim")
sys.path.insert(0, os.path.join(SIM, "pictures"))
import tables  # noqa: E402

loader = importlib.machinery.SourceFileLoader("draw", os.path.join(SIM, "pictures/draw"))
draw = importlib.util.module_from_spec(importlib.util.spec_from_loader("draw", loader))
sys.modules["draw"] = draw
loader.exec_module(draw)

PAGE = f"# A\n\nText.\n{tables.begin_of('skill')}\n| a |\n|---|\n| 1 |\n{tables.end_of('skill')}\nMore.\n"


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
            for place in (*part.pictures.values(), *filter(None, (part.text, part.table))):
                self.assertTrue((draw.HERE.parent / place).exists(), place)


class Tables(unittest.TestCase):
    def test_a_measure_is_a_row_with_its_effect(self):
        row = {"measure": "ldlj", "unit": "", "better": "more", "novice_mean": -20.412, "expert_mean": -18.4, "hedges_g": 2.83, "g_low_95": 2.25,
               "g_high_95": 5.1, "cliffs_delta": 1, "p": 0.000155, "p_holm": 0.0057, "separates": "yes", "rate_difference": 0.07014,
               "rate_tolerance": 0.5}
        self.assertEqual(tables.skill({"rows": [row]}).splitlines()[1:],
                         ["|" + "---|" * 11,
                          "| `ldlj` | more | -20.4 | -18.4 |  | 2.8 (2.2 … 5.1) | 1.00 | 0.0002 | 0.006 | yes | 0.0701 (0.5) |"])
        self.assertIn("| ∞ |", tables.skill({"rows": [dict(row, hedges_g=None)]}))

    def test_a_model_is_a_row_with_a_pair_of_cells_a_question(self):
        def row(question, model, variant, parameters, error):
            return {"held_out": question, "model": model, "variant": variant, "parameters": parameters, "error_n": error}
        result = {"questions": [{"held_out": "end"}, {"held_out": "blocks"}],
                  "rows": [row("end", "DIRECT", "10 layers", 19, 0.9666), row("end", "DIRECT", "PUNCTURE: 1 membrane", 5, 1),
                           row("blocks", "DIRECT", "9 layers", 17, 0.119), row("blocks", "DIRECT", "PUNCTURE: 4 membranes", 20, 0.127)]}
        self.assertEqual(tables.benchmark(result), "| model | numbers | `end` | numbers | `blocks` |\n|---|---|---|---|---|\n"
                         "| `DIRECT` | 19 | 0.967 | 17 | 0.119 |\n| `DIRECT`, membranes | 5 | 1.000 | 20 | 0.127 |\n")

    def test_a_table_goes_between_its_two_lines_and_nowhere_else(self):
        self.assertEqual(tables.with_part(PAGE, "skill", "| b |\n"), PAGE.replace("| a |\n|---|\n| 1 |\n", "| b |\n"))
        with self.assertRaises(ValueError):
            tables.with_part("# A\n", "skill", "| b |\n")


class Pages(unittest.TestCase):
    """The pages' statements follow from their tables."""

    def page(self, name, part):
        with open(os.path.join(SIM, name), encoding="utf-8") as file:
            text = file.read()
        lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in tables.part_of(text, part).splitlines()]
        return text, [dict(zip(range(len(line)), line), measure=line[0].strip("`")) for line in lines[2:]]

    def test_the_skill_page_counts_the_measures_of_its_table(self):
        text, rows = self.page("skill/README.md", "skill")
        words = text.partition(tables.begin_of("skill"))[0]
        directed = [row for row in rows if row[1] != "neither"]
        found = {kind: [row["measure"] for row in rows if row[9] == kind] for kind in ("yes", "no", "the other way", "yes, no better end")}
        worse = f"{len(found['the other way'])} find{'s' if len(found['the other way']) == 1 else ''} them worse"
        self.assertIn(f"**{len(found['yes'])} of {len(directed)} measures with a better end find the surer hands better**", words)
        self.assertIn(f"![{len(found['yes'])} of {len(directed)} measures find the experts better, {worse}]", words)
        for kind, begin in (("the other way", f"- **{worse}**"), ("no", f"- **{len(found['no'])} do not separate**")):
            bullet = words.partition(begin)[2].partition("\n- ")[0]
            for measure in found[kind] + (found["yes, no better end"] if kind == "no" else []):
                self.assertIn(f"`{measure}`", bullet, begin)

    def test_joining_the_dots_has_the_least_error_of_the_blocks(self):
        text, rows = self.page("benchmark/README.md", "benchmark")
        self.assertIn("Joining the dots beats every model where it is asked to interpolate", text)
        self.assertEqual(min(rows, key=lambda row: float(row[4]))["measure"], "CONNECT_THE_DOTS")


if __name__ == "__main__":
    unittest.main()
