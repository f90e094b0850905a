#!/usr/bin/env python3
"""The check of the pictures' sources finds what it should."""
import os
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), "../../client/sim/pictures"))
import stamp  # noqa: E402
import tables  # noqa: E402

SOURCES = {"pictures/a.png": ["common/haptics/**/*.cpp", "client/sim/plots/a.gp"], "a/README.md#skill": ["common/haptics/**/*.cpp"]}
PAGE = f"# A\n\nText.\n{tables.begin_of('skill')}\n| a |\n|---|\n| 1 |\n{tables.end_of('skill')}\nMore.\n"


class Pictures(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.write("common/haptics/models/voigt.cpp", "// a damper\nint b = 5;\n")
        self.write("client/sim/plots/a.gp", "# data\nplot x\n")
        self.write("client/sim/pictures/a.png", "png")
        self.write("client/sim/a/README.md", PAGE)
        stamp.write(self.folder.name, SOURCES, SOURCES)

    def write(self, name, text):
        path = os.path.join(self.folder.name, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)

    def faults(self):
        return stamp.check(self.folder.name, SOURCES)

    def test_a_picture_beside_its_sources_has_no_fault(self):
        self.assertEqual(self.faults(), [])

    def test_remarks_and_spaces_ask_for_no_new_picture(self):
        self.write("common/haptics/models/voigt.cpp", "// a spring and a damper\nint b\n    = 5;  // B\n")
        self.write("client/sim/plots/a.gp", "# other data\nplot x\n")
        self.assertEqual(self.faults(), [])

    def test_a_changed_new_or_removed_source_is_a_fault(self):
        for name, text, faults in (("common/haptics/models/voigt.cpp", "int b = 6;\n", 2), ("common/haptics/new.cpp", "int c;\n", 2),
                                   ("client/sim/plots/a.gp", "plot 2*x\n", 1)):
            self.setUp()
            self.write(name, text)
            self.assertEqual(len(self.faults()), faults, name)
            self.assertIn("client/sim/pictures/a.png was made from other sources", self.faults()[0])

    def test_a_table_of_a_page_is_stamped_without_the_text_around_it(self):
        self.write("client/sim/a/README.md", PAGE.replace("Text", "Other text"))
        self.assertEqual(self.faults(), [])
        self.write("client/sim/a/README.md", PAGE.replace("| 1 |", "| 2 |"))
        self.assertEqual(self.faults(), ["client/sim/a/README.md#skill is not what was drawn: run client/sim/pictures/draw"])
        self.write("client/sim/a/README.md", PAGE.replace(tables.end_of("skill"), ""))
        self.assertEqual(len(self.faults()), 1)
        self.assertIn("has no table between", self.faults()[0])

    def test_a_picture_of_another_run_is_a_fault(self):
        self.write("client/sim/pictures/a.png", "another png")
        self.assertEqual(self.faults(), ["client/sim/pictures/a.png is not what was drawn: run client/sim/pictures/draw"])

    def test_a_picture_that_is_gone_or_was_never_noted_is_a_fault(self):
        os.remove(os.path.join(self.folder.name, "client/sim/pictures/a.png"))
        self.assertEqual(self.faults(), ["there is no client/sim/pictures/a.png"])
        self.write("client/sim/pictures/a.png", "png")
        self.write(stamp.STAMPS, "{}\n")
        self.assertEqual(len(self.faults()), len(SOURCES))

    def test_the_patterns_of_the_real_pictures_find_sources(self):
        root = os.path.join(stamp.HERE, "../../..")
        for name, patterns in stamp.SOURCES.items():
            for pattern in patterns:
                self.assertTrue(stamp.glob.glob(os.path.join(root, pattern), recursive=True), f"{name}: {pattern} matches nothing")


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
        with open(os.path.join(stamp.HERE, "..", name), encoding="utf-8") as file:
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
