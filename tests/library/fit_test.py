#!/usr/bin/env python3
"""Which law fit.py names on curves whose law is known: fit_test.py --build BUILD

Four specimens at two speeds. A set spreads one number of the law by up to 25 % between specimens. Right is the law itself, or one
that predicts the true curves to within the noise. NEEDLELAB_LONG=1: every number of every law, 20 seeds."""
import argparse
import inspect
import multiprocessing
import os
import pathlib
import sys
import tempfile
from types import SimpleNamespace

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import examples  # noqa: E402

NOISE_N, DEPTH_M, SPEEDS_M_S = 0.02, np.arange(200) * 1e-4, (0.002, 0.02)


# ---- the laws, written here independently

def voigt(depth_m, speed_m_s, surface_m=0.002, stiffness=60.0, damping=20.0):
    return np.where(depth_m < surface_m, 0, stiffness * (depth_m - surface_m) + damping * speed_m_s)


def walls(depth_m, speed_m_s, surface_m=0.002, stiffness=1000.0, first_n=0.5, second_n=1.5, third_n=0.8, first_m=0.006, second_m=0.006):
    """A wall follows the tip so that its spring never holds more than the layer's cutting force."""
    tops = surface_m + np.array([0, first_m, first_m + second_m])
    force, forces = 0.0, []
    for before, depth in zip([depth_m[0], *depth_m], depth_m):
        stretched = depth - max(before, surface_m)
        layer = np.searchsorted(tops, depth, side="right") - 1
        force = 0.0 if layer < 0 else min(force + stiffness * max(stretched, 0), (first_n, second_n, third_n)[layer])
        forces.append(force)
    return np.array(forces)


def okamura(depth_m, speed_m_s, surface_m=0.002, linear=60.0, quadratic=12000.0, puncture_n=0.9, cutting_n=0.3, friction=20.0):
    """Okamura, Simone and O'Leary 2004: stiffness to a puncture, then cutting and friction along the shaft."""
    z = np.maximum(0, depth_m - surface_m)
    stiff = linear * z + quadratic * z * z
    return np.where(stiff < puncture_n, stiff, cutting_n + friction * z)


def no_law(depth_m, speed_m_s, random):
    """0.5 N and noise of up to 0.3 N, correlated over a millimetre."""
    off, forces = 0.0, []
    for _ in depth_m:
        off += 0.1 * (0.9 * random.uniform(-1, 1) - off)
        forces.append(0.5 + off)
    return np.array(forces)


TRUE = {voigt: ("VOIGT",), walls: ("ENHANCED_TRACKING_WALL, 3 layers",), okamura: ("OKAMURA",), no_law: ()}
NEVER = {voigt: ("DIRECT", "ENHANCED_TRACKING_WALL", "GOD_OBJECT", "FIRST_ORDER", "OKAMURA"), walls: ("VOIGT", "GOD_OBJECT", "FIRST_ORDER", "OKAMURA"),
         okamura: ("VOIGT", "DIRECT", "ENHANCED_TRACKING_WALL, 1", "ENHANCED_TRACKING_WALL, 2", "ENHANCED_TRACKING_WALL, 3", "TRACKING_WALL"), no_law: ("",)}


def numbers(law):
    return [name for name in list(inspect.signature(law).parameters)[2:] if name != "random"]


def curves(law, spread, seed, specimens=4, speeds_m_s=SPEEDS_M_S):
    random, read = np.random.default_rng(seed), []
    for specimen in range(specimens):
        own = {"random": random} if law is no_law else {}
        if spread:
            own[spread] = inspect.signature(law).parameters[spread].default * (1 + 0.25 * random.uniform(-1, 1))
        for speed_m_s in speeds_m_s:
            force_n = law(DEPTH_M, speed_m_s, **own) + NOISE_N * random.uniform(-1, 1, len(DEPTH_M))
            read.append(SimpleNamespace(name=f"{specimen} {speed_m_s}", specimen=str(specimen), speed_m_s=speed_m_s, depth_m=DEPTH_M, force_n=force_n,
                                        phase=np.zeros(len(DEPTH_M), np.uint8)))
    return read


