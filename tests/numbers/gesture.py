"""A stored recording: its samples, and the measures of common/scoring/README.md computed from them.

Written from that page, from the docstrings of common/scoring and from FORMAT.md; none of the product's code is used. Lengths in m, times in s, forces
in N. Only limbs in their own frame (no placement), as with simulated stations."""
import bisect
import cmath
import itertools
import math
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "durability" / "judge"))
from database import message  # noqa: E402, F401  a reader of Protobuf's fields

__all__ = ["message"]  # for modules that import them from here
from gesture_chunk import Chunk  # noqa: E402  a reader made from FORMAT.md alone

ENTRY, TURN, NOT_STEPPED, BEYOND_NEEDLE, CAPPED = 1 << 0, 1 << 4, 1 << 8, 1 << 10, 1 << 14
INSERTING, WITHDRAWING = 1, 3
BRIDGE_S = 0.1
# a movement of the tip begins above 3 mm/s, ends when it stays below 1.5 mm/s, and is 2 mm long
TIP_MOVES = (3e-3, 1.5e-3, 2e-3)
# ISO 9626, nominal outer diameter in mm by gauge; bevel in degrees by kind of tip
DIAMETER_MM = {18: 1.2, 19: 1.1, 20: 0.9, 21: 0.8, 22: 0.7, 23: 0.6, 24: 0.55, 25: 0.5, 26: 0.45, 27: 0.4, 28: 0.36, 29: 0.33, 30: 0.3}
BEVEL_DEGREES = {"HYPODERMIC": 11, "QUINCKE": 20, "TUOHY": 25, "PENCIL_POINT": 10}


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def add(a, b, share=1.0):
    return (a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2])


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def norm(a):
    return math.sqrt(dot(a, a))


def across(v, axis):
    return add(v, axis, -dot(v, axis))


def point(json):
    return (json.get("x", 0), json.get("y", 0), json.get("z", 0))


def nearest_on_segment(p, a, b):
    d = sub(b, a)
    length = dot(d, d)
    share = min(1.0, max(0.0, dot(sub(p, a), d) / length)) if length > 0 else 0.0
    return add(a, d, share)


def to_segment(p, a, b):
    """Distance of a point from a segment."""
    return norm(sub(p, nearest_on_segment(p, a, b)))


def between_segments(p, q, a, b):
    """Distance of two segments: the minimum along one segment of the (convex) distance to the other, by ternary search."""
    low, high = 0.0, 1.0
    along = sub(q, p)
    for _ in range(80):
        third = (high - low) / 3
        one, two = low + third, high - third
        if to_segment(add(p, along, one), a, b) < to_segment(add(p, along, two), a, b):
            high = two
        else:
            low = one
    return min(to_segment(p, a, b), to_segment(q, a, b), to_segment(add(p, along, (low + high) / 2), a, b))


