#!/usr/bin/env python3
"""power.py against published numbers, against simulated studies, and on tables as needlelab-admin writes them: power_test.py --build BUILD"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import examples  # noqa: E402

STUDIES = 20000


def published():
    """Cohen 1988, table 2.4.1 (two-sided 5 %, power 80 %), and G*Power's 64 and 26 for d = 0.5 and 0.8."""
    import power
    assert [power.trainees_for(d) for d in (0.2, 0.5, 0.8, 1.0, 1.4)] == [394, 64, 26, 17, 10]
    assert power.trainees_for(1e-4) is None
    assert abs(power.power(1e-6, 10) - 0.05) < 1e-6  # nothing to find: the level


def simulated():
    """Of studies drawn at the smallest difference, 80 % find it; the test here is written out."""
    import power
    from scipy.stats import t
    random = np.random.default_rng(7)
    for n in (4, 8, 24):
        a = random.normal(0, 1, (STUDIES, n))
        b = random.normal(power.smallest(n), 1, (STUDIES, n))
        spread = np.sqrt((a.var(axis=1, ddof=1) + b.var(axis=1, ddof=1)) / 2)
        found = np.abs(a.mean(axis=1) - b.mean(axis=1)) / (spread * np.sqrt(2 / n)) > t.ppf(0.975, 2 * n - 2)
        off = abs(found.mean() - 0.8) / np.sqrt(0.16 / STUDIES)
        print(f"{n} in each group: {100 * found.mean():.1f} % of {STUDIES} studies find {power.smallest(n):.2f} spreads")
        assert off < 4, off


def tables(folder, run):
    """A trainee counts once, by the mean; groups, units in the header, decimal commas."""
    rows = ["Person;Groups;Exercise;Path length [mm]"]
    means = {"novices": (100, 110, 120, 130), "experts": (80, 85, 95, 100)}
    for group, values in means.items():
        for k, mean in enumerate(values):
            rows += [f"{group}{k};{group};a;{mean - 1},5", f"{group}{k};{group};b;{mean + 1},5", f"{group}{k};{group};c;"]
    (folder / "results.csv").write_text("\ufeff" + "\r\n".join(rows) + "\r\n")
    said = run("--scores", folder / "results.csv", "--measure", "path length", "--groups", "Groups", "--trainees", 4, "--difference", 20)
    a, b = (np.array(values) + 0.5 for values in means.values())
    spread = np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / 2)
    for text in (f"novices: 4 trainees, mean {a.mean():.4g}", f"within groups: {spread:.4g}", f"Hedges' g {(b.mean() - a.mean()) / spread * (1 - 3 / 23):.2f}",
                 f"({20 / spread:.2f} spreads) wants"):
        assert text in said, (text, said)
    for words, text in ((["--scores", folder / "results.csv", "--measure", "force"], "column 'force': none"),
                        (["--scores", folder / "results.csv", "--measure", "Exercise"], "line 2, column 'Exercise': 'a' is not a number"),
                        (["--scores", folder / "results.csv", "--measure", "path length", "--groups", "Person"], "8 groups"),
                        (["--spread", 1, "--trainees", 1], "--trainees 1: at least 2"), (["--spread", 0], "not above 0")):
        refused = subprocess.run(run.words(*words), capture_output=True, text=True, env=run.environment)
        assert refused.returncode == 2 and text in refused.stderr, refused


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="needlelab_power_") as name:
        run = examples.installed(options.build, pathlib.Path(name), "power.py")
        published()
        simulated()
        tables(pathlib.Path(name), run)


if __name__ == "__main__":
    main()
