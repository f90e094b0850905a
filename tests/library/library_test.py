#!/usr/bin/env python3
"""C and C++ programs outside the tree, against installed files only: library_test.py [--build BUILD]; without it, of the packages.

Five samples, one of them a body: each value of a run through the C library equals that of `needlelab-sim run`, bit for bit."""
import argparse
import array
import csv
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAMPLES = ["paper-1dof", "paper-six-layers", "shoulder-adult", "phantom-ball", "volumes/shoulder-median"]
TICKS = 20000
# of nl_report, from its wrench on
COLUMNS = ("fx_n fy_n fz_n tx_nm ty_nm tz_nm wx_m wy_m wz_m depth_m insertion_m lateral_error_m speed "
           "cutting_n attracted_n friction_n puncture_n clamping_n hub_n bone_n palpation_n").split()
DOUBLES = 22


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def poses():
    """Slow strokes of 25 mm with a hand's tremor across, a short stop, a tilt."""
    rows = []
    for i in range(TICKS):
        t = i / 1000
        tilt = 0.02 * math.sin(2 * math.pi * 0.3 * t)
        rows.append((2e-4 * math.sin(2 * math.pi * 9 * t), 1e-4 * math.sin(2 * math.pi * 7 * t),
                     0.005 - 0.03 * (0.5 - 0.5 * math.cos(2 * math.pi * t / 8)),
                     math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0))
    return rows


def compare(sample, installed, sim, folder, rows):
    profile = ROOT / "db/samples" / f"{sample}.json"
    out, table = folder / "out.bin", folder / "sim.csv"
    print(sample, run(installed, profile, folder / "poses.bin", out).strip(), end=", ")
    run(sim, "run", "--profile", profile, "--trajectory", folder / "poses.csv", "--out", table, "--replace")
    values = array.array("d", out.read_bytes())
    assert len(values) == DOUBLES * TICKS, len(values)
    compared = contact = 0
    with open(table, newline="") as file:
        for i, row in enumerate(csv.DictReader(file)):
            for column, name in enumerate(COLUMNS):
                if name not in row:
                    continue
                own, theirs = values[DOUBLES * i + column], float(row[name])
                assert own == theirs or (math.isnan(own) and math.isnan(theirs)), f"{sample}, tick {i}, {name}: {own} and {theirs}"
                compared += 1
            contact += row["phase"] != "FREE"
    assert contact > TICKS / 4, f"{sample}: {contact} ticks in tissue"
    print(f"{compared} values equal, {contact} ticks in tissue")
    return compared


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path)
    build = parser.parse_args().build
    with tempfile.TemporaryDirectory(prefix="needlelab_library_") as name:
        folder = pathlib.Path(name)
        prefix, sim = pathlib.Path("/usr"), "needlelab-sim"
        if build:
            prefix, sim = folder / "usr", build / "bin/needlelab-sim"
            for component in ("needlelab-haptics", "needlelab", "dev"):
                run("cmake", "--install", build, "--prefix", prefix, "--component", component)
        environment = dict(os.environ, PKG_CONFIG_PATH=str(prefix / "lib/pkgconfig"), LD_LIBRARY_PATH=str(prefix / "lib"),
                           CMAKE_PREFIX_PATH=str(prefix))
        flags = lambda package: run("pkg-config", "--cflags", "--libs", package, env=environment).split()
        strict = ["-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
        here = ROOT / "tests/library"
        run("cc", "-std=c11", *strict, here / "run_poses.c", *flags("needlelab"), "-o", folder / "run_poses")
        # a C++ project that finds the package as CMake does
        (folder / "project").mkdir()
        (folder / "project/CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.18)\nproject(own CXX)\nfind_package(needlelab 1.0 REQUIRED)\n"
            f"add_executable(own_scene {here / 'own_scene.cpp'})\ntarget_link_libraries(own_scene needlelab::needlelab-haptics)\n")
        run("cmake", "-S", folder / "project", "-B", folder / "project/build", env=environment)
        run("cmake", "--build", folder / "project/build", env=environment)
        run(folder / "project/build/own_scene", env=environment)
        # the example, as its first lines say
        example = prefix / "share/doc/libneedlelab-dev/examples/device_loop.c"
        assert len(example.read_text().splitlines()) <= 60
        run("cc", *strict, example, *flags("needlelab-haptics"), "-lm", "-o", folder / "device_loop")
        said = run(folder / "device_loop", env=environment)
        assert max(float(n) for n in re.findall(r"(-?[0-9.]+) N along z", said)) > 0.5, said
        # the engine's library needs the C++ library only, and neither shows more than its interface
        engine = prefix / "lib/libneedlelab-haptics.so.1"
        needed = set(re.findall(r"NEEDED.*\[(lib[^]]*?)[.]so", run("readelf", "-d", engine)))
        assert needed <= {"libstdc++", "libm", "libgcc_s", "libc"}, needed
        for library in (engine, prefix / "lib/libneedlelab.so.1"):
            shown = [line.split()[-1] for line in run("nm", "-D", "--defined-only", library).splitlines()]
            assert all(re.match(r"nl_|NEEDLELAB_", symbol) for symbol in shown), shown

        rows = poses()
        array.array("d", [number for row in rows for number in row]).tofile(open(folder / "poses.bin", "wb"))
        with open(folder / "poses.csv", "w") as file:
            file.write("t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n")
            file.writelines(f"{i / 1000!r},{','.join(map(repr, row))}\n" for i, row in enumerate(rows))
        os.environ["LD_LIBRARY_PATH"] = environment["LD_LIBRARY_PATH"]
        total = sum(compare(sample, folder / "run_poses", sim, folder, rows) for sample in SAMPLES)
        print(f"{total} values")
        assert total == len(SAMPLES) * TICKS * (len(COLUMNS) - 1), "the names of columns"


if __name__ == "__main__":
    main()