class Gesture:
    """tick, time_ns, tip, axis, force (size), forces, insertion, lateral, plunger, flags, layer, phase: one list each."""

    def __init__(self, chunks, rate_hz, profile):
        columns = [[] for _ in range(31)]
        for data in chunks:
            for into, values in zip(columns, Chunk(data).columns):
                into += values
        self.columns, self.rate_hz, self.profile = columns, rate_hz, profile
        self.tick, self.time_ns = columns[0], columns[1]
        self.tip = list(zip(*columns[2:5]))
        self.axis = []
        for x, y, z, w in zip(*columns[5:9]):
            size = x * x + y * y + z * z + w * w
            self.axis.append((2 * (x * z + w * y) / size, 2 * (y * z - w * x) / size, (w * w + z * z - x * x - y * y) / size))
        self.forces = list(zip(*columns[10:13]))
        self.force = [norm(f) for f in self.forces]
        self.insertion, self.lateral, self.plunger = columns[19], columns[20], columns[21]
        self.flags = [low | high << 16 for low, high in zip(columns[24], columns[25])]
        self.layer, self.phase = columns[27], columns[28]
        self.inside = [layer >= 0 for layer in self.layer]
        self.count = len(self.tick)
        self.at_s = [(tick - self.tick[0]) / rate_hz for tick in self.tick] if self.count else []
        self.tissues = [layer.get("tissue") for layer in profile["layers"]]
        unnamed = [layer.get("tissue") for layer in profile["layers"] if "name" not in layer]
        self.layer_names = []
        for k, layer in enumerate(profile["layers"]):
            tissue = layer.get("tissue")
            number = 1 + sum(1 for other in profile["layers"][:k] if "name" not in other and other.get("tissue") == tissue)
            word = f"layer {k + 1}" if tissue == "OTHER" else tissue.lower() + (f" {number}" if unnamed.count(tissue) > 1 else "")
            self.layer_names.append(layer.get("name", word))
        self.bottoms = list(itertools.accumulate(layer["thickness_m"] for layer in profile["layers"]))
        # a target: name, centre, radius, depths of the tissues that count; none: all
        self.targets, self.hazards = [], []
        for t in profile.get("targets", []):
            spans = [self.span(self.layer_names.index(name)) for name in t.get("tissues", [])]
            centre = point(t["center_m"])
            self.targets.append((t["name"], add(centre, self.way(centre, t.get("anchor"))), t["radius_m"], spans))
        for h in profile.get("hazards", []):
            a = point(h.get("center_m") or h["a_m"])
            b = a if "center_m" in h else point(h["b_m"])
            way = self.way(tuple(0.5 * (x + y) for x, y in zip(a, b)), h.get("anchor"))
            self.hazards.append((h["name"], h.get("kind"), add(a, way), add(b, way), h["radius_m"]))

    def span(self, layer):
        last = layer + 1 == len(self.bottoms)
        return (self.bottoms[layer - 1] if layer else 0.0, math.inf if last else self.bottoms[layer])

    def way(self, p, anchor):
        """From a region's centre to where its anchor requires it: along the line through the limb's centre, or along its normal."""
        if anchor is None:
            return (0.0, 0.0, 0.0)
        top = self.span(self.layer_names.index(anchor["layer"]))[0]
        limb, wanted = self.profile["limb"], top + anchor["offset_m"]
        if "plane" in limb:
            normal = point(limb["plane"]["normal"])
            out = tuple(x / norm(normal) for x in normal)
        else:
            middle = point(limb["sphere"]["center_m"]) if "sphere" in limb else \
                nearest_on_segment(p, point(limb["capsule"]["a_m"]), point(limb["capsule"]["b_m"]))
            away = sub(p, middle)
            out = tuple(x / norm(away) for x in away) if norm(away) else (0.0, 0.0, 1.0)
        return tuple((self.depth(p) - wanted) * x for x in out)

    def from_target(self, target, p):
        """A point's distance from the ball or from its tissues, the greater of both; at most 0: in the target."""
        _, centre, radius, spans = target
        depth = self.depth(p)
        beside = min((max(top - depth, depth - bottom) for top, bottom in spans), default=-math.inf)
        return max(norm(sub(p, centre)) - radius, beside)

    def depth(self, p):
        limb = self.profile["limb"]
        if "plane" in limb:
            normal = point(limb["plane"]["normal"])
            return -dot(sub(p, point(limb["plane"]["point_m"])), normal) / norm(normal)
        if "sphere" in limb:
            return limb["sphere"]["radius_m"] - norm(sub(p, point(limb["sphere"]["center_m"])))
        capsule = limb["capsule"]
        return capsule["radius_m"] - to_segment(p, point(capsule["a_m"]), point(capsule["b_m"]))

    def weight_s(self, i):
        """The time represented by a sample: half of the time to each neighbour, unless that is a gap."""
        gaps = [self.at_s[b] - self.at_s[a] for a, b in ((i - 1, i), (i, i + 1)) if a >= 0 and b < self.count]
        return sum(0.5 * gap for gap in gaps if gap <= BRIDGE_S)

    def holes(self):
        """The time that is missing, and whether it can hide a part of an insertion: tissue before or behind a hole, or a second."""
        gaps = [(self.at_s[i] - self.at_s[i - 1], self.inside[i - 1] or self.inside[i]) for i in range(1, self.count)]
        gaps = [(gap, by_tissue) for gap, by_tissue in gaps if gap > BRIDGE_S]
        return sum(gap for gap, _ in gaps), any(by_tissue or gap >= 1 for gap, by_tissue in gaps)

    def opening_behind_tip(self):
        needle = self.profile.get("needle", {})
        d = needle.get("outer_diameter_m") or DIAMETER_MM.get(needle.get("gauge"), 0) * 1e-3
        tip = needle.get("tip", "UNKNOWN")
        bevel = needle.get("bevel_angle_rad") or math.radians(BEVEL_DEGREES.get(tip, 0))
        if not d or not bevel:
            return 0.0
        return d / (2 * math.tan(bevel)) + (d if tip == "PENCIL_POINT" else 0)


