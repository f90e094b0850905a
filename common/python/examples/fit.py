#!/usr/bin/env python3
"""Laws on measured force curves: which one predicts a specimen that it was not fitted on (FIT.md).

usage: fit.py --data FOLDER [--law FILE.py:FUNCTION]… [--list] [--json FILE]"""
import argparse
import functools
import importlib.util
import inspect
import json
import sys

import needlelab
import numpy as np

STEP_M, BIN_M, ABOVE_M = 2e-5, 2.5e-4, 1e-3
WIDE = 3.0  # weakest knowledge of a number: its logarithm, or a place in mm, within this of where the fit began
MIN_SPECIMENS = 3
# the stiffest, so that a force that has given way is soon what the law says; slower than any curve, so that nothing stops
WALL = {"stiffness_n_per_m": 1e4, "stop_speed_m_s": 5e-5, "stop_dwell_s": 0.05, "stop_duration_s": 0.8}


# ---- laws: numbers -> force in N at depths from the skin's place in the file

class Law:
    """`numbers`: name -> greatest value; `surface_m` and `rupture_m` are places, all others are above 0."""

    def __init__(self, name, numbers, starts, force, members=(), tail=1.0):
        self.name, self.numbers, self.starts, self.force, self.members, self.tail = name, numbers, starts, force, members, tail
        self.places = np.array([number in ("surface_m", "rupture_m") for number in numbers])
        self.most = np.array(list(numbers.values()), float)
        self.steps = np.where(self.places, 0.01, 0.005)

    def values(self, theta):
        return np.where(self.places, theta * 1e-3, np.clip(np.exp(np.clip(theta, -30, 30)), 1e-9, self.most))

    def theta(self, values):
        values = np.asarray(values, float)
        return np.where(self.places, values * 1e3, np.log(np.clip(values, 1e-6, self.most)))


def profile(model, layers, effects=("CUTTING",), **sections):
    return json.dumps({"id": "fit", "name": "fit", "axial_model": model, "needle": {"length_m": 0.9}, "max_force_n": 50, "effects": list(effects),
                       "limb": {"plane": {"point_m": {"x": 0, "y": 0, "z": 0}, "normal": {"x": 0, "y": 0, "z": 1}}}, "layers": layers,
                       "shaft_friction": {"stiffness_n_per_m": 1e4}, "tracking_wall": WALL} | sections)


def layer(thickness_m, cutting_n=0.0, **sections):
    return {"tissue": "MUSCLE", "thickness_m": thickness_m, "cutting_force_n": cutting_n} | sections


def engine(make, feels_speed=False, skin=lambda v: v[0]):
    """A force from the engine, run in at the curve's speed through the profile that `make` returns of all numbers but the first,
    which is a place: moving the skin needs no run of its own."""
    @functools.lru_cache(maxsize=64)
    def run(values, member, speed_m_s, to_m):
        rate_hz = float(np.clip(speed_m_s / STEP_M, 50, 40000))
        x = np.arange(-ABOVE_M, to_m, speed_m_s / rate_hz)
        poses = np.zeros((len(x), 7))
        poses[:, 2], poses[:, 3] = -x, 1
        return x, needlelab.load(make(values, member), rate_hz).forces(poses)[:, 2]

    def force(depth_m, speed_m_s, values, member=None):
        inside_m = depth_m - skin(values)
        to_m = 5e-3 * np.ceil(max(inside_m[-1], 0) / 5e-3 + 0.1)
        return np.interp(inside_m, *run(tuple(values[1:]), member, speed_m_s if feels_speed else 0.01, to_m), left=0.0)
    return force