def judge(asked):
    """(set, what was named, what is wrong with that)."""
    import fit
    law, spread, seed = asked
    result = fit.compare([fit.Curve(c) for c in curves(law, spread, seed)], fit.library(3))
    named, wrong = result["named"], ""
    rows = {row["law"]: row for row in result["rows"]}
    if any(name.startswith(never) for name in named for never in NEVER[law]):
        wrong = "a law that cannot be true is named"
    elif TRUE[law] and not set(TRUE[law]) & set(named):
        # of a bin's error a part is the rows' noise
        off_n = np.sqrt(max(0, np.mean(np.square(rows[named[0]]["known_n"])) - NOISE_N**2 / 3 / 2.5)) if named else np.inf
        wrong = "" if off_n < NOISE_N / 3**0.5 else f"not the true law, and off by {off_n:.3f} N"
    return f"{law.__name__}{', ' + spread if spread else ''}, seed {seed}", "; ".join(named) or "none", wrong


def truths(long_form):
    if long_form:
        sets = [(law, spread, seed) for seed in range(1, 21) for law in TRUE for spread in [None, *numbers(law)]]
    else:
        sets = [(voigt, "damping", 1), (walls, "second_n", 1), (okamura, "puncture_n", 1), (no_law, None, 7)]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        said = []
        for one in pool.imap(judge, sets):
            said.append(one)
            print("{}: {}{}".format(*one[:2], f" -- {one[2]}" if one[2] else ""), flush=True)
    wrong = [one for one in said if one[2]]
    print(f"{len(said)} sets, {len(wrong)} answered wrongly")
    assert not wrong


def population_by_formula():
    """Where every specimen is known equally well, the mean is the specimens' mean, and the spread what is left of their variance."""
    import fit
    thetas, known = np.array([[1.0, 2.0], [3.0, 2.5], [2.0, 1.5], [4.0, 3.0]]), 0.3
    mean, spread = fit.population([(theta, known**2 * np.eye(2)) for theta in thetas])
    assert np.allclose(mean, thetas.mean(axis=0), atol=1e-3)
    assert np.allclose(spread**2, thetas.var(axis=0) - known**2, rtol=0.02), spread**2


def program(folder, run):
    """The program on a folder: its list, a law of one's own, and what too little data cannot tell."""
    import json
    for k, curve in enumerate(curves(voigt, None, 3)):
        rows = "".join(f"{d:.6f},{f:.6f},{curve.speed_m_s},{curve.specimen},18G,gel\n" for d, f in zip(curve.depth_m, curve.force_n))
        (folder / f"{k}.csv").write_text("depth_m,force_n,speed_m_s,specimen,needle,tissue\n" + rows)
    (folder / "own.py").write_text("import numpy as np\n\ndef damped(depth_m, speed_m_s, skin_m=0.001, k=30.0, c=5.0):\n"
                                   "    return np.where(depth_m < skin_m, 0, k * (depth_m - skin_m) + c * speed_m_s)\n")
    listed = run("--data", folder, "--list")
    assert "8 curves, 4 specimens" in listed and "0.csv: specimen 0, needle 18G, tissue gel, 0.002 m/s, rows in 200, at rest 0, out 0" in listed, listed
    said = run("--data", folder, "--law", f"{folder}/own.py:damped", "--only", "VOIGT", "--json", folder / "out.json")
    assert "named: VOIGT; damped" in said, said
    damped = json.loads((folder / "out.json").read_text())["tissues"]["gel"]["rows"][-1]["population"]
    assert abs(damped["k"]["typical"] - 60) < 1 and abs(damped["c"]["typical"] - 20) < 0.5 and abs(damped["skin_m"]["typical"] - 0.002) < 1e-4, damped
    for k in range(4, 8):
        (folder / f"{k}.csv").unlink()
    said = run("--data", folder, "--only", "VOIGT")
    assert "named: none" in said and "2 specimens: at least 3 are needed to name a law" in said, said


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="needlelab_fit_") as name:
        run = examples.installed(options.build, pathlib.Path(name), "fit.py")
        population_by_formula()
        program(pathlib.Path(name), run)
        truths(os.environ.get("NEEDLELAB_LONG") == "1")


if __name__ == "__main__":
    main()
