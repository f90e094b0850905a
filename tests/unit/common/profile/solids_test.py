#!/usr/bin/env python3
"""The patients' solids as an anatomist wants them, from the written JSON alone: bones, cartilages and tendons keep apart, cartilage
lies where bones meet, a tendon is one body, and cuts show as much muscle and fat as a limb has.

A body is a structure's parts; in a structure that holds several (SEVERAL), a part without blend begins a new one. Two bodies overlap
where both are deeper than DEPTH. A distance changes by at most STEEPEST mm a mm, so a box whose middle says "farther" is left out:
what is not found is not there. The median builds; NEEDLELAB_LONG=1: all.
"""
import glob
import heapq
import json
import math
import os
import sys
import unittest

VOLUMES = os.path.join(os.path.dirname(os.path.realpath(__file__)), "../../../../db/samples/volumes")
sys.path.insert(0, VOLUMES)
from field import OUTSIDE, Volume, scaled, unit  # noqa: E402

DEPTH, FINEST, STEEPEST = 0.15, 0.2, math.sqrt(1.25)  # mm; the slope is common/anatomy's greatest
SEVERAL = {"carpals": 8, "metacarpals": 5, "tendon": 9, "wrist-flexors": 2, "extensors": 6}
TENDONS = {"tendon", "palmaris", "wrist-flexors", "extensors", "quadriceps", "patellar-tendon", "cuff", "biceps"}
CARTILAGES = {"cartilage", "meniscus", "disc", "facet"}
# One continues the other: a tendon's insertion, a disc's end plate, the arch and body of one vertebra.
ATTACHED = {("quadriceps", "patella"), ("patellar-tendon", "patella"), ("patellar-tendon", "tibia"), ("cuff", "humerus"), ("biceps", "scapula"), ("disc", "body"),
            *((name, "body") for name in ("l2", "l3", "l4", "l5"))}
CARRIES = {"head": "humerus", "joint-line": "tibia"}  # what cartilage on a group lies on
# Region: two bones that meet, within how many mm, and the cartilage between them
MEETING = {"knee": [("femur", "patella", 9), ("femur", "tibia", 8), ("tibia", "fibula", 2.5)], "shoulder": [("humerus", "scapula", 5)],
           "wrist": [("radius", "lunate", 4), ("lunate", "capitate", 2), ("capitate", "hamate", 2), ("scaphoid", "trapezium", 2),
                     ("triquetrum", "pisiform", 2), ("trapezium", "metacarpals", 2.5), ("capitate", "metacarpals", 2)], "lumbar": [("l3", "l4", 2.5)]}
# Profile: cut (name, axis, mm), structures, share of the cut within the skin. All ranges are set by hand.
MUSCLE = {"muscle", "vastus", "deltoid", "belly", "thenar", "multifidus", "erector", "psoas"}
FAT = {"fat", "pad", "wrist-fat", "viscera", "axilla"}
SHARES = {"knee": [("thigh, 85 mm above the recess", 0, -85, (0.45, 0.75), (0.1, 0.42)),
                   ("thigh, 50 mm above the recess", 0, -50, (0.4, 0.72), (0.15, 0.46)),
                   ("calf", 0, 150, (0.27, 0.65), (0.15, 0.6))],
          "wrist": [("forearm, 60 mm above the crease", 0, -60, (0.4, 0.65), (0.05, 0.35))],
          "shoulder": [("arm, 110 mm below the entry", 1, -110, (0.45, 0.85), (0.1, 0.5))],
          "lumbar": [("back, at L3-L4", 0, 0, (0.2, 0.6), (0.1, 0.7))]}