def library(most_layers):
    """The engine's axial models. Members of a family are tried with its first member's numbers."""
    def voigt(v, _):
        return profile("VOIGT", [layer(0.9, 1.0)], voigt={"stiffness_n_per_m": v[0], "damping_ns_per_m": v[1]})

    def walls(model):
        def made(v, member):
            count = len(v) // 2
            layers = [layer(thick, v[i + 1]) for i, thick in enumerate([*v[count + 1:], 0.4])]
            return profile(member or model, layers, direct={"stiffness_n_per_m": v[0]}, tracking_wall=WALL | {"stiffness_n_per_m": v[0]})
        return made

    def god_object(v, _):
        return profile("GOD_OBJECT", [layer(0.9, v[1])], god_object={"stiffness_n_per_m": min(v[1] / v[0], 1e4)})

    def first_order(v, _):
        return profile("FIRST_ORDER", [layer(0.9, first_order={"stiffness_n_per_m": min(v[1] / v[0], 1e4), "puncture_force_n": v[1], "cutting_force_n": v[2],
                                                               "friction_n_per_m": v[3]})])

    def spring(v):
        return {"linear_n_per_m": min(v[2] * v[1] / v[0], 1e4), "quadratic_n_per_m2": min((1 - v[2]) * v[1] / v[0] ** 2, 1e9)}

    def okamura(v, member):
        own = {"puncture_force_n": v[1], "cutting_force_n": v[3], "kinetic_in_n_per_m": v[4], "kinetic_out_n_per_m": v[4], "viscous_in_ns_per_m2": v[5]}
        return profile(member or "OKAMURA", [layer(0.9, okamura=own | spring(v))])

    def membrane(v, _):
        return profile("ENHANCED_TRACKING_WALL", [layer(0.9, v[3], puncture={"force_n": v[1]} | spring(v))], ("CUTTING", "PUNCTURE"))

    force, friction = 50.0, 1e4
    skin, top = {"surface_m": 1.0}, {"rupture_m": 1.0, "stretch_m": 0.5, "rupture_n": force}
    laws = [Law("VOIGT", skin | {"stiffness_n_per_m": 1e4, "damping_ns_per_m": 1e3}, lambda d: [[d.top_m, d.slope, 5.0]], engine(voigt, True))]
    for count in range(1, most_layers + 1):
        numbers = skin | {"stiffness_n_per_m": 1e4} | {f"cutting_n {i}": force for i in range(count)} | {f"thickness_m {i}": 0.15 for i in range(count - 1)}
        for model, members in (("ENHANCED_TRACKING_WALL", ("TRACKING_WALL",)), ("DIRECT", ())):
            laws.append(Law(f"{model}, {count} layer{'s' * (count > 1)}", numbers, lambda d, count=count: [d.layers(count)], engine(walls(model)), members))

    def ruptures(name, numbers, starts, make, members=(), feels_speed=False):
        def more(d):
            return [[*at, *start] for at in d.ruptures() for start in starts(d)]
        laws.append(Law(name, top | numbers, more, engine(make, feels_speed, lambda v: v[0] - v[1]), members))

    ruptures("GOD_OBJECT", {}, lambda d: [[]], god_object)
    ruptures("FIRST_ORDER", {"cutting_n": force, "friction_n_per_m": friction}, lambda d: [[d.after_n, d.friction]], first_order)
    ruptures("OKAMURA", {"linear share": 1.0, "cutting_n": force, "kinetic_n_per_m": friction, "viscous_ns_per_m2": 1e5},
             lambda d: [[share, d.after_n, d.friction, 10.0] for share in (0.3, 0.8)], okamura, ("DAHL",), True)
    ruptures("ENHANCED_TRACKING_WALL, membrane", {"linear share": 1.0, "cutting_n": force}, lambda d: [[share, d.after_n] for share in (0.3, 0.8)], membrane)
    return laws


