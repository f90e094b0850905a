"""The lumbar spine for an epidural at L3-L4 in the midline.

Frame: x towards the feet, y to the patient's right, z out of the back; the needle enters at the origin and goes straight in.
"""
import math

from field import TUBE, Volume
from tissues import BONE, CARTILAGE, NERVE, layer, softened

PARAMETERS = [
    ("depth", (36.6, 48.2, 59.8), "skin to epidural space at L3-4 48.2 ± 11.6 mm: Lee 2004"),
    ("skin", (2, 2.5, 3), "set by hand"),
    ("fat", (3, 11, 21), "set by hand"),
    ("supraspinous", (5, 5, 5), "set by hand"),
    ("flavum", (3.27, 3.38, 3.49), "ligamentum flavum at L3-4 3.38 ± 0.11 mm: Khasawneh 2021"),
    ("epidural", (5.7, 6, 7.4), "up to 6 mm deep; fat 7.35 ± 1.68 mm in 40 healthy adults: PubMed 29595411"),
    ("dura", (0.7, 0.7, 0.7), "set by hand, so that an 18G needle feels it"),
    ("sac", (13, 13.5, 14), "set by hand"),
    ("gap", (9.9, 10.4, 10.9), "between spinous processes at L3-4 10.4 ± 2.3 mm, women 9.9, men 10.9: Chulalongkorn Med J 56(3)"),
    ("disc", (10, 10.6, 11.2), "between 7.9 mm at L1-2 and 12.0 mm at L4-5 in the middle: MRI, 106 Nepalese adults"),
    ("body_height", (26, 27, 28), "set by hand"),
    ("body_depth", (31, 34, 36), "set by hand"),
    ("body_width", (42, 47, 50), "set by hand"),
    ("process", (19, 21, 22), "height of a spinous process: set by hand"),
    ("ridge", (60, 70, 90), "radius of the back's ridges: set by hand"),
    ("furrow", (30, 30, 25), "the ridges' distance from the midline: set by hand"),
    ("waist", (120, 145, 185), "half the waist: set by hand"),
]
BEND = 350.0          # radius of the lordosis at the vertebral bodies: 6° a level
DISC_AT = -3.0        # the disc L3-L4 lies a little above the needle's level
ALONG = (-88, -50, -12, 12, 50, 88)

LAYERS = {
    "skin": layer("SKIN", 0.75, 0.3, 0.1, 9000, 20, (320, 20000, 0.7)),
    "fat": layer("FAT", 0.4, 0.2, 0.05, 2500, 6),
    "fascia": layer("OTHER", 0.55, 0.2, 0.05, 9000, 15),
    "muscle": layer("MUSCLE", 1.6, 0.4, 0.1, 10000, 20),
    "supraspinous": layer("TENDON", 1.75, 0.4, 0.1, 14000, 20),
    "interspinous": layer("TENDON", 2, 0.4, 0.1, 14000, 20),
    "flavum": layer("TENDON", 3, 0.4, 0.1, 20000, 30, (280, 20000, 1)),
    "epidural": layer("FAT", 0.2, 0.1, 0.05, 1000, 3),
    "dura": layer("OTHER", 0.35, 0.15, 0.05, 4000, 10, (370, 20000, 0.25)),
    "csf": layer("OTHER", 0.1, 0.05, 0, 500, 2),
    "disc": layer("CARTILAGE", 3, 0.4, 0.1, 15000, 30),
    "viscera": layer("OTHER", 0.5, 0.2, 0.05, 2500, 6),
}
NAMES = {"skin": "skin", "fat": "subcutaneous fat", "fascia": "thoracolumbar fascia", "muscle": "back muscle",
         "supraspinous": "supraspinous ligament", "interspinous": "interspinous ligament", "flavum": "ligamentum flavum",
         "epidural": "epidural space", "dura": "dura and arachnoid", "csf": "cerebrospinal fluid",
         "disc": "intervertebral disc", "viscera": "retroperitoneal fat"}
# What the tissue does not say; fibres, those between the spinous processes rising to the back: set by hand
KINDS = {"fascia": "FASCIA", "supraspinous": "LIGAMENT", "interspinous": "LIGAMENT", "flavum": "LIGAMENT", "dura": "DURA", "csf": "FLUID",
         "disc": "DISC", "viscera": "FAT", "roots": "NERVE"}
