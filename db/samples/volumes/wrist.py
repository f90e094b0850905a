"""The left wrist, palm up, for an injection into the carpal tunnel beside the median nerve.

Frame: x towards the fingers, y towards the thumb, z out of the palm's side; the needle enters at the origin and goes
towards the fingers, at 45° to the skin.
"""
import math

from field import TUBE, Volume
from tissues import BONE, CARTILAGE, NERVE, VESSEL, layer, softened

PARAMETERS = [
    ("skin", (1.4, 1.6, 1.8), "set by hand"),
    ("fat", (1.2, 2, 4), "set by hand"),
    ("retinaculum", (1.5, 1.8, 2), "set by hand"),
    ("depth", (9.3, 10.4, 11.5), "tunnel 10.4 ± 1.1 mm deep: Mani 2011"),
    ("width", (20, 22, 24), "tunnel 25 mm wide at its beginning, 20 mm at the hook of the hamate: Hand Clin 2002;18:219"),
    ("arch", (23.8, 25.7, 27.6), "carpal arch 25.7 ± 1.9 mm wide: Clin Biomech 2013, PMC3669224"),
    ("nerve_thickness", (1.7, 1.76, 1.8), "median nerve 7.5 mm² in the tunnel, about 2.5 times as wide as thick: Mani 2011"),
    ("nerve_width", (4.4, 4.76, 4.9), "the same"),
    ("beside", (2.6, 3.1, 3.4), "set by hand, within 4.8 ± 4.0 mm from needle to nerve in 15 arms: J Hand Surg 2009, PubMed 19410990"),
    ("tendon", (1.45, 1.6, 1.75), "radius of a flexor tendon: set by hand"),
    ("thick", (35, 40, 46), "wrist, palm to back: set by hand"),
    ("across", (52, 58, 64), "wrist, side to side: set by hand"),
]
ROOT = math.sqrt(2)
# Bones, and which earlier ones each meets: 1 mm of cartilage between them, 2 mm at the radius, set by hand
CARVED = {"radius": (), "ulna": (), "capitate": (), "lunate": ("radius", "capitate"), "scaphoid": ("radius", "capitate", "lunate"),
          "hamate": ("capitate", "lunate"), "triquetrum": ("lunate", "hamate"), "pisiform": ("triquetrum",),
          "trapezoid": ("capitate", "scaphoid"), "trapezium": ("trapezoid", "scaphoid"),
          "metacarpals": ("capitate", "hamate", "trapezoid")}

LAYERS = {
    "skin": layer("SKIN", 0.4, 0.2, 0.05, 7000, 15, (200, 20000, 0.22)),
    "fat": layer("FAT", 0.25, 0.15, 0.05, 2500, 10),
    "retinaculum": layer("TENDON", 0.9, 0.3, 0.05, 14000, 45, (250, 5000, 0.4)),
    "tunnel": layer("OTHER", 0.35, 0.15, 0.05, 1500, 5),
    "tendon": layer("TENDON", 1.2, 0.3, 0.05, 14000, 40),
    "muscle": layer("MUSCLE", 0.6, 0.3, 0.05, 7000, 20),
    "ligament": layer("TENDON", 1.2, 0.3, 0.05, 14000, 40),
}
NAMES = {"skin": "skin", "fat": "subcutaneous fat", "retinaculum": "transverse carpal ligament", "tunnel": "carpal tunnel",
         "tendon": "flexor tendons", "muscle": "muscles of forearm and hand", "ligament": "carpal ligaments"}
# What the tissue does not say; fibres; pulses in mm: set by hand
KINDS = {"retinaculum": "LIGAMENT", "tunnel": "SYNOVIUM", "ligament": "LIGAMENT", "nerve": "NERVE", "ulnar-nerve": "NERVE",
         "artery": "ARTERY", "radial-artery": "ARTERY"}