def own(text):
    """FILE.py:FUNCTION, a function (depth_m, speed_m_s, number=start, …) that returns N; each number is above 0."""
    path, _, name = text.rpartition(":")
    if not path.endswith(".py"):
        raise ValueError(f"--law {text}: FILE.py:FUNCTION is expected")
    spec = importlib.util.spec_from_file_location("own_law", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    function = getattr(module, name)
    starts = {key: p.default for key, p in list(inspect.signature(function).parameters.items())[2:]}
    for key, start in starts.items():
        if not (isinstance(start, (int, float)) and start > 0):
            raise ValueError(f"{text}: '{key}' wants a default above 0, from which it is fitted")
    return Law(name, dict.fromkeys(starts, np.inf), lambda _: [list(starts.values())], lambda depth_m, speed, values, _=None: function(depth_m, speed, *values))


def without_law():
    """What a law must beat: one force, that of the whole curve, or of its end."""
    return [Law(name, {"force_n": 100.0}, lambda d: [[max(d.mean_n, 1e-3)]], lambda depth_m, _, values, __=None: np.full_like(depth_m, values[0]), tail=tail)
            for name, tail in (("the mean force", 1.0), ("the last force", 0.05))]


# ---- curves, in bins

class Curve:
    """A way in: means of the rows in bins of 0.25 mm, and what of a law's force these rows see."""

    def __init__(self, read):
        inside = read.phase == 0
        self.name, self.specimen, self.speed = read.name, read.specimen, read.speed_m_s
        self.depth_m, force_n = read.depth_m[inside], read.force_n[inside]
        index = np.floor((self.depth_m - self.depth_m[0]) / BIN_M).astype(int)
        self.first = np.flatnonzero(np.diff(index, prepend=-1))
        self.rows = np.diff(self.first, append=len(index))
        self.at_m, self.force_n = self.means(self.depth_m), self.means(force_n)
        self.half_m = max(np.median(np.diff(self.depth_m)), STEP_M) / 2  # a row stands for what is around it
        self.grid_m = np.arange(self.depth_m[0] - self.half_m - STEP_M, self.depth_m[-1] + self.half_m + 2 * STEP_M, STEP_M)
        change = force_n[:-2] - 2 * force_n[1:-1] + force_n[2:]
        self.noise_n = np.median(np.abs(change)) / 0.6745 / 6**0.5  # of a row

    def means(self, rows):
        return np.add.reduceat(rows, self.first) / self.rows

    def predicted(self, law, theta, member=None):
        force = law.force(self.grid_m, self.speed, law.values(theta), member)
        area = np.concatenate([[0], np.cumsum((force[1:] + force[:-1]) * STEP_M / 2)])
        ends = np.interp(self.depth_m[:, None] + [-self.half_m, self.half_m], self.grid_m, area)
        return self.means((ends[:, 1] - ends[:, 0]) / (2 * self.half_m))


class Shape:
    """Where a fit begins: contact, the greatest fall, and what follows, of some curves together."""

    def __init__(self, curves):
        self.at_m = np.arange(min(c.at_m[0] for c in curves), max(c.at_m[-1] for c in curves), BIN_M)
        self.force_n = np.mean([np.interp(self.at_m, c.at_m, c.force_n) for c in curves], axis=0)
        at, force = self.at_m, self.force_n
        self.mean_n, greatest = force.mean(), max(force.max(), 1e-3)
        above = np.flatnonzero(force > 0.05 * greatest)
        self.top = max(above[0] - 1, 0) if len(above) else 0
        self.top_m = at[self.top]
        falls = np.array([force[i] - force[i + 1:i + 7].min() if i + 1 < len(force) else 0 for i in range(len(force))])
        peak = int(np.argmax(falls))
        if falls[peak] < 0.1 * greatest:
            peak = (self.top + len(force)) // 2
        self.peak_n, self.stretch_m = max(force[peak], 1e-3), max(at[peak] - self.top_m, 5e-4)
        rest = slice(min(peak + 2, len(force) - 2), None)
        slope, level = np.polyfit(at[rest], force[rest], 1)
        self.friction = max(slope, 0.1)
        self.after_n = max(level + slope * self.top_m, 0.02)
        self.slope = max(np.polyfit(at[self.top:], force[self.top:], 1)[0], 1.0)

    def ruptures(self):
        """Where something may give way: about the greatest fall, soon after contact (cutting alone), never. Place, stretch, force."""
        steps = [[self.top_m + self.stretch_m + change_m, self.stretch_m * longer, self.peak_n] for change_m in (-1e-4, 0, 1e-4) for longer in (1.0, 1.2)]
        end_m = self.at_m[-1] + 1e-3
        return steps + [[self.top_m + 5e-4, 5e-4, max(self.after_n, 0.05)], [end_m, end_m - self.top_m, self.slope * (end_m - self.top_m)]]

    def layers(self, count):
        """Cuts where the squares about the parts' means fall most; then surface, forces, thicknesses."""
        def squares(a, b):
            return ((self.force_n[a:b] - self.force_n[a:b].mean()) ** 2).sum()
        ends = [self.top, len(self.force_n)]
        while len(ends) < count + 1:
            cuts = [(squares(a, c) + squares(c, b) - squares(a, b), c) for a, b in zip(ends, ends[1:]) for c in range(a + 2, b - 1)]
            ends = sorted([*ends, min(cuts)[1]])
        forces = [max(np.median(self.force_n[a:b]), 0.02) for a, b in zip(ends, ends[1:])]
        return [self.top_m, 1000.0, *forces, *(BIN_M * (b - a) for a, b in zip(ends[:-1], ends[1:-1]))]


# ---- least squares in log numbers, for one specimen

def rms(values):
    return float(np.sqrt(np.mean(np.square(np.concatenate(values)))))


def fitted(law, parts, starts, sigma_n, prior=None, tries=2):
    """(theta, covariance, rms in N) of the best fit, begun from the `tries` best of the starts. parts: (curve, mask of bins); prior: (mean, spread)."""
    from scipy.optimize import least_squares  # --list needs no scipy
    curves = [curve for curve, mask in parts]
    masks = [mask if law.tail == 1 else mask & (np.arange(len(mask)) >= (1 - law.tail) * len(mask)) for _, mask in parts]
    measured = np.concatenate([curve.force_n[mask] for curve, mask in zip(curves, masks)])

    def forces(theta):
        return np.concatenate([curve.predicted(law, theta)[mask] for curve, mask in zip(curves, masks)])

    def misfit(start):
        return np.square(forces(start) - measured).sum()

    best = None
    for start in sorted(starts, key=misfit)[:tries]:
        mean, spread = prior or (start, np.full(len(start), WIDE))

        def residuals(theta):
            return np.concatenate([(forces(theta) - measured) / sigma_n, (theta - mean) / spread])

        def slopes(theta):
            at = forces(theta)
            columns = [(forces(theta + step * axis) - at) / (step * sigma_n) for step, axis in zip(law.steps, np.eye(len(theta)))]
            return np.vstack([np.array(columns).T, np.diag(1 / spread)])

        found = least_squares(residuals, start, slopes, x_scale="jac", max_nfev=40, xtol=1e-4, ftol=1e-4)
        if best is None or found.cost < best.cost:
            best = found
    rms_n = rms([(curve.predicted(law, best.x) - curve.force_n)[mask] for curve, mask in parts])
    return best.x, np.linalg.inv(best.jac.T @ best.jac), rms_n


def population(estimates):
    """Mean and spread of the numbers over specimens: the global two-stage method by EM (Davidian and Giltinan 1995,
    ch. 5), with a diagonal spread, since a few specimens do not tell how numbers go together."""
    thetas = np.array([theta for theta, _ in estimates])
    inverse = [np.linalg.inv(covariance) for _, covariance in estimates]
    mean, spread2 = thetas.mean(axis=0), np.maximum(thetas.var(axis=0), 1e-6)
    for _ in range(1000):
        posterior = [np.linalg.inv(c + np.diag(1 / spread2)) for c in inverse]
        shrunk = np.array([p @ (c @ theta + mean / spread2) for p, c, theta in zip(posterior, inverse, thetas)])
        before, mean = spread2, shrunk.mean(axis=0)
        spread2 = np.maximum(np.mean([np.diag(p) for p in posterior] + (shrunk - mean) ** 2, axis=0), 1e-8)
        if np.abs(spread2 / before - 1).max() < 1e-4:
            break
    return mean, np.sqrt(spread2)


# ---- the comparison

def whole(curves):
    return [(curve, np.ones(len(curve.at_m), bool)) for curve in curves]


def halves(curves):
    """(known parts, asked parts): each insertion from the specimen's others; a single one by every second millimetre."""
    if len(curves) > 1:
        return [(whole(curves[:i] + curves[i + 1:]), whole(curves[i:i + 1])) for i in range(len(curves))]
    odd = (curves[0].at_m // 1e-3 % 2).astype(bool)
    return [([(curves[0], mask)], [(curves[0], ~mask)]) for mask in (odd, ~odd)]


class Tried:
    """A law on the specimens: first each whole specimen, then what it predicts."""

    def __init__(self, law, specimens, noise_n):
        self.law, self.specimens, self.noise_n = law, specimens, noise_n
        every = [part for curves in specimens.values() for part in whole(curves)]
        self.pooled = fitted(law, every, self.starts([c for c, _ in every]), noise_n, tries=3)[0]
        self.estimates, self.residuals_n = {}, {}
        for name, curves in specimens.items():
            theta, covariance, rms_n = fitted(law, whole(curves), [self.pooled, *self.starts(curves)], noise_n)
            # what the law does not follow makes its numbers less sure
            self.estimates[name], self.residuals_n[name] = (theta, covariance * max(1, (rms_n / noise_n) ** 2)), rms_n
        self.residual_n = float(np.mean(list(self.residuals_n.values())))
        self.unseen, self.known, self.predicted = [], [], []  # errors by specimen in N; all predicted bins

    def starts(self, curves):
        return [self.law.theta(values) for values in self.law.starts(Shape(curves))]

    def predict(self):
        """Each specimen by the others alone, and each of its insertions with the rest of the specimen known."""
        for name, curves in self.specimens.items():
            others = [other for other in self.specimens if other != name]
            mean, spread = population([self.estimates[other] for other in others])
            sigma_n = max(self.noise_n, float(np.mean([self.residuals_n[other] for other in others])))
            self.unseen.append(rms([c.predicted(self.law, mean) - c.force_n for c in curves]))
            errors = []
            for known, asked in halves(curves):
                theta, _, _ = fitted(self.law, known, [mean, *(self.estimates[other][0] for other in others), *self.starts([c for c, _ in known])], sigma_n, (mean, spread))
                for curve, mask in asked:
                    self.predicted.append(curve.predicted(self.law, theta)[mask])
                    errors.append(self.predicted[-1] - curve.force_n[mask])
            self.known.append(rms(errors))

    def row(self):
        mean, spread = population(list(self.estimates.values()))
        numbers = {name: {"typical": float(value), "spread": float(width * 1e-3 if is_place else width), "of": "m" if is_place else "ln"}
                   for name, value, width, is_place in zip(self.law.numbers, self.law.values(mean), spread, self.law.places)}
        same = [member for member in self.law.members
                if rms([curve.predicted(self.law, self.estimates[name][0], member) - curve.predicted(self.law, self.estimates[name][0])
                        for name, curves in self.specimens.items() for curve in curves]) < self.noise_n]
        return {"law": self.law.name, "same": same, "numbers": len(self.law.numbers), "residual_n": self.residual_n, "unseen_n": self.unseen, "known_n": self.known,
                "population": numbers}


def compare(curves, laws):
    """Rows of all laws on the curves of one tissue, those that are named, and what the data cannot tell."""
    specimens = {}
    for curve in curves:
        specimens.setdefault(curve.specimen, []).append(curve)
    noise_n = max(float(np.median([c.noise_n for c in curves])), 1e-4)
    notes, named = [], []
    bare, tried = [Tried(law, specimens, noise_n) for law in without_law()], []
    for law in laws:
        try:
            tried.append(Tried(law, specimens, noise_n))
        except (ValueError, np.linalg.LinAlgError) as error:
            notes.append(f"{law.name} is left out: {error}")
    if len({c.speed for c in curves}) == 1:
        notes.append("one speed: nothing says how the force depends on it")
    if max(map(len, specimens.values())) == 1:
        notes.append("one insertion of each specimen: it is predicted from every second millimetre of itself")
    if len(specimens) < MIN_SPECIMENS:
        notes.append(f"{len(specimens)} specimen{'s' * (len(specimens) > 1)}: at least {MIN_SPECIMENS} are needed to name a law")
    elif tried:
        named = name_laws(bare, tried, noise_n, notes)
    return {"noise_n": noise_n, "specimens": len(specimens), "insertions": len(curves), "rows": [one.row() for one in bare + tried], "named": named, "notes": notes}


def surely_above(differences, least=0.0):
    """Whether a mean of paired differences over specimens is above `least`, by its 95 % interval."""
    from scipy.stats import t as student
    half = student.ppf(0.975, len(differences) - 1) * np.std(differences, ddof=1) / len(differences) ** 0.5
    return np.mean(differences) - half > 0 and np.mean(differences) > least


def name_laws(bare, tried, noise_n, notes):
    least_n = np.inf
    for one in bare + sorted(tried, key=lambda one: one.residual_n):
        # a law predicts no better than it fits: those that are already behind are not asked
        if one in bare or one.residual_n < least_n + noise_n:
            one.predict()
            least_n = min(least_n, np.mean(one.known))
    asked = sorted((one for one in tried if one.known), key=lambda one: np.mean(one.known))
    floor = min(bare, key=lambda one: np.mean(one.known))
    best = asked[0] if asked else floor
    if best is floor or not surely_above(np.subtract(floor.known, best.known), noise_n):
        notes.append(f"no law is surely better than {floor.law.name} by more than the noise: none is named")
        return []
    equal = [one for one in asked if rms([a - b for a, b in zip(one.predicted, best.predicted)]) < noise_n]
    for one in asked:
        if one not in equal and not surely_above(np.subtract(one.known, best.known)):
            notes.append(f"{one.law.name} predicts otherwise, and these specimens do not show that it is worse")
    if best.residual_n > 2 * noise_n:
        notes.append(f"{best.law.name} leaves {best.residual_n / noise_n:.1f} times the noise: something in the curves is not in it")
    equal.sort(key=lambda one: (len(one.law.numbers), tried.index(one)))
    return [name for one in equal for name in (one.law.name, *one.row()["same"])]


def text(tissue, result):
    lines = [f"{tissue}: {result['specimens']} specimens, {result['insertions']} insertions; noise of a row {result['noise_n']:.3g} N", "",
             f"  {'law':<34} numbers   fit, N  unseen, N   known, N"]
    for row in sorted(result["rows"], key=lambda row: (np.mean(row["known_n"] or np.inf), row["residual_n"])):
        means = [f"{np.mean(row[key]):10.3f}" if row[key] else "         -" for key in ("unseen_n", "known_n")]
        lines.append(f"  {row['law']:<34} {row['numbers']:7d} {row['residual_n']:8.3f} {means[0]} {means[1]}" + "".join(f"  = {one}" for one in row["same"]))
    lines += ["", "named: " + ("; ".join(result["named"]) or "none")]
    for row in result["rows"]:
        if row["law"] in result["named"]:
            lines.append(f"  {row['law']}: " + ", ".join(f"{name} {one['typical']:.3g} (± {one['spread']:.2g} {one['of']})" for name, one in row["population"].items()))
    return "\n".join(lines + [f"note: {note}" for note in result["notes"]])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True, help="folder of tables of force over depth or time (FIT.md)")
    parser.add_argument("--list", action="store_true", help="reads and says what is there; fits nothing")
    parser.add_argument("--law", action="append", default=[], metavar="FILE.py:FUNCTION", help="a law of your own")
    parser.add_argument("--only", action="append", default=[], metavar="TEXT", help="laws of the library whose name begins with this")
    parser.add_argument("--layers", type=int, default=3, help="most layers of the walls (3)")
    parser.add_argument("--json", metavar="FILE", help="writes all results")
    reading = parser.add_argument_group("how the tables are read")
    reading.add_argument("--describe", metavar="FILE", help="facts about the files, instead of the folder's data_set.json")
    reading.add_argument("--negate", action="append", choices=["depth", "force"], help="the files count it the other way")
    reading.add_argument("--lines-above", type=int, metavar="N", help="lines above the header of each file")
    reading.add_argument("--encoding", choices=["windows-1252"], help="unless UTF-8 or UTF-16")
    reading.add_argument("--force-unit", choices=["N", "mN", "gf", "kgf"], help="what force_n is in")
    reading.add_argument("--tare", action="store_true", default=None, help="takes the force above the skin off")
    reading.add_argument("--digitised", action="store_true", default=None, help="points of a figure, in any order")
    options = parser.parse_args()
    names = ("describe", "negate", "lines_above", "encoding", "force_unit", "tare", "digitised")
    try:
        read = needlelab.read_curves(options.data, **{name: getattr(options, name) for name in names if getattr(options, name) is not None})
        laws = [law for law in library(options.layers) if not options.only or law.name.startswith(tuple(options.only))] + [own(law) for law in options.law]
    except (ValueError, OSError, AttributeError) as error:
        print(f"fit.py: {error}", file=sys.stderr)
        return 2
    about = read.metadata
    print(f"{about['name']}: {len(read.curves)} curves, {len({(c.tissue, c.specimen) for c in read.curves})} specimens; licence: {about['licence']}; source: {about['source']}")
    for note in about["notes"]:
        print(f"note: {note}")
    if options.list:
        for c in read.curves:
            inside = c.phase == 0
            print(f"  {c.name}: specimen {c.specimen}, needle {c.needle}, tissue {c.tissue}, {c.speed_m_s:.6g} m/s, rows in {inside.sum()}, at rest {(c.phase == 1).sum()}, "
                  f"out {(c.phase == 2).sum()}, to {c.depth_m.max():.6g} m, mean {c.force_n[inside].mean():.4g} N")
        return 0
    results = {}
    for tissue in sorted({c.tissue for c in read.curves}):
        results[tissue] = compare([Curve(c) for c in read.curves if c.tissue == tissue], laws)
        print("\n" + text(tissue, results[tissue]), flush=True)
    if options.json:
        with open(options.json, "w") as file:
            json.dump({"data": about, "tissues": results}, file, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