FIBRES = {"muscle": (1, 0, 0), "multifidus": TUBE, "erector": TUBE, "psoas": TUBE, "roots": TUBE, "supraspinous": (1, 0, 0),
          "interspinous": (-1, 0, 1), "flavum": (1, 0, 0)}
FORCES = {"slender": (0.8, 0.8), "median": (1, 0.9), "heavy": (1, 0.85)}  # of cutting, of friction


class Spine:
    """Lengths along the column are arcs at the bodies' middle; the arc's lowest point lies at the needle."""

    def __init__(self, p):
        self.sac = -(p.depth + p.epidural + 0.5 * p.sac)
        self.body = self.sac - 0.5 * p.sac - 1.8 - 0.5 * p.body_depth
        self.top = self.body + BEND
        pitch = p.disc + p.body_height
        self.levels = {"l2": DISC_AT - 1.5 * pitch, "l3": DISC_AT - 0.5 * pitch, "l4": DISC_AT + 0.5 * pitch,
                       "l5": DISC_AT + 1.5 * pitch}
        self.discs = {name: DISC_AT + k * pitch for k, name in
                      enumerate(("disc-l1-l2", "disc-l2-l3", "disc-l3-l4", "disc-l4-l5", "disc-l5-s1"), -2)}

    def at(self, arc, along, y, z):
        """The point `along` from the vertebra at `arc`, tilted with it."""
        tilt = arc / BEND
        return (along * math.cos(tilt) + (self.top - z) * math.sin(tilt), y,
                self.top + along * math.sin(tilt) - (self.top - z) * math.cos(tilt))

    def along(self, arc, x, z):
        """Where a vertebra's own line at depth z meets the plane x."""
        tilt = arc / BEND
        return (x - (self.top - z) * math.sin(tilt)) / math.cos(tilt)

    def line(self, y, z, radius, along=ALONG):
        """Along the canal: level at the needle, bent beyond."""
        return [(x, y, z + max(0, abs(x) - 12) ** 2 / (2 * (self.top - z)), radius) for x in along]


def surface(p, d):
    """The depth in the midline at which the skin is `d` away: two ridges side by side, with a blend of a quarter."""
    whole = p.ridge + 4
    height = math.sqrt(whole ** 2 - p.furrow ** 2)
    return height - math.sqrt((whole - d) ** 2 - p.furrow ** 2)


def expected(p):
    """The layers in the midline, by formula."""
    tips = p.skin + p.fat
    return [("skin", 0), ("fat", surface(p, p.skin)), ("supraspinous", tips), ("interspinous", tips + p.supraspinous),
            ("flavum", p.depth - p.flavum), ("epidural", p.depth), ("dura", p.depth + p.epidural),
            ("csf", p.depth + p.epidural + p.dura)]


def targets(p):
    return [("epidural space", "epidural", (0, 0, -p.depth - 0.5 * p.epidural))]


def hazards(_):
    return [("dural sac", "NERVE", "dura"), ("cerebrospinal fluid", "NERVE", "csf"), ("nerve roots", "NERVE", "roots")]


def wrong_paths(p):
    return [("too steep towards the head", (-13, 0, -p.depth + 8), "l3"),
            ("too steep towards the feet", (11, 0, -p.depth + 22), "l4"),
            ("beside the midline", (0, 13, -p.depth), "l3")]


def measures(p):
    """words, structures, a point, a direction, mm inside (or, with two lists, from the one to the other), tolerance."""
    spine = Spine(p)
    disc, tip = spine.at(DISC_AT, 0, 0, spine.body), -(p.skin + p.fat + 6)
    middle = spine.at(spine.levels["l4"], 0, 0, spine.body)
    return [("disc, height", ["disc"], disc, (1, 0, 0), p.disc, 0.3), ("disc, width", ["disc"], disc, (0, 1, 0), p.body_width, 0.3),
            ("disc, depth", ["disc"], disc, (0, 0, 1), p.body_depth, 0.3), ("body, height", ["body"], middle, (1, 0, 0.05), p.body_height, 0.5),
            ("between spinous processes", (["l3"], ["l4"]), (0, 0, 0.5 * (tip - p.depth)), (1, 0, 0), p.gap, 1.6),
            ("dural sac", ["dura", "csf", "roots"], (0, 0, spine.sac), (0, 0, 1), p.sac, 0.1),
            ("flavum", ["flavum"], (0, 0, -p.depth + 0.5 * p.flavum), (0, 0, 1), p.flavum, 0.01)]