FIBRES = {**{id: TUBE for id in ("tendon", "palmaris", "wrist-flexors", "extensors", "nerve", "ulnar-nerve", "artery", "radial-artery")},
          "retinaculum": (0, 1, 0), "muscle": (1, 0, 0), "thenar": (1, 0, 0)}
PULSES = {"artery": 0.03, "radial-artery": 0.03}
FORCES = {"slender": (0.8, 1), "median": (1, 1.05), "heavy": (1.1, 1.1)}  # of cutting, of friction


def roof(p):
    return -(p.skin + p.fat + p.retinaculum)


def expected(p):
    """The layers along the needle, by formula: everything above the tunnel is level there."""
    return [("skin", 0), ("fat", p.skin * ROOT), ("retinaculum", (p.skin + p.fat) * ROOT), ("tunnel", -roof(p) * ROOT)]


def goal(p):
    return -roof(p) + 1.15


def nerve_at(p):
    """Middle of the median nerve in the tunnel: (y, z)."""
    return p.beside + 0.5 * p.nerve_width, roof(p) - 0.5 * p.nerve_thickness - 0.35


def targets(p):
    return [("carpal tunnel", "tunnel", (goal(p), 0, -goal(p)))]


def artery(p):
    """The ulnar artery beside the pisiform: (y, z)."""
    return -0.35 * p.arch, -(p.skin + 1.75)


def hazards(_):
    return [("median nerve", "NERVE", "nerve"), ("ulnar artery", "VESSEL", "artery"), ("flexor tendons", "OTHER", "tendon")]


def wrong_paths(p):
    y, z = nerve_at(p)
    return [("straight down, too deep", (1, 0, roof(p) - p.depth - 4), "carpals"),
            ("towards the thumb", (goal(p), y, z), "nerve")]


def measures(p):
    """words, structures, a point, a direction, mm inside (or, with two lists, from the one to the other), tolerance."""
    y, z = nerve_at(p)
    inside = ["tunnel", "tendon", "nerve"]
    return [("tunnel, depth", inside, (14, 0, roof(p) - 3), (0, 0, 1), p.depth, 0.05),
            ("tunnel, width", inside, (14, 0, roof(p) - 0.45 * p.depth), (0, 1, 0), p.width, 2),
            ("nerve, width", ["nerve"], (14, y, z), (0, 1, 0), p.nerve_width, 0.05),
            ("nerve, thickness", ["nerve"], (14, y, z), (0, 0, 1), p.nerve_thickness, 0.05),
            ("ligament", ["retinaculum"], (14, 0, roof(p) + 0.5 * p.retinaculum), (0, 0, 1), p.retinaculum, 0.01),
            ("hook to trapezium", (["carpals"], ["carpals"]), (20.5 * p.arch / 25.7, 0, roof(p) - 0.42 * p.depth), (0, 1, 0),
             0.8 * p.arch, 2)]