def read(file):
    """The volume of a profile, in mm."""
    with open(file, encoding="utf-8") as source:
        made = json.load(source)["volume"]

    def mm(p):
        return tuple(1e3 * p[axis] for axis in "xyz")
    v = Volume(made["skin"], made["rest"])
    for group in made["groups"]:
        for part in group["parts"]:
            blend, (kind, shape) = 1e3 * part.get("blend_m", 0), next((k, s) for k, s in part.items() if k != "blend_m")
            if kind == "capsule":
                other = shape.get("radius_b_m")
                v.capsule(group["id"], mm(shape["a_m"]), mm(shape["b_m"]), 1e3 * shape["radius_a_m"], other and 1e3 * other, blend)
            elif kind == "tube":
                v.tube(group["id"], [(*mm(p["at_m"]), 1e3 * p["radius_m"]) for p in shape["points"]], blend)
            elif kind == "ellipsoid":
                axes = [shape.get(axis) and unit(scaled(mm(shape[axis]), 1e-3)) for axis in ("x_axis", "y_axis")]
                v.ellipsoid(group["id"], mm(shape["center_m"]), mm(shape["radii_m"]), *axes, blend)
            else:
                v.half_space(group["id"], mm(shape["point_m"]), scaled(mm(shape["normal"]), 1e-3), blend)
    for structure in made["structures"]:
        v.structures[structure["id"]] = structure["layer"]
    for rule in made["rules"]:
        ranges = [(r["group"], *(r[end] * 1e3 if end in r else None for end in ("from_m", "to_m")))
                  for r in (rule, *rule.get("clips", ()))]
        v.rules.append((rule["structure"], ranges))
    return v


def box_of(parts, margin):
    """Around the parts' capsules and ellipsoids; endless where a half-space is one of them."""
    low, high = [math.inf] * 3, [-math.inf] * 3
    for part in parts:
        if part.plane:
            return (-math.inf,) * 3, (math.inf,) * 3
        balls = [(end, radius) for a, b, *radii in part.pieces for end, radius in zip((a, b), radii)]
        reach = [radius for _, radius in balls]
        if part.ellipsoid:
            center, radii, axes = part.ellipsoid
            balls = [(center, tuple(math.sqrt(sum((r * axis[i]) ** 2 for r, axis in zip(radii, axes))) for i in range(3)))]
            reach = []
        for center, radius in balls:
            for i in range(3):
                r = (radius[i] if not reach else radius) + margin + part.blend / 4
                low[i], high[i] = min(low[i], center[i] - r), max(high[i], center[i] + r)
    return tuple(low), tuple(high)


class Body:
    """Some parts of a group, in a range of its distance and within clips. `distance`: below 0 inside, never too steep."""

    def __init__(self, v, structure, parts, ranges):
        self.v, self.structure, self.parts, self.own, self.clips = v, structure, parts, ranges[0], ranges[1:]
        self.low, self.high = box_of(parts, self.own[2] or 0)
        for group, _, to in self.clips:
            if to is not None:
                low, high = box_of(v.groups[group], to)
                self.low, self.high = tuple(map(max, self.low, low)), tuple(map(min, self.high, high))

    def distance(self, p):
        value = 1e6
        for part in self.parts:
            value = part.join(value, p)
        ranges = [(value, *self.own[1:])] + [(self.v.distance(group, p), low, high) for group, low, high in self.clips]
        return max(max(-1e6 if low is None else low - d, -1e6 if high is None else d - high) for d, low, high in ranges)


def bodies(v):
    """Bones, cartilages and tendons, one for each rule, or several where the structure holds several."""
    found = []
    for structure, ranges in v.rules:
        if not (v.is_bone(structure) or structure in TENDONS | CARTILAGES):
            continue
        parts = v.groups[ranges[0][0]]
        starts = [i for i, part in enumerate(parts) if i == 0 or part.blend == 0 and structure in SEVERAL]
        found += [Body(v, structure, parts[i:j], ranges) for i, j in zip(starts, starts[1:] + [len(parts)])]
    return found