def vertebra(v, p, spine, name):
    arc, e, r = spine.levels[name], p.depth, 3.3
    wide = 1.12 if name == "l5" else 1

    def at(along, y, z):
        return spine.at(arc, along, y, z)
    for side in (-1, 1):
        start = 0 if side < 0 else 3
        for along, y, z, k in ((-4, 15, -8, 3.2), (4, 14, -6, 3.5), (11, 12, -3, 3.3)):     # lamina, three rows
            middle = -e + {-4: 2.9, 4: 4.8, 11: 6.9}[along]
            v.capsule(name, at(along, 0, middle), at(along, side * y * wide, -e + z), 3, k, blend=4 if start else 0)
            start = 4
        v.capsule(name, at(11, side * 12 * wide, -e - 2), at(23, side * 11.5 * wide, -e + 0.5), 5, 4.3, blend=4)   # inferior facet
        v.capsule(name, at(-4, side * 15.5 * wide, -e - 9), at(-18, side * 19 * wide, -e - 6.5), 5, 4.2, blend=4)  # superior
        for along in (-7, -4):                                                              # pedicle
            v.capsule(name, at(along, side * 14 * wide, spine.body + 0.3 * p.body_depth), at(along, side * 15 * wide, -e - 10), 4.4,
                      blend=5)
        v.capsule(name, at(-5, side * 17 * wide, -e - 12), at(-5, side * 44, -e - 8), 4.8, 3.4, blend=5)           # transverse
    # spinous process: from the lamina to its thick tip
    tip = -(p.skin + p.fat + 2.2 + 4)
    sign = -1 if arc < 0 else 1
    level = {"l2": -1, "l3": 0, "l4": 0, "l5": 1}[name]
    shift = level * (p.disc + p.body_height) * (spine.top - 0.5 * (tip - e)) / BEND
    near = spine.along(arc, shift + sign * 0.5 * p.gap, 0.5 * (tip - e)) + sign * r
    far = near + sign * (p.process - 2 * r)
    upper, lower = min(near, far), max(near, far)
    v.capsule(name, at(-1.5, 0, -e + 7), at(upper, 0, tip - 3), r, blend=4)
    v.capsule(name, at(12.5, 0, -e + 9.5), at(lower, 0, tip - 3), r, blend=4)
    v.capsule(name, at(5, 0, -e + 8), at(0.5 * (upper + lower), 0, tip - 2), r + 0.3, blend=4)
    v.capsule(name, at(upper + 1.2, 0, tip), at(lower - 1.2, 0, tip), 4, blend=4)


def column(v, p, spine):
    r, half = 0.5 * p.body_depth, 0.5 * p.body_height
    side = 0.5 * p.body_width - r
    for y in (0, -side, side):
        points = []
        pitch = p.disc + p.body_height
        for arc in (spine.levels["l2"] - pitch, *spine.levels.values(), spine.levels["l5"] + pitch):
            points += [(*spine.at(arc, along, y, spine.body), r - inward) for along, inward in ((-half, 0), (0, 1.8), (half, 0))]
        v.tube("column", points)
    for name, arc in spine.discs.items():
        tilt = arc / BEND
        v.half_space(name, spine.at(arc, 0, 0, spine.body), (math.cos(tilt), 0, math.sin(tilt)))