# --- the smoothed track (track.h)

class Integral:
    """The integral of the piecewise linear function through (times, values), exact at any time."""

    def __init__(self, times, values):
        self.times, self.values, self.sums = times, values, [0.0]
        for i in range(1, len(times)):
            self.sums.append(self.sums[-1] + 0.5 * (values[i - 1] + values[i]) * (times[i] - times[i - 1]))

    def to(self, t):
        i = min(max(bisect.bisect_right(self.times, t) - 1, 0), len(self.times) - 2)
        dt, width = t - self.times[i], self.times[i + 1] - self.times[i]
        slope = (self.values[i + 1] - self.values[i]) / width
        return self.sums[i] + dt * (self.values[i] + 0.5 * slope * dt)

    def means(self, edges):
        at = [self.to(t) for t in edges]
        return [(b - a) / (t - s) for a, b, s, t in zip(at, at[1:], edges, edges[1:])]


def smoothed(values, period_s):
    """A Gaussian with half of the power at 6 Hz, cut off at 4 sigma; beyond the ends the signal's point reflection."""
    sigma = math.sqrt(math.log(2)) / (2 * math.pi * 6) / period_s
    reach = math.ceil(4 * sigma)
    weights = [math.exp(-0.5 * (k / sigma) ** 2) for k in range(-reach, reach + 1)]
    total = sum(weights)
    weights = [w / total for w in weights]
    padded = list(values)
    while len(padded) < len(values) + 2 * reach:
        n = min(reach - (len(padded) - len(values)) // 2, len(padded) - 1)
        if n < 1:
            return list(values)
        padded = [2 * padded[0] - v for v in padded[n:0:-1]] + padded + [2 * padded[-1] - v for v in padded[-2:-2 - n:-1]]
    return [sum(w * v for w, v in zip(weights, padded[i:i + 2 * reach + 1])) for i in range(len(values))]


class Run:
    """A stretch without a gap of more than 0.1 s: points at equal intervals of at most 10 ms."""

    def __init__(self, g, first, last):
        times = [t - g.at_s[first] for t in g.at_s[first:last + 1]]
        steps = max(1, math.ceil(times[-1] / 0.01 - 1e-9))
        self.period_s = times[-1] / steps
        edges = [times[-1] * k / (2 * steps) for k in range(2 * steps + 1)]
        self.start_s = g.at_s[first]

        def bins(values):
            return Integral(times, values[first:last + 1]).means(edges)

        def points(values):
            half = bins(values)
            return [values[first]] + [0.5 * (half[2 * k - 1] + half[2 * k]) for k in range(1, steps)] + [values[last]]

        def steps_of(values):
            half = bins(values)
            return [0.5 * (half[2 * k] + half[2 * k + 1]) for k in range(steps)]

        self.tip = list(zip(*(smoothed(points(list(c)), self.period_s) for c in zip(*g.tip))))
        axes = zip(*(smoothed(points(list(c)), self.period_s) for c in zip(*g.axis)))
        self.axis = [(x / norm((x, y, z)), y / norm((x, y, z)), z / norm((x, y, z))) for x, y, z in axes]
        self.insertion = points(g.insertion)
        # no residue of the rounding where a tick falls on the end of a step
        self.inside = [min(1.0, share) if share > 1e-9 else 0.0 for share in steps_of([1.0 if i else 0.0 for i in g.inside])]
        self.force = list(zip(*(steps_of(list(c)) for c in zip(*g.forces))))
        n = len(self.tip)
        self.speed = []
        for i in range(n):
            a, b = max(0, i - 1), min(n - 1, i + 1)
            self.speed.append(norm(sub(self.tip[b], self.tip[a])) / ((b - a) * self.period_s))
        self.steps = [norm(sub(b, a)) for a, b in zip(self.tip, self.tip[1:])]


def runs_of(g):
    runs, first = [], 0
    for i in range(1, g.count + 1):
        if i == g.count or g.at_s[i] - g.at_s[i - 1] > BRIDGE_S:
            if i - 1 > first:
                runs.append(Run(g, first, i - 1))
            first = i
    return runs


# --- smoothness, as published (README: SPARC cut-off 10 Hz, threshold 0.05, padding 4; LDLJ of the speed)

def sparc(speed, rate_hz):
    size = 1
    while size < len(speed):
        size *= 2
    size *= 16
    lines = []
    k = 0
    while k * rate_hz / size <= 10:
        turn, value, total = cmath.exp(-2j * math.pi * k / size), 1 + 0j, 0j
        for v in speed:
            total += v * value
            value *= turn
        lines.append(abs(total))
        k += 1
    most = max(lines)
    high = [i for i, a in enumerate(lines) if a >= 0.05 * most]
    first, last = high[0], high[-1]
    return -sum(math.hypot(1 / (last - first), (lines[i + 1] - lines[i]) / most) for i in range(first, last))


def ldlj(speed, rate_hz):
    seconds = len(speed) / rate_hz
    jerk = sum(((speed[i] - 2 * speed[i - 1] + speed[i - 2]) * rate_hz**2)**2 for i in range(2, len(speed))) / rate_hz
    return -math.log(seconds**3 / max(speed)**2 * jerk)


def movements(steps, period_s, begin, end, least):
    """Stretches of at least `least` that begin above one speed and end when it stays below another for 0.1 s: for each the steps from where the speed
    last rose above the lower one to where it was last above it, and its length."""
    found, way, slow, moving = [], 0.0, 0, False
    patience = math.ceil(0.1 / period_s * (1 - 1e-9))
    rise = first = last = 0
    for i, step in enumerate(steps):
        speed = step / period_s
        if not moving and speed > begin:
            moving, way, slow, first = True, 0.0, 0, rise
        if moving:
            way += step
            slow = slow + 1 if speed < end else 0
            last = i if speed >= end else last
            if slow >= patience:
                moving = False
                if way >= least:
                    found.append((first, last, way))
        if speed < end:
            rise = i + 1
    return found + ([(first, last, way)] if moving and way >= least else [])


def chords(values, count):
    """Each step as a share of the straight line over the surrounding 0.1 s (ten steps)."""
    steps = []
    for i in range(count):
        a, b = max(0, i - 4), min(i + 5, count)
        steps.append(norm(sub(values[b], values[a])) / (b - a))
    return steps


def swept(run, i):
    """The area that the part of the shaft in tissue sweeps sideways in one step: midpoints of 8 pieces."""
    a, b = run.axis[i], run.axis[i + 1]
    mean = add(a, b)
    along = tuple(c / norm(mean) for c in mean)
    length = 0.5 * (run.insertion[i] + run.insertion[i + 1])
    moved = sub(run.tip[i + 1], run.tip[i])
    turned = sub(b, a)
    pieces = [norm(across(add(moved, turned, -(k + 0.5) / 8 * length), along)) for k in range(8)]
    return sum(pieces) / 8 * length


# --- the syringe

def strokes(g):
    """(kind, first sample, last sample, from, to) of each stroke: at least 2 % of the travel in one direction, in means over 10 ms."""
    bins = {}
    for i, t in enumerate(g.at_s):
        bins.setdefault(math.floor(t / 0.01 + 1e-6), []).append(i)
    means = [(where, sum(g.plunger[i] for i in where) / len(where)) for where in bins.values()]
    found, start = [], 0
    while start < len(means):
        # from a level, the first movement beyond 0.2 %, until it reverses by 1 % or rests for 0.3 s
        level, i = means[start][1], start
        while i < len(means) and abs(means[i][1] - level) <= 0.002:
            i += 1
        if i == len(means):
            break
        sign = 1 if means[i][1] > level else -1
        furthest, marked, quiet = i, i, None
        for j in range(i, len(means)):
            value = means[j][1]
            if sign * (value - means[furthest][1]) > 0:
                furthest = j
            if sign * (value - means[marked][1]) >= 0.002:
                marked = j
            if sign * (means[furthest][1] - value) >= 0.01:
                quiet = furthest
                break
            if g.at_s[means[j][0][0]] - g.at_s[means[marked][0][-1]] >= 0.3:
                quiet = j
                break
        to = means[furthest][1]
        if abs(to - level) >= 0.02 - 1e-4:
            end = next(k for k in range(start, furthest + 1) if sign * (to - means[k][1]) <= 0.001)
            begin = max(k for k in range(start, end + 1) if k == start or sign * (means[k][1] - level) <= 0.001)
            found.append(("INJECTION" if sign > 0 else "ASPIRATION", means[begin][0][-1], means[end][0][-1], level, to))
        if quiet is None:
            break
        start = quiet
    return found


def syringe(g, result):
    behind = g.opening_behind_tip()
    aspirations = injections = 0
    injected = in_target = 0.0
    aspirated, before = False, None
    for kind, first, last, level, to in strokes(g):
        where = [add(g.tip[i], g.axis[i], -behind) for i in range(first, last + 1)]
        in_tissue = [g.inside[first + k] and g.depth(p) > 0 for k, p in enumerate(where)]
        if kind == "ASPIRATION":
            aspirations += 1
            aspirated = aspirated or in_tissue[0]
            continue
        injections += 1
        injected += to - level
        way = way_in = way_target = 0.0
        for k, p in enumerate(where):
            i = first + k
            part = (0.5 * (g.plunger[i] - g.plunger[i - 1]) if k > 0 else 0) + \
                   (0.5 * (g.plunger[i + 1] - g.plunger[i]) if i < last else 0)
            way += part
            way_in += part * in_tissue[k]
            way_target += part * any(g.from_target(t, p) <= 0 for t in g.targets)
        in_target += (to - level) * (min(1.0, max(0.0, way_target / way)) if way > 0 else 0)
        if before is None and way > 0 and way_in > 0:
            before = aspirated
    result["aspirations"], result["injections"], result["injected_share"] = aspirations, injections, injected
    if injections and g.targets:
        result["injected_in_target_share"] = min(1.0, in_target / injected) if injected > 0 else 0
    if before is not None:
        result["aspirated_before_injection"] = int(before)


# --- all of them

def motion(g, runs, result):
    result["elapsed_s"] = g.at_s[-1]
    contact = next((at_s for at_s, inside, flags in zip(g.at_s, g.inside, g.flags) if inside and not flags & CAPPED), None)
    if contact is not None:
        result["needle_time_s"] = g.at_s[-1] - contact
    if any(g.inside):
        result["ends_in_tissue"] = int(g.inside[-1])
    if g.holes()[0]:
        result["missing_s"] = g.holes()[0]
    result["path_length_m"] = sum(sum(r.steps) for r in runs)
    result["time_in_tissue_s"] = sum(r.period_s * sum(r.inside) for r in runs)
    result["path_in_tissue_m"] = sum(s * i for r in runs for s, i in zip(r.steps, r.inside))
    result["mean_speed_m_s"] = result["path_length_m"] / sum(r.period_s * len(r.steps) for r in runs)
    result["peak_speed_m_s"] = max(max(r.speed) for r in runs)
    result["tissue_damage_m2"] = sum(share * swept(r, i) for r in runs for i, share in enumerate(r.inside) if share)
    longest = None
    for r in runs:
        within = [i for i, share in enumerate(r.inside) if share > 0]
        span = (within[0], within[-1] + 1) if within else (0, len(r.inside))
        rank = (bool(within), (span[1] - span[0]) * r.period_s)
        if longest is None or rank > longest[0]:
            longest = (rank, r.speed[span[0]:span[1] + 1], r.period_s)
    # for each movement of the tip that reaches into tissue (for all if none does), by its length; for the whole if none is found
    arcs = []
    for r in runs:
        for first, last, way in movements(chords(r.tip, len(r.steps)), r.period_s, *TIP_MOVES):
            if not longest[0][0] or any(share > 0 for share in r.inside[first:last + 1]):
                arcs.append((sparc(r.speed[first:last + 2], 1 / r.period_s), way))
    if arcs:
        result["sparc"] = sum(arc * way for arc, way in arcs) / sum(way for _, way in arcs)
    else:
        result["sparc"] = sparc(longest[1], 1 / longest[2])
    result["ldlj"] = ldlj(longest[1], 1 / longest[2])
    result["translational_actions"] = sum(len(movements(chords(r.tip, len(r.steps)), r.period_s, *TIP_MOVES)) for r in runs)
    result["rotational_actions"] = sum(len(movements(chords(r.axis, len(r.steps)), r.period_s, 0.1, 0.05, 0.05)) for r in runs)
    work = 0.0
    for r in runs:
        for i, share in enumerate(r.inside):
            if share > 0:
                mean = add(r.axis[i], r.axis[i + 1])
                along = tuple(c / norm(mean) for c in mean)
                work += share * max(0.0, -dot(across(r.force[i], along), across(sub(r.tip[i + 1], r.tip[i]), along)))
    result["clamping_work_j"] = work


def tissue(g, runs, asked, result):
    within = [i for i in range(g.count) if g.inside[i]]
    result["peak_force_n"] = max([0.0] + [force for force, flags in zip(g.force, g.flags) if not flags & CAPPED])
    result["greatest_depth_m"] = max([0.0] + [g.depth(g.tip[i]) for i in within])
    result["greatest_insertion_m"] = max([0.0] + [g.insertion[i] for i in within])
    result["largest_lateral_error_m"] = max([0.0] + [g.lateral[i] for i in within])
    seconds = sum(g.weight_s(i) for i in within)
    result["mean_force_in_tissue_n"] = sum(g.force[i] * g.weight_s(i) for i in within) / seconds if seconds else 0
    # by layer; not in the first 10 ms after a boundary between layers
    peaks, impulses, times = ([0.0] * len(g.tissues) for _ in range(3))
    changed = None
    for i in range(g.count):
        if i and g.layer[i] != g.layer[i - 1]:
            changed = g.at_s[i] if g.inside[i - 1] and g.inside[i] else None
        if not g.inside[i] or (changed is not None and g.at_s[i] - changed < 0.01 * (1 - 1e-9)):
            continue
        k = g.layer[i]
        peaks[k] = max(peaks[k], g.force[i])
        impulses[k] += g.force[i] * g.weight_s(i)
        times[k] += g.weight_s(i)
    for k, peak in enumerate(peaks):
        if peak or f"peak_force_layer_{k + 1}_n" in asked:
            result[f"peak_force_layer_{k + 1}_n"] = peak
        if times[k] > 0 and (impulses[k] > 0 or f"mean_force_layer_{k + 1}_n" in asked):
            result[f"mean_force_layer_{k + 1}_n"] = impulses[k] / times[k]
    entries = [i for i in within if i == 0 or not g.inside[i - 1] or g.flags[i] & ENTRY]
    result["entries"] = len(entries)
    withdrawals, back = 0, False
    for i in within:
        if i == 0 or not g.inside[i - 1] or g.flags[i] & ENTRY:
            back = False
        if g.phase[i] == WITHDRAWING:
            withdrawals += not back
            back = True
        elif g.phase[i] == INSERTING:
            back = False
    result["withdrawals"] = withdrawals
    turns = [g.at_s[i] for i in range(g.count) if g.flags[i] & TURN]
    result["trajectory_changes"] = sum(1 for k, t in enumerate(turns) if k == 0 or t - turns[k - 1] > 0.2)
    if within and max(g.insertion[i] for i in within) > 0:
        most = max(g.insertion[i] for i in within)
        deepest = next(i for i in within if g.insertion[i] == most)
        entry = [i for i in entries if i <= deepest][-1]
        end = next(i for i in range(entry, deepest + 1) if g.insertion[i] >= most - 0.25e-3)
        straight = norm(sub(g.tip[end], g.tip[entry]))
        if straight >= 1e-3:
            way = 0.0
            for r in runs:
                for i, step in enumerate(r.steps):
                    share = (g.at_s[end] - (r.start_s + i * r.period_s)) / r.period_s
                    way += min(1.0, max(0.0, share)) * r.inside[i] * step
            result["path_inefficiency"] = max(1.0, way / straight)


def touches(g, within, a, b, radius):
    """Whether the shaft in tissue, from the tip straight back to the skin, touches a hazard at any sample."""
    last, room = None, 0.0  # the last sample whose distance was computed, and how far the shaft may still move
    for i in within:
        skin = add(g.tip[i], g.axis[i], -g.insertion[i])
        if last is not None:
            # no point of the shaft moves further than its ends
            if max(norm(sub(g.tip[i], last[0])), norm(sub(skin, last[1]))) < room:
                continue
        distance = between_segments(g.tip[i], skin, a, b) - radius
        if distance <= 0:
            return True
        last, room = (g.tip[i], skin), distance
    return False


def contacts(moments):
    """How many contacts begin at (time, whether it touches): an interruption of less than 0.2 s does not begin another one."""
    count, left = 0, None  # left: the time since it left
    for at_s, touching in moments:
        if touching:
            count += left is None and count == 0 or left is not None and at_s - left >= 0.2 * (1 - 1e-9)
            left = None
        elif count and left is None:
            left = at_s
    return count


def aim(g, dwell_s, result):
    within = [i for i in range(g.count) if g.inside[i]]
    touched = sum(touches(g, within, a, b, radius) for _, _, a, b, radius in g.hazards)
    result["hazards_touched"] = touched
    bones = [h for h in g.hazards if h[1] == "BONE"]
    result["bone_contacts"] = contacts(
        (g.at_s[i], g.inside[i] and (g.tissues[g.layer[i]] == "BONE" or any(to_segment(g.tip[i], a, b) <= r for _, _, a, b, r in bones)))
        for i in range(g.count))
    # a tick that was not stepped does not tell where the hub is
    result["hub_contacts"] = contacts(
        (at_s, flags & BEYOND_NEEDLE) for at_s, flags in zip(g.at_s, g.flags) if flags & BEYOND_NEEDLE or not flags & NOT_STEPPED)
    if not g.targets:
        return
    distance = {i: min(norm(sub(g.tip[i], c)) for _, c, *_ in g.targets) for i in within}
    hits = [i for i in within if any(g.from_target(t, g.tip[i]) <= 0 for t in g.targets)]
    # the longest stay; a tick out of it for up to 0.1 s does not end one. (In layers no hazard can lie between a target and itself.)
    stays, last = [0.0], None
    for i in hits:
        if last is None or g.at_s[i] - g.at_s[last] > BRIDGE_S:
            stays.append(0.0)
        stays[-1] += g.weight_s(i)
        last = i
    result["target_reached"] = int(bool(hits) and max(stays) >= dwell_s * (1 - 1e-9))
    result["time_at_target_s"] = sum(g.weight_s(i) for i in hits)
    if within:
        last = [i for i in within if i == 0 or not g.inside[i - 1]][-1]
        most = max(g.insertion[i] for i in within if i >= last)
        final = max(i for i in within if i >= last and g.insertion[i] == most)
        result["target_distance_m"] = distance[final]
        result["target_nearest_m"] = min(distance.values())


def plan(g, planned, result):
    """The errors relative to an exercise's planned line: {"entry_m", "direction" or "target_m"}, in the limb's frame."""
    within = [i for i in range(g.count) if g.inside[i]]
    if not within:
        return
    start = point(planned["entry_m"])
    way = point(planned["direction"]) if "direction" in planned else sub(point(planned["target_m"]), start)
    way = tuple(c / norm(way) for c in way)
    first = within[0]
    entered = add(g.tip[first], g.axis[first], -g.insertion[first])
    if first and g.at_s[first] - g.at_s[first - 1] <= BRIDGE_S:
        outside, inside = -g.depth(g.tip[first - 1]), g.depth(g.tip[first])
        if outside >= 0 and inside > 0:
            entered = add(g.tip[first - 1], sub(g.tip[first], g.tip[first - 1]), outside / (outside + inside))
    last = [i for i in within if i == 0 or not g.inside[i - 1]][-1]
    most = max(g.insertion[i] for i in within if i >= last)
    axis = g.axis[max(i for i in within if i >= last and g.insertion[i] == most)]
    along = dot(axis, way)
    off = {i: norm(across(sub(g.tip[i], start), way)) for i in within}
    seconds = sum(g.weight_s(i) for i in within)
    result["planned_entry_error_m"] = norm(sub(entered, start))
    result["planned_angle_error_rad"] = math.atan2(norm(across(axis, way)), along)
    result["largest_planned_line_error_m"] = max(off.values())
    if seconds > 0:
        result["mean_planned_line_error_m"] = sum(off[i] * g.weight_s(i) for i in within) / seconds


def measures_of(g, exercise=None):
    """name -> value for every measure except dtw_distance_m, which needs the references. `exercise`: its JSON."""
    exercise = exercise or {}
    asked = {r["measure"] for r in exercise.get("requirements", [])}
    result = {}
    runs = runs_of(g)
    motion(g, runs, result)
    tissue(g, runs, asked, result)
    aim(g, exercise.get("target_dwell_s", 0.5), result)
    syringe(g, result)
    if "plan" in exercise:
        plan(g, exercise["plan"], result)
    return result