def bones(v, p):
    s, floor = p.arch / 25.7, roof(p) - p.depth

    def at(x, y, down):
        """`down`: behind the tunnel's floor in its middle."""
        return (x * s, y * s, floor - down * s)
    tip = roof(p) - 0.42 * p.depth      # of hook and tubercles: where the ligament is held
    # forearm
    v.capsule("radius", (-78, 9 * s, floor - 6), at(-26, 9, 8), 5.7 * s, 7.1 * s)
    for a, b, r in ((at(-26, 9, 8), at(-13.5, 14.5, 6), 7.9), (at(-26, 9, 8), at(-13.5, 5, 8), 7.4)):
        v.capsule("radius", a, b, 6.5 * s, r * s, blend=6 * s)
    v.capsule("radius", at(-14, 17, 6.5), at(-6.5, 19, 6), 6 * s, 3.5 * s, blend=5 * s)      # styloid
    v.capsule("ulna", (-78, -12 * s, floor - 9), at(-22, -11.5, 9), 5.6 * s, 5.6 * s)
    v.capsule("ulna", at(-22, -11.5, 9), at(-14.5, -11.5, 9), 5.6 * s, 7 * s, blend=3 * s)
    v.capsule("ulna", at(-14.5, -15, 12), at(-8, -15.5, 12), 3 * s, 2 * s, blend=2 * s)
    # eight carpal bones; a later one of CARVED is hollowed where it meets an earlier one
    def bone(name, center, radii, x_axis=(1, 0, 0), y_axis=(0, 1, 0)):
        v.ellipsoid(name, at(*center), tuple(r * s for r in radii), x_axis=x_axis, y_axis=y_axis)
    v.capsule("capitate", at(14, 1, 7.6), at(24, 0.4, 7.8), 5.8 * s, 6.2 * s)
    bone("lunate", (2.2, 0.3, 7.5), (7.4, 6.4, 8))
    bone("scaphoid", (3.2, 12.6, 6), (9.4, 5.4, 7), x_axis=(0.8, 0.35, 0.5))
    v.capsule("scaphoid", at(6, 13.3, 2), (10.5 * s, 13.9 * s, tip), 3.8 * s, 3 * s, blend=4 * s)                # its tubercle
    bone("hamate", (19, -11.2, 7.6), (8.6, 6, 7.6), x_axis=(0.95, -0.25, 0))
    v.capsule("hamate", at(21, -11.8, 3), (21.5 * s, -12 * s, tip), 3.6 * s, 2.7 * s, blend=3 * s)           # its hook
    bone("triquetrum", (4, -11.8, 8), (7, 5.6, 7), x_axis=(0.9, -0.35, 0))
    v.capsule("pisiform", (5 * s, -13.8 * s, tip - 2), (8 * s, -13.6 * s, tip - 1.5), 4.6 * s, 4.3 * s)
    bone("trapezoid", (20, 10.6, 7.5), (7, 4.6, 6.4))
    bone("trapezium", (19.5, 16.2, 1), (7.4, 5, 7), x_axis=(0.9, 0.3, 0.1))
    v.capsule("trapezium", at(20, 15, -2), (20 * s, 13.8 * s, tip), 3.6 * s, 2.6 * s, blend=3 * s)           # its tubercle
    v.ellipsoid("carpus", at(14, 0.5, 6), (23 * s, 21 * s, 14 * s))
    for x, y, end_x, end_y, down, base, r in ((30.6, 22.5, 58, 39, -7, 4.6, 5), (32, 10.6, 74, 16, 7, 4, 5), (34.6, 1.6, 74, 4, 7.6, 4, 5),
                                              (33, -6.8, 73, -8, 7.4, 3.7, 4.8), (32, -14.3, 70, -19.5, 5.5, 3.4, 4.6)):
        start, end = at(x, y, 0.55 * down if y > 19 else down), at(end_x, end_y, down)
        middle = tuple(0.5 * (a + b) for a, b in zip(start, end))
        v.tube("metacarpals", [(*start, base * s), (*middle, 0.8 * base * s), (*end, r * s)])