def canal(v, p, spine):
    z, r = spine.sac, 0.5 * p.sac
    for y in (0, -3, 3):
        v.tube("sac", spine.line(y, z, r))
    for y in (-5, 5):
        v.tube("canal", spine.line(y, z - 0.5, r + 1.3))
    for y, down, radius in ((0, 3, 3), (-2.5, 6, 4.2), (2.5, 6, 4.2)):  # the gable between the flava
        v.tube("canal", spine.line(y, -p.depth - down, radius))
    for y, dz in ((-4.5, 1), (-2.6, 3.4), (-1.6, -1), (1.8, -3), (2.4, 3.2), (4.6, 0.5), (-4.2, -2.6), (0.8, 0.2)):
        (first, *_), *middle, (last, *_) = line = spine.line(y, z + dz, 0.75, (-88, -20, 20, 88))
        v.tube("roots", [(first, 0.3 * y, line[0][2] - 0.7 * dz, 0.75), *middle, (last, 0.5 * y, line[-1][2] - 0.5 * dz, 0.75)])
    for arc in list(spine.levels.values())[:3]:                     # each leaves below its own pedicle, for the plexus in the psoas
        for side in (-1, 1):
            v.tube("roots", [(*spine.at(arc, -4, side * 6, z), 1.2), (*spine.at(arc, 5, side * 15, z - 3), 2.6),
                             (*spine.at(arc, 70, side * 43, spine.body - 8), 0.8)])


def belly_mm(p):
    return 0.38 * p.waist


def around(v, p, spine):
    back = -(p.skin + p.fat)
    whole = p.ridge + 4
    height = math.sqrt(whole ** 2 - p.furrow ** 2)
    flank = 0.5 * p.waist

    def along(group, y, z, radius, blend=0, end=200):  # muscles leave the picture
        for side in (-1, 1):
            v.capsule(group, (-end, side * y, z), (end, side * y, z), radius, blend=blend)
    v.capsule("skin", (-90, -p.furrow, -height), (90, -p.furrow, -height), p.ridge)
    v.capsule("skin", (-90, p.furrow, -height), (90, p.furrow, -height), p.ridge, blend=16)
    along("skin", p.waist - flank, -flank - 24, flank, 30, end=90)
    v.capsule("skin", (-90, 0, -1.05 * p.waist), (90, 0, -1.05 * p.waist), 0.7 * p.waist, blend=30)
    along("multifidus", 15, 0.5 * (back - p.depth) - 3, 13)
    along("erector", 42, back - 23, 20)
    along("erector", 60, back - 29, 15, 12)
    for side in (-1, 1):
        v.capsule("psoas", (-90, side * 31, spine.body), (198, side * 55, spine.body - 19.2), 14, 26.8)
    v.half_space("midline", (0, 0, 0), (0, 1, 0))
    v.half_space("levels", (0, 0, 0), (1, 0, 0))
    v.half_space("behind", (0, 0, -p.depth - 11), (0, 0, 1))
    v.half_space("front", (0, 0, spine.body + 8), (0, 0, -1))
    belly = belly_mm(p)                                 # its back is rounded beside the muscles
    along("cavity", p.waist - belly - p.fat - 16, spine.body + 8 - belly, belly, blend=60)


def looks(v, p):
    """Hips, trunk, neck and head from behind: skin alone, so that one sees what it is. Nothing changes within 40 mm of entry and L4."""
    w = p.waist / 145
    deep, out = -0.5 * p.waist - 24, 0.5 * p.waist
    for side in (-1, 1):
        v.tube("skin", [(-90, side * p.furrow, -p.ridge - 2, p.ridge), (-230, side * 52, -78, 72), (-330, side * 70, -84, 70)], blend=16)
        v.tube("skin", [(-85, side * (p.waist - out), deep, out), (-260, side * 75, deep + 4, 88 * w), (-350, side * 85, deep + 14, 74)], blend=30)
        v.tube("skin", [(100, side * (p.waist - out), deep, out), (150, side * 84 * w, deep + 5, 86 * w), (215, side * 90 * w, -96, 92 * w)], blend=30)
        v.ellipsoid("skin", (205, side * 68 * w, -62), (96, 76 * w, 74), blend=14)
        v.capsule("skin", (235, side * 88 * w, -95), (520, side * 84 * w, -105), 90 * w, 62, blend=12)
        v.ellipsoid("skin", (-320, side * 88, -42), (85, 52, 50), blend=20)
        v.tube("skin", [(-385, side * 178, -88, 56), (-300, side * 205, -92, 48), (-90, side * 225 * w ** 0.5, -100, 40)], blend=20)
    v.capsule("skin", (-390, -130, -88), (-390, 130, -88), 62, blend=30)
    v.capsule("skin", (-400, 0, -86), (-520, 0, -96), 70, 58, blend=40)
    v.ellipsoid("skin", (-605, 0, -112), (112, 78, 98), blend=14)


