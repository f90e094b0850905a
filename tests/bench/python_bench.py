#!/usr/bin/python3
"""What a tick and a sample cost from Python: python_bench.py BUILD [RECORDING]

BUILD: a release build with the target needlelab-python. Processor time, median (least to greatest) of seven rounds."""
import ctypes
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

build = pathlib.Path(sys.argv[1]).resolve()
root = pathlib.Path(__file__).resolve().parents[2]
for name in ("libneedlelab-haptics.so.1", "libneedlelab.so.1"):
    ctypes.CDLL(str(build / "lib" / name), ctypes.RTLD_GLOBAL)
sys.path.insert(0, str(build / "lib/python3"))
import needlelab  # noqa: E402


def cost(what, per, work):
    rounds = []
    for _ in range(7):
        began = time.process_time()
        work()
        rounds.append((time.process_time() - began) / per * 1e9)
    print(f"{what}: {statistics.median(rounds):.0f} ns ({min(rounds):.0f} to {max(rounds):.0f})")


ticks = 400_000
t = np.arange(ticks) / 1000
poses = np.zeros((ticks, 7))
poses[:, 0] = 2e-4 * np.sin(2 * np.pi * 9 * t)
poses[:, 2] = 0.005 - 0.015 * (1 - np.cos(2 * np.pi * t / 8))
poses[:, 3] = 1
scene = needlelab.load(str(root / "db/samples/paper-six-layers.json"))
cost("forces(), a tick", ticks, lambda: scene.forces(poses))
cost("run(), a tick", ticks, lambda: scene.run(poses))
rows, engine = poses[:100_000].tolist(), scene.engine()
cost("step() in a loop of Python, a tick", len(rows), lambda: [engine.step(*row) for row in rows])
own = scene.with_law(lambda x_m, speed_m_s, depth_m, insertion_m, layer: -300.0 * x_m if x_m > 0 else 0.0)
cost("a law in Python, a tick", len(rows), lambda: own.forces(poses[:len(rows)]))
with tempfile.TemporaryDirectory() as folder:
    source, library = pathlib.Path(folder, "law.c"), pathlib.Path(folder, "law.so")
    source.write_text("#include <needlelab/haptics.h>\n"
                      "double law(const nl_law_input* in, void* user) { return in->x_m > 0 ? -300.0 * in->x_m : 0.0; }\n")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", f"-I{root}/common/library/include", source, "-o", library], check=True)
    address = ctypes.cast(ctypes.CDLL(str(library)).law, ctypes.c_void_p).value
fast = scene.with_law(address)
assert np.array_equal(fast.forces(poses[:len(rows)]), own.forces(poses[:len(rows)]))
cost("the same law in C, a tick", ticks, lambda: fast.forces(poses))
recording = sys.argv[2] if len(sys.argv) > 2 else str(root / "tests/data/scoring/gesture-1.nlrec")
count = len(needlelab.read_recording(recording).samples)
cost(f"read_recording(), a sample of {count}", count, lambda: needlelab.read_recording(recording).samples["force_n"].sum())