def tendons(v, p):
    s, top, r = p.arch / 25.7, roof(p), p.tendon
    deep = p.depth - 2 * r - 0.4
    # in the tunnel: y, below its roof; where each goes in the palm: y at x = 80
    superficial = ((2.3, 2.5 + r, 5, 0.95), (-2.3, 2.5 + r, -7, 0.95), (5.6, 2.8 + r, 17, 0.85), (-6.1, 2.3 + r, -19, 0.75))
    profundus = ((4.9, deep - 0.2 + r, 18, 1), (1.3, deep - 0.6 + r, 6, 1), (-2.3, deep - 0.4 + r, -7, 1), (-5.8, deep - 0.9 + r, -20, 0.9))
    for flexors, sink, over in ((superficial, -0.5, 2.2 * r + 0.4), (profundus, 0.3, -0.6)):
        for y, down, palm, k in flexors:
            z = top - down
            finger = (114, 1.2 * palm * s, top - p.depth + 7.4, 0.3) if sink < 0 else (132, 1.45 * palm * s, top - p.depth + 5, 0.3)
            v.tube("tendons", [(-78, 1.1 * y * s, z - sink, 1.2 * k * r), (-16, 1.08 * y * s, z, k * r), (30 * s, y * s, z, k * r),
                               (82, palm * s, top - p.depth + 3 + over, k * r), finger])
    v.tube("tendons", [(-78, 13 * s, top - 0.8 * p.depth, 1.4 * r), (-16, 9.6 * s, top - 0.55 * p.depth, 0.9 * r),
                       (24 * s, 8.8 * s, top - 0.61 * p.depth, 0.9 * r), (66, 37 * s, top - p.depth + 12.6 * s + r, 0.9 * r),
                       (102, 60 * s, top - p.depth + 15.5, 0.4)])            # flexor pollicis longus
    y, z = nerve_at(p)
    thin = 0.5 * p.nerve_thickness
    for k in (0, -1, 1):
        spread = k * (0.5 * p.nerve_width - thin)
        v.tube("nerve", [(-78, y + 5.4 + 0.5 * spread, z - 5, 1.5 * thin), (-22, y + 3.2 + 0.7 * spread, z - 0.8, 1.2 * thin),
                         (-6, y + spread, z - 0.3, thin), (33 * s, y + spread, z, thin), (60, y + 4 * spread + 1, z - 0.4, 1),
                         (86, y + 8 * spread + 6, z - 1.6, 1)])
    # superficial to the ligament: palmaris longus; flexors of the wrist
    flat = 0.36 * p.fat
    for dy in (-0.9, 0, 0.9):
        v.tube("palmaris", [(-78, 3 + dy, -(p.skin + p.fat + 1.6), 1.2 * flat + 0.3), (-20, 3.7 + dy, -(p.skin + 0.6 * p.fat), flat),
                            (20, 3.9 + 1.6 * dy, -(p.skin + 0.6 * p.fat), 0.8 * flat),
                            (44, 4 + 5 * dy, -(p.skin + 0.75 * p.fat), 0.6 * flat)])
    over = top - 0.42 * p.depth  # over the tubercles of scaphoid and trapezium; the other ends at the pisiform
    v.tube("wrist-flexors", [(-78, 13 * s, top - 1.8, 2 * s), (-12, 12.6 * s, top - 1.6, 1.9 * s), (2, 13.5 * s, over + 4.2 * s, 1.5 * s),
                             (10.5 * s, 14 * s, over + 4.9 * s, 1.4 * s), (20 * s, 14.4 * s, over + 4.2 * s, 1.3 * s)])
    v.tube("wrist-flexors", [(-78, -16 * s, top - 4, 4 * s), (-16, -14.2 * s, top - 3, 2.3 * s), (-1.3 * s, -13.8 * s, over - 2, 1.6 * s)])
    back = -p.thick + p.skin + p.fat + 1.7
    for y, x in ((15, 30), (9, 40), (3, 70), (-2, 75), (-7, 75), (-14, 70)):
        v.tube("extensors", [(-78, 0.9 * y * s, back + 0.6, 1.6), (0, 0.85 * y * s, back - 0.6, 1.3), (x, 1.25 * y * s, back + 3, 0.7)])


def vessels(v, p):
    s, top = p.arch / 25.7, roof(p)
    y, z = artery(p)
    v.tube("artery", [(-78, -12.5 * s, top - 5, 1.5), (-16, y - 2, z - 3.4, 1.3), (0, y - 0.6, z - 0.7, 1.2), (10, y, z, 1.2),
                      (24, y + 1, z - 0.4, 1.1), (40, y + 5, z - 3.6, 1), (47, 3, z - 4.2, 0.8), (46, 18 * s, z - 4.6, 0.7)])  # the arch
    v.tube("ulnar-nerve", [(-78, -14.5 * s, top - 8, 1.5), (-16, y - 3.2, z - 5.2, 1.3), (0, y - 2.9, z - 2.1, 1.25),
                           (10, y - 2.5, z - 1.5, 1.2), (24, y - 1.7, z - 1.7, 1.1), (44, y - 7, z - 5, 1.1), (66, y - 11, z - 8, 1)])
    v.tube("radial-artery", [(-78, 15 * s, top - 4, 1.5), (-14, 16.8 * s, top - 2.6, 1.3), (-2, 20.5 * s, top - 9, 1.2),
                             (14, 19.5 * s, top - 20, 1.1), (30, 17.5 * s, top - 22, 0.8)])


