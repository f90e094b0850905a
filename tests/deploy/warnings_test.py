#!/usr/bin/env python3
"""A warning fails the build, and NEEDLELAB_WARNINGS_AS_ERRORS=OFF switches that off in every preset."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(sys.argv.pop(1))


def build(*options):
    """Exit code and output of building one file with a warning, with the project's toolchain file."""
    with tempfile.TemporaryDirectory(prefix="needlelab-warnings-") as folder:
        pathlib.Path(folder, "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.25)\nproject(one LANGUAGES CXX)\n"
            f"include({ROOT}/deploy/cmake/NeedlelabToolchain.cmake)\n"
            "add_library(one STATIC one.cpp)\ntarget_link_libraries(one PRIVATE needlelab_flags needlelab_warnings)\n",
            encoding="utf-8")
        pathlib.Path(folder, "one.cpp").write_text("void one() { int unused; }\n", encoding="utf-8")
        configured = subprocess.run(["cmake", "-G", "Ninja", "-S", folder, "-B", f"{folder}/build", *options],
                                    capture_output=True, encoding="utf-8", check=False)
        assert configured.returncode == 0, configured.stderr
        built = subprocess.run(["cmake", "--build", f"{folder}/build"], capture_output=True, encoding="utf-8", check=False)
        return built.returncode, built.stdout


class Warnings(unittest.TestCase):
    def test_a_warning_is_an_error(self):
        code, text = build()
        self.assertNotEqual(code, 0)
        self.assertIn("-Werror=unused-variable", text)

    def test_one_option_makes_it_a_warning_again(self):
        code, text = build("-DNEEDLELAB_WARNINGS_AS_ERRORS=OFF")
        self.assertEqual(code, 0, text)
        self.assertIn("-Wunused-variable", text)

    def test_no_preset_switches_it_off(self):
        presets = json.loads((ROOT / "CMakePresets.json").read_text(encoding="utf-8"))["configurePresets"]
        self.assertGreater(len(presets), 5)
        for preset in presets:
            self.assertNotIn("NEEDLELAB_WARNINGS_AS_ERRORS", preset.get("cacheVariables", {}), preset["name"])
        # no target sets -Wno-error either
        sources = [ROOT / "CMakeLists.txt", *ROOT.glob("deploy/cmake/*.cmake")]
        for top in ("client", "common", "db", "proto", "server", "tests"):
            sources += (ROOT / top).glob("**/CMakeLists.txt")
        self.assertGreater(len(sources), 50)
        for file in sources:
            self.assertNotIn("-Wno-error", file.read_text(encoding="utf-8"), file)


if __name__ == "__main__":
    unittest.main()