def volume(p):
    v, spine = Volume("skin", "muscle"), Spine(p)
    around(v, p, spine)
    looks(v, p)
    column(v, p, spine)
    for name in spine.levels:
        vertebra(v, p, spine, name)
    canal(v, p, spine)
    share = FORCES[p.build]
    for id, made in LAYERS.items():
        v.structure(id, NAMES[id], softened(made, share))
    v.structure("multifidus", "multifidus muscle", softened(LAYERS["muscle"], share))
    v.structure("erector", "erector spinae muscle", softened(LAYERS["muscle"], share))
    v.structure("psoas", "psoas muscle", softened(LAYERS["muscle"], share))
    v.structure("facet", "facet joint", softened(CARTILAGE, share))
    v.structure("roots", "nerve roots", NERVE)
    v.structure("body", "vertebral bodies", BONE)
    joints = (("l2", "l3"), ("l3", "l4"), ("l4", "l5"))
    for name in spine.levels:  # each hollowed by the one above
        v.structure(name, f"vertebra {name.upper()}", BONE)
        v.rule(name, name, None, 0, *((upper, 1.6, None) for upper, lower in joints if lower == name))
    for disc in spine.discs:
        v.rule("disc", disc, -0.5 * p.disc, 0.5 * p.disc, ("column", None, 0))
    v.rule("body", "column", None, 0)
    v.rule("roots", "roots", None, 0)
    v.rule("csf", "sac", None, -p.dura)
    v.rule("dura", "sac", None, 0)
    v.rule("epidural", "canal", None, 0)
    for upper, lower in joints:
        v.rule("facet", lower, None, 1.6, (upper, 0, 1.6), ("behind", None, 26))
    shift = (p.disc + p.body_height) * (spine.top + p.depth) / BEND
    for level in (0, -1, 1):
        v.rule("flavum", "canal", 0, p.flavum, ("behind", 0, None), ("levels", level * shift - 16, level * shift + 12))
    v.rule("epidural", "canal", 0, 2.5)
    v.rule("skin", "skin", -p.skin, None)
    tips = p.depth + p.epidural - p.skin - p.fat
    v.rule("interspinous", "midline", -3.2, 3.2, ("sac", 0, tips - p.supraspinous), ("behind", 0, None))
    v.rule("supraspinous", "midline", -4.5, 4.5, ("sac", 0, tips), ("behind", 0, None))
    v.rule("fat", "skin", -p.skin - p.fat, None)
    v.rule("fascia", "skin", -p.skin - p.fat - 1, None, ("front", None, 0))
    for muscle in ("multifidus", "erector", "psoas"):
        v.rule(muscle, muscle, None, 0)
    for group, low, high in (("cavity", None, 0), ("front", belly_mm(p), None)):
        v.rule("viscera", group, low, high, ("skin", None, -p.skin - p.fat - 14))
    v.describe(KINDS, FIBRES, {})
    return v


REGION = dict(
    id="lumbar", name="Lumbar spine", title="epidural space at L3-L4",
    needle={"slender": (0.09, 18), "median": (0.09, 18), "heavy": (0.12, 18)}, tip=("TUOHY", None),
    fixture={"slender": 2, "median": 2.5, "heavy": 2.2}, cut_memory=True, landmark="l4", landmark_name="spinous process", unfelt=("heavy",),
    directions={"plus_x": "towards the feet", "minus_x": "towards the head", "plus_y": "to the patient's right",
                "minus_y": "to the patient's left", "plus_z": "out of the back", "minus_z": "to the front"},
    description="Midline approach to the epidural space between L3 and L4. x towards the feet, y to the patient's right, z out of the "
                "back. Behind the ligamentum flavum resistance is lost.",
    forces="Bone 4 N, attracted force 0.4 N: enhanced-tracking-wall paper; ligaments 1.75 to 3 N: its range, chosen by hand; skin, fat, "
           "fluid and dura set by hand, thin ones so that they can be felt at 500 N/m; "
           "times {share} in this build, by hand. Share of cutting that a cut still costs: Barnett (18 of 79 %).")