def around(v, p):
    s, top, r = p.arch / 25.7, roof(p), 0.5 * p.depth
    half = 0.5 * p.thick
    flat = 0.5 * p.across - half
    rows = (0, -0.5 * flat, 0.5 * flat, -flat, flat)
    for y in rows:  # close beside each other: level above the tunnel
        v.capsule("skin", (-20, y, -half), (24, y, -half), half)
    for y in rows:
        v.capsule("skin", (-80, 1.2 * y, -half - 1), (-20, y, -half), half + 1, half, blend=1)
        v.capsule("skin", (24, y, -half), (72, 2.2 * y, -half + 1), half, 0.76 * half, blend=2)
    for y, x in ((0.36, 40), (-0.3, 42)):                                                     # thenar, hypothenar
        v.ellipsoid("skin", (x, y * p.across, -0.42 * half), (24, 0.2 * p.across, 0.52 * half), blend=8)
        v.ellipsoid("thenar", (x, 0.94 * y * p.across, -0.42 * half - 1), (23, 0.19 * p.across, 0.5 * half))
    floor = top - p.depth
    v.capsule("skin", (26, 17 * s, floor - 1), (64, 43 * s, floor + 6), 0.66 * half, 0.58 * half, blend=8)   # thumb
    across = 0.5 * p.width - r
    for y in (0, -0.5 * across, 0.5 * across, -across, across):
        v.capsule("tunnel", (-20, y, top - r), (36 * s, y, top - r), r)
    reach, s_end = top - r, 29 * s                       # the ligament over it, thin at its ends
    for y in (0, -0.5 * across, 0.5 * across, -across, across):
        v.tube("retinaculum", [(-2.6, y, reach, r), (1.9, y, reach, r + p.retinaculum), (s_end - 3, y, reach, r + p.retinaculum),
                               (s_end + 1.5, y, reach, r)])
    v.half_space("palmar", (0, 0, top - 0.62 * p.depth), (0, 0, 1))
    v.half_space("levels", (0, 0, 0), (1, 0, 0))


def looks(v, p):
    """Fingers, thumb and arm: skin alone, so that one sees what it is. Nothing changes within 40 mm of entry and carpal bones."""
    s, half = p.arch / 25.7, 0.5 * p.thick
    for y, out, length in ((20, 31, 80), (5.5, 8, 88), (-9.5, -17, 82), (-24, -42, 64)):      # base, tip: towards the thumb
        def joint(share, z, r):
            return (70 + share * length, (y + share * (out - y)) * s, z - half, 0.42 * half * r)
        v.tube("skin", [joint(0, -1, 1.05), joint(0.48, 4, 1), joint(0.78, 10, 0.9), joint(0.98, 17, 0.76)], blend=5)
    z = roof(p) - p.depth
    v.tube("skin", [(64, 43 * s, z + 6, 0.56 * half), (86, 55 * s, z + 10, 0.48 * half), (108, 62 * s, z + 15, 0.4 * half)], blend=4)
    for side in (-1, 1):
        v.tube("skin", [(-80, side * 0.2 * p.across, -half - 1, half + 1), (-175, side * 0.3 * p.across, -half - 3, 1.6 * half),
                        (-245, side * 0.22 * p.across, -half - 4, 1.75 * half)], blend=10)
    v.capsule("skin", (-245, 0, -half - 6), (-330, 0, -half - 10), 2 * half, 2.2 * half, blend=20)