def closest(one, other, limit):
    """Below 0: a point where both are deeper than -`limit`, as (-depth, point), or None. Above: half the gap between them, to
    FINEST, and its middle, if it is below `limit`. Boxes are halved, the best first."""
    low = tuple(max(ends) - max(limit, 0) for ends in zip(one.low, other.low))
    high = tuple(min(ends) + max(limit, 0) for ends in zip(one.high, other.high))
    if any(not a < b for a, b in zip(low, high)):
        return None
    if math.inf in high or -math.inf in low:
        raise ValueError(f"{one.structure} and {other.structure} have no ends")
    best, where, boxes = limit, None, [(-1e6, low, high)]
    while boxes:
        bound, low, high = heapq.heappop(boxes)
        if bound > best - (FINEST if where else 0):
            break
        axis = max(range(3), key=lambda i: high[i] - low[i])
        cut_at = 0.5 * (low[axis] + high[axis])
        for ends in ((low[axis], cut_at), (cut_at, high[axis])):
            lower = tuple(ends[0] if i == axis else a for i, a in enumerate(low))
            upper = tuple(ends[1] if i == axis else b for i, b in enumerate(high))
            middle, reach = tuple(0.5 * (a + b) for a, b in zip(lower, upper)), STEEPEST * 0.5 * math.dist(lower, upper)
            value = one.distance(middle)
            if value - reach < best:
                value = max(value, other.distance(middle))
            if value < best:
                best, where = value, middle
                if limit < 0:
                    return best, where
            if value - reach < best and reach > 0.5 * FINEST:
                heapq.heappush(boxes, (value - reach, lower, upper))
    return where and (best, where)


def may_overlap(one, other):
    """Parts of one bone, a bone and the cartilage on it, two cartilages in contact, or what is attached."""
    if one.structure == other.structure and one.structure not in SEVERAL or one.own[0] == other.own[0] and one.own != other.own:
        return True
    if any(group == b.own[0] and low is not None and low >= (b.own[2] or 0) for a, b in ((one, other), (other, one))
           for group, low, _ in a.clips):
        return True
    if one.structure in CARTILAGES and CARRIES.get(one.own[0]) == other.structure:
        return True
    return (one.structure, other.structure) in ATTACHED or (other.structure, one.structure) in ATTACHED


def cut(v, axis, at, step, group):
    """The structures on a grid of a plane through the group's box, within the skin: {(i, j): id}."""
    low, high = box_of(v.groups[group], 0)
    u, w = [i for i in range(3) if i != axis]
    found = {}
    for i in range(int((high[u] - low[u]) / step)):
        for j in range(int((high[w] - low[w]) / step)):
            p = [at] * 3
            p[u], p[w] = low[u] + i * step, low[w] + j * step
            id = v.at(tuple(p))
            if id != OUTSIDE:
                found[i, j] = id
    return found


def pieces(cells, id):
    """How many separate areas of the structure a cut shows."""
    left, count = {at for at, found in cells.items() if found == id}, 0
    while left:
        count, todo = count + 1, [left.pop()]
        while todo:
            i, j = todo.pop()
            for near in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
                if near in left:
                    left.remove(near)
                    todo.append(near)
    return count


MENDED = ("wrist", "shoulder", "lumbar", "knee")
BUILDS = ("slender", "median", "heavy") if os.environ.get("NEEDLELAB_LONG") else ("median",)


