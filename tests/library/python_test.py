#!/usr/bin/env python3
"""The Python module from installed files: python_test.py [--build BUILD] [--plots]

A run has the bits of `needlelab-sim run`, a score those of `needlelab-sim score`; the page's programs run (--plots: also those
that draw). Without --build: of the packages."""
import argparse
import csv
import ctypes
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "db/samples"
RECORDING = ROOT / "tests/data/scoring/gesture-1.nlrec"
TICKS = 20000
PHASES = ["FREE", "INSERTING", "STOPPED", "WITHDRAWING"]
CHECK = [ROOT / "db/samples/paper-six-layers.json", ROOT / "db/samples/volumes/shoulder-median.json"]


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def strokes():
    t = np.arange(TICKS) / 1000
    poses = np.zeros((TICKS, 7))
    poses[:, 0] = 2e-4 * np.sin(2 * np.pi * 9 * t)
    poses[:, 2] = 0.005 - 0.015 * (1 - np.cos(2 * np.pi * t / 8))
    poses[:, 3] = 1
    return poses


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


def runs_as_the_program(needlelab, sim, folder):
    poses = strokes()
    with open(folder / "poses.csv", "w") as file:
        file.write("t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n")
        for i, row in enumerate(poses.tolist()):
            file.write(f"{i / 1000!r},{','.join(map(repr, row))}\n")
    values = 0
    for profile in CHECK:
        run(sim, "run", "--profile", profile, "--trajectory", folder / "poses.csv", "--out", folder / "run.csv", "--replace")
        with open(folder / "run.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        scene = needlelab.load(str(profile))
        report = scene.run(poses)
        columns = {f"f{axis}_n": report["force_n"][:, i] for i, axis in enumerate("xyz")}
        columns |= {f"t{axis}_nm": report["torque_nm"][:, i] for i, axis in enumerate("xyz")}
        columns |= {f"w{axis}_m": report["wall_m"][:, i] for i, axis in enumerate("xyz")}
        columns |= {name: report[name] for name in report.dtype.names if name in rows[0]}
        assert len(columns) >= 20, sorted(columns)
        for name, column in columns.items():
            number = PHASES.index if name == "phase" else float
            assert same(column.astype(float), np.array([number(row[name]) for row in rows])), f"{profile}: {name}"
            values += TICKS
        assert same(scene.forces(poses), report["force_n"])
        engine = scene.engine()
        for row in poses[:3000].tolist():
            force = engine.step(*row)
        other = engine.copy()
        assert engine.step(*poses[3000]) == other.step(*poses[3000]) == tuple(report["force_n"][3000])
        assert force == tuple(report["force_n"][2999]) and other.report["depth_m"] == report["depth_m"][3000]
    print(f"{values} values equal those of needlelab-sim run")
    assert values >= 800_000


def scores_as_the_program(needlelab, sim):
    profile = SAMPLES / "shoulder-adult.json"
    read = needlelab.read_recording(str(RECORDING))
    samples, rate_hz = read.samples, read.rate_hz
    assert np.shares_memory(samples["force_n"], samples) and not samples.flags.owndata and read.holes == []
    del read  # the view keeps it
    rows = needlelab.score(samples, rate_hz, needlelab.load(str(profile)))
    said = json.loads(run(sim, "score", "--recorded", RECORDING, "--profile", profile, "--json"))
    said = {row["measure"]: row["value"] for row in said["rows"]}
    assert {row.name: row.value for row in rows} == said and len(said) > 30, (len(rows), len(said))
    print(f"{len(said)} measures equal those of needlelab-sim score")


def laws(needlelab):
    scene, poses = needlelab.load(str(CHECK[0])), strokes()
    law = lambda x_m, speed_m_s, depth_m, insertion_m, layer: -300 * x_m if x_m > 0 else 0.0
    sprung = scene.with_law(law, 300).run(poses)
    inside = sprung["layer"] >= 0
    assert inside.any() and np.allclose(sprung["cutting_n"][inside], -300 * sprung["depth_m"][inside], atol=0.03)

    def raises(*_):
        raise KeyError("mine")
    for wrong, kind, words in [(lambda: scene.with_law(raises).run(poses), KeyError, "mine"),
                               (lambda: needlelab.load("nowhere.json"), ValueError, "nowhere.json"),
                               (lambda: needlelab.load(str(CHECK[0]), 7), ValueError, "rate_hz"),
                               (lambda: needlelab.load(str(CHECK[0]), model="SPRING"), ValueError, "SPRING"),
                               (lambda: needlelab.load(str(CHECK[1])).with_law(law), ValueError, "body"),
                               (lambda: scene.run(np.zeros((3, 6))), ValueError, "(n, 7)")]:
        try:
            wrong()
        except kind as error:
            assert words in str(error), error
        else:
            raise AssertionError(f"no {kind.__name__} with '{words}'")
    assert set(scene.run(poses[:1]).dtype.names) <= set(needlelab.units)


def curves(needlelab, folder):
    """A curve in, at rest and out comes as it was written, by views that keep the set; options are checked."""
    data = folder / "curves"
    data.mkdir()
    way = [0.001 * k for k in range(11)]
    rows = [("insert", k * 0.1, d, 100 * d) for k, d in enumerate(way)] + [("hold", 1.1 + k * 0.1, 0.01, 0.8) for k in range(10)]
    rows += [("withdraw", 2.1 + k * 0.05, d, -10 * d) for k, d in enumerate(reversed(way))]
    (data / "a.csv").write_text("phase,t_s,depth_m,force_n\n" + "".join(f"{p},{t:.3f},{d:.4f},{f:.4f}\n" for p, t, d, f in rows))
    (data / "data_set.json").write_text('{"name": "three ways", "curves": [{"file": "a.csv", "specimen": "s", "needle": "n", "tissue": "gel", "needle_diameter_m": 0.001}]}')
    read = needlelab.read_curves(str(data))
    [one] = read.curves
    assert (one.name, one.specimen, one.needle, one.tissue, one.diameter_m) == ("a.csv", "s", "n", "gel", 0.001) and abs(one.speed_m_s - 0.01) < 1e-12
    assert read.metadata["name"] == "three ways" and any("data_set.json" in note for note in read.metadata["notes"])
    depth, force = one.depth_m, one.force_n
    assert not depth.flags.writeable and not depth.flags.owndata
    del read
    assert one.phase.tolist() == [0] * 11 + [1] * 10 + [2] * 11
    assert np.allclose(depth, [row[2] for row in rows]) and np.allclose(force, [row[3] for row in rows])
    # a phase begins where the one before ended
    own = one.t_s - np.where(one.phase == 0, 0, np.where(one.phase == 1, 1.0, 1.9))
    assert np.allclose(own, [0.1 * k for k in range(11)] + [0.1 * k for k in range(10)] + [0.05 * k for k in range(11)])
    assert np.allclose(needlelab.read_curves(str(data), force_unit="mN").curves[0].force_n, force / 1000)
    for options, words in [({"force_unit": "lb"}, '"lb" is not one of N, mN, gf, kgf'), ({"negate": ["time"]}, "depth or force"), ({"lines_above": -1}, "0 to 1000"),
                           ({"tare": 1}, "true or false"), ({"encoding": "latin-9"}, "windows-1252"), ({"units": "N"}, "unknown field")]:
        try:
            needlelab.read_curves(str(data), **options)
        except ValueError as error:
            assert words in str(error), error
        else:
            raise AssertionError(f"{options} were taken")


def page(folder, environment, plots):
    """Each program of the page, as a reader copies it."""
    text = (ROOT / "common/python/README.md").read_text()
    programs = re.findall(r"`(\w+\.py)`[^\n]*\n\n```python\n(.*?)```", text, re.DOTALL)
    assert [name for name, _ in programs] == ["plot.py", "compare.py", "own_law.py"]
    arguments = {"plot.py": [RECORDING, "plot.png"], "compare.py": [RECORDING, SAMPLES / "shoulder-adult.json"],
                 "own_law.py": [CHECK[0]]}
    for name, program in programs:
        if "matplotlib" in program and not plots:
            continue
        (folder / name).write_text(program)
        print(run("/usr/bin/python3", name, *arguments[name], cwd=folder, env=environment).strip())


def installed(build, prefix):
    """Installs a build's components, for this process and, by the environment returned, for others."""
    for component in ("needlelab-haptics", "needlelab", "dev", "python"):
        run("cmake", "--install", build, "--prefix", prefix, "--component", component)
    packages = prefix / "lib/python3/dist-packages"
    for library in ("libneedlelab-haptics.so.1", "libneedlelab.so.1"):
        ctypes.CDLL(str(prefix / "lib" / library), ctypes.RTLD_GLOBAL)
    sys.path.insert(0, str(packages))
    return dict(os.environ, LD_LIBRARY_PATH=str(prefix / "lib"), PYTHONPATH=str(packages), PKG_CONFIG_PATH=str(prefix / "lib/pkgconfig"))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path)
    parser.add_argument("--plots", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="needlelab_python_") as name:
        folder = pathlib.Path(name)
        environment, sim = dict(os.environ), "needlelab-sim"
        if options.build:
            sim, environment = options.build / "bin/needlelab-sim", installed(options.build, folder / "usr")
        import needlelab
        runs_as_the_program(needlelab, sim, folder)
        scores_as_the_program(needlelab, sim)
        laws(needlelab)
        curves(needlelab, folder)
        page(folder, environment, options.plots)


if __name__ == "__main__":
    main()