def volume(p):
    v = Volume("skin", "muscle")
    around(v, p)
    looks(v, p)
    bones(v, p)
    tendons(v, p)
    vessels(v, p)
    v.go_on(("radius", "ulna", "tendons", "palmaris", "wrist-flexors", "extensors", "nerve", "ulnar-nerve", "artery", "radial-artery"),
            0, -78, -130)
    share = FORCES[p.build]
    for id, made in LAYERS.items():
        v.structure(id, NAMES[id], softened(made, share))
    for id, name in (("palmaris", "palmaris longus tendon"), ("wrist-flexors", "flexor carpi tendons"), ("extensors", "extensor tendons")):
        v.structure(id, name, softened(LAYERS["tendon"], share))
    v.structure("thenar", "thenar and hypothenar muscles", softened(LAYERS["muscle"], share))
    v.structure("wrist-fat", "fat around the wrist", softened(LAYERS["fat"], share))
    v.structure("cartilage", "cartilage of the wrist", softened(CARTILAGE, share))
    v.structure("nerve", "median nerve", NERVE)
    v.structure("ulnar-nerve", "ulnar nerve", NERVE)
    v.structure("artery", "ulnar artery", VESSEL)
    v.structure("radial-artery", "radial artery", VESSEL)
    for bone, name in (("radius", "radius"), ("ulna", "ulna"), ("carpals", "carpal bones"), ("metacarpals", "metacarpal bones")):
        v.structure(bone, name, BONE)
    for bone, met in CARVED.items():
        v.rule(bone if bone in v.structures else "carpals", bone, None, 0, *((other, 2 if other == "radius" else 1, None) for other in met))
    for thin in ("nerve", "ulnar-nerve", "artery", "radial-artery"):
        v.rule(thin, thin, None, 0)
    v.rule("tendon", "tendons", None, 0)
    for thin in ("wrist-flexors", "palmaris", "extensors"):
        v.rule(thin, thin, None, 0)
    for bone, met in CARVED.items():
        for other in met:
            thick = 2 if other == "radius" else 1
            v.rule("cartilage", bone, None, thick, (other, 0, thick), ("tunnel", 0.5, None))
    v.rule("cartilage", "metacarpals", 0, 1.5, ("trapezium", 0, 1.5))
    v.rule("tunnel", "tunnel", None, 0)
    v.rule("skin", "skin", -p.skin, None)
    v.rule("retinaculum", "retinaculum", None, 0, ("palmar", 0, None))
    v.rule("ligament", "tunnel", 0, 2, ("levels", -14, 33), ("palmar", None, 0))
    v.rule("ligament", "carpus", None, 0, ("palmar", None, 0))
    v.rule("fat", "skin", -p.skin - p.fat, None)
    v.rule("thenar", "thenar", None, 0)
    v.rule("wrist-fat", "levels", -14, 30)
    v.describe(KINDS, FIBRES, PULSES)
    return v


REGION = dict(
    id="wrist", name="Wrist", title="carpal tunnel beside the median nerve",
    needle={"slender": (0.025, 25), "median": (0.025, 25), "heavy": (0.025, 25)}, tip=("HYPODERMIC", 0.3),
    fixture={"slender": 0.6, "median": 0.7, "heavy": 0.8}, cut_memory=False, landmark="carpals",
    directions={"plus_x": "towards the fingers", "minus_x": "towards the elbow", "plus_y": "towards the thumb",
                "minus_y": "towards the little finger", "plus_z": "out of the palm", "minus_z": "to the back of the hand"},
    description="Left wrist, palm up: from the wrist's crease towards the fingers, at 45° to the skin, on the little finger's side of the "
                "median nerve. x to the fingers, y to the thumb, z out of the palm's side.",
    forces="Bone 4 N: enhanced-tracking-wall paper; the other forces lie below its 1 N for skin, because the needle is thin (25G): set by "
           "hand; times {share} in this build.")
