#!/usr/bin/env python3
"""The check of the pictures' sources finds what it is for."""
import os
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), "../../client/sim/pictures"))
import stamp  # noqa: E402

SOURCES = {"pictures/a.png": ["common/haptics/**/*.cpp", "client/sim/plots/a.gp"]}


class Pictures(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.write("common/haptics/models/voigt.cpp", "// a damper\nint b = 5;\n")
        self.write("client/sim/plots/a.gp", "# data\nplot x\n")
        self.write("client/sim/pictures/a.png", "png")
        stamp.write(self.folder.name, ["pictures/a.png"], SOURCES)

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
        for name, text in (("common/haptics/models/voigt.cpp", "int b = 6;\n"), ("common/haptics/new.cpp", "int c;\n"),
                           ("client/sim/plots/a.gp", "plot 2*x\n")):
            self.setUp()
            self.write(name, text)
            self.assertEqual(len(self.faults()), 1, name)
            self.assertIn("client/sim/pictures/a.png was made from other sources", self.faults()[0])

    def test_a_picture_of_another_run_is_a_fault(self):
        self.write("client/sim/pictures/a.png", "another png")
        self.assertEqual(self.faults(), ["client/sim/pictures/a.png is not the file that was drawn: run client/sim/pictures/draw"])

    def test_a_picture_that_is_gone_or_was_never_noted_is_a_fault(self):
        os.remove(os.path.join(self.folder.name, "client/sim/pictures/a.png"))
        self.assertEqual(self.faults(), ["there is no client/sim/pictures/a.png"])
        self.write("client/sim/pictures/a.png", "png")
        self.write(stamp.STAMPS, "{}\n")
        self.assertEqual(len(self.faults()), 1)

    def test_the_patterns_of_the_real_pictures_find_sources(self):
        root = os.path.join(stamp.HERE, "../../..")
        for name, patterns in stamp.SOURCES.items():
            for pattern in patterns:
                self.assertTrue(stamp.glob.glob(os.path.join(root, pattern), recursive=True), f"{name}: {pattern} matches nothing")


if __name__ == "__main__":
    unittest.main()