class Solids(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.patients = {os.path.basename(file)[:-5]: read(file) for file in sorted(glob.glob(f"{VOLUMES}/*-*.json"))
                        if "curriculum" not in file}
        assert len(cls.patients) == 12
        for name, v in cls.patients.items():
            v.name = name

    def each(self):
        named = [(*name.split("-"), v) for name, v in self.patients.items()]
        return [(region, v) for region, build, v in named if region in MENDED and build in BUILDS]

    def test_no_two_overlap(self):
        for _, v in self.each():
            found = bodies(v)
            for i, one in enumerate(found):
                for other in found[:i]:
                    if not may_overlap(one, other):
                        with self.subTest(v.name, one=(one.structure, one.own), other=(other.structure, other.own)):
                            self.assertIsNone(closest(one, other, -DEPTH))

    def test_no_bone_lies_in_the_skin(self):
        for _, v in self.each():
            skin = next(Body(v, "skin", v.groups[v.skin], ranges) for structure, ranges in v.rules if structure == "skin")
            for bone in bodies(v):
                if v.is_bone(bone.structure):
                    with self.subTest(v.name, bone=bone.own[0]):
                        self.assertIsNone(closest(bone, skin, 0))

    def test_there_is_cartilage_where_bones_meet(self):
        for region, v in self.each():
            found = bodies(v)
            for one, other, within in MEETING[region]:
                with self.subTest(v.name, one=one, other=other):
                    gaps = [closest(a, b, 0.5 * within) for a in found for b in found
                            if v.is_bone(a.structure) and v.is_bone(b.structure) and a.own[0] == one and b.own[0] == other]
                    gap, at = min(gap for gap in gaps if gap)
                    self.assertGreater(gap, 0)
                    self.assertIn(v.at(at), CARTILAGES)

    def test_a_tendon_is_one_body(self):
        for region, v in self.each():
            found = [body for body in bodies(v) if body.structure in TENDONS]
            for structure, count in SEVERAL.items() if region == "wrist" else ():
                self.assertEqual(count, len([body for body in bodies(v) if body.structure == structure]), structure)
            for body in found:
                alone = [Body(v, body.structure, [part], [body.own]) for part in body.parts]
                joined, todo = {0}, [0]
                while todo:
                    i = todo.pop()
                    more = {j for j in range(len(alone)) if j not in joined and closest(alone[i], alone[j], 0)}
                    joined |= more
                    todo += more
                self.assertEqual(len(joined), len(alone), (v.name, body.structure))
                for a, b in (piece[:2] for part in body.parts for piece in part.pieces if part.pieces and body.own[2] == 0):
                    points = [tuple(x + (y - x) * k / 8 for x, y in zip(a, b)) for k in range(9)]
                    met = {v.at(p) for p in points if body.distance(p) < 0} - {OUTSIDE}
                    ends = {other for pair in ATTACHED for other in pair if body.structure in pair}
                    self.assertLessEqual(met, ends | {body.structure}, v.name)

    def test_a_cut_through_the_tunnel_shows_nine_tendons_and_a_nerve(self):
        for region, v in self.each():
            for x in (0, 14, 25) if region == "wrist" else ():
                cells = cut(v, 0, x, 0.2, "tunnel")
                self.assertEqual((pieces(cells, "tendon"), pieces(cells, "nerve")), (9, 1), (v.name, x))

    def test_nothing_but_the_arch_is_between_acromion_and_bursa(self):
        for region, v in self.each():
            if region != "shoulder":
                continue
            scapula, seen = v.groups["scapula"], 0
            middle = scapula[1].ellipsoid[0]  # the acromion's plate
            for dx in range(-12, 13, 3):
                for dz in range(-9, 10, 3):
                    x, y, z = middle[0] + dx, middle[1], middle[2] + dz
                    met = [v.at((x, y - 0.2 * i, z)) for i in range(150)]
                    if "scapula" in met and "bursa" in met:
                        seen += 1
                        between = set(met[len(met) - met[::-1].index("scapula"):met.index("bursa")])
                        self.assertLessEqual(between, {"ligament", "bursa"}, (v.name, x, z))
            self.assertGreater(seen, 20)

    def test_cuts_show_as_much_muscle_and_fat_as_a_limb_has(self):
        for region, v in self.each():
            for words, axis, at, *ranges in SHARES[region]:
                cells = list(cut(v, axis, at, 2, v.skin).values())
                for kind, (least, most) in zip((MUSCLE, FAT), ranges):
                    share = sum(id in kind for id in cells) / len(cells)
                    with self.subTest(v.name, cut=words, kind=sorted(kind)[0]):
                        self.assertTrue(least <= share <= most, f"{share:.2f}")


if __name__ == "__main__":
    unittest.main()
