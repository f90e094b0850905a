"""The right knee, straight, for an injection into the suprapatellar recess from the side, under the quadriceps tendon.

Frame: x down the leg, z out along the needle (10° in front of sideways), y to the front; the needle enters at the origin
and goes straight in. Below, `at(x, r, a)` takes places as an anatomist says them: down the leg, to the outside, to the front,
from the femur's axis.
"""
import math

from field import TUBE, Volume, beside, scaled, to_ellipsoid
from tissues import BONE, CARTILAGE, NERVE, VESSEL, layer, softened

PARAMETERS = [
    ("skin", (1.65, 1.77, 1.89), "dermis of the thigh 1.65 and 1.89 mm: PMC3897752"),
    ("fat", (4, 7, 14), "set by hand"),
    ("recess_length", (22.2, 22.2, 22.2), "suprapatellar recess 22.2 mm long, 4 to 51: Ann Rheum Dis, sonographic norms"),
    ("recess_width", (13.8, 13.8, 13.8), "13.8 mm across: the same"),
    ("recess_depth", (4.5, 5, 5), "front to back, with fluid in it: set by hand"),
    ("capsule", (1.2, 1.5, 1.5), "set by hand"),
    ("tendon", (7, 7.5, 8), "quadriceps tendon 7 ± 1 mm women, 8 ± 1 mm men: Staeubli 1999"),
    ("patellar_tendon", (4.1, 4.4, 4.7), "patellar tendon 4.4 mm: Arthrosc Sports Med Rehabil 2023;5"),
    ("patellar_width", (22.4, 22.4, 22.4), "22.4 ± 3.8 mm wide: Eze 2019"),
    ("condyles", (78.5, 83.5, 88.6), "width over the condyles 78.5 mm women, 88.6 mm men: 360 Greek femora, Anat Res Int 2012"),
    ("condyle_depth", (55.9, 58.5, 61.1), "depth of the medial condyle 55.9 and 61.1 mm: the same"),
    ("notch", (18.7, 20.4, 22), "intercondylar width 18.7 and 22.0 mm: the same"),
    ("patella_length", (40, 43, 46), "set by hand"),
    ("patella_breadth", (41, 44, 47), "set by hand"),
    ("patella_thickness", (22.8, 24.4, 26.1), "width to thickness 1.8 to 1: MRI of 43 patellae, 2018"),
    ("patella_cartilage", (3.8, 4.1, 4.1), "4.1 ± 1.3 mm: the same"),
    ("femoral_cartilage", (2, 2.2, 2.2), "set by hand"),
    ("prefemoral", (5, 6, 8), "fat before the femur: set by hand"),
    ("thigh", (50, 57, 68), "radius above the patella: set by hand"),
    ("vastus", (7, 9, 9), "radius of the vastus lateralis' lowest part: set by hand"),
]
LIFT = 10       # degrees: how far the needle comes from in front of sideways
CORTEX = 15.0   # mm: the femur's front before its axis, at the recess
BASE = 14.0     # mm: the patella's upper pole below the needle

LAYERS = {
    "skin": layer("SKIN", 0.6, 0.3, 0.1, 8000, 25, (300, 20000, 0.5)),
    "fat": layer("FAT", 0.4, 0.2, 0.05, 3000, 10),
    "fascia": layer("OTHER", 0.55, 0.2, 0.05, 9000, 15),
    "pad": layer("FAT", 0.4, 0.2, 0.05, 3000, 10),
    "vastus": layer("MUSCLE", 1.6, 0.4, 0.1, 10000, 25),
    "muscle": layer("MUSCLE", 1.6, 0.4, 0.1, 10000, 25),
    "capsule": layer("CAPSULE", 0.9, 0.3, 0.1, 14000, 25, (330, 20000, 0.6)),
    "recess": layer("OTHER", 0.5, 0.2, 0.05, 1000, 5),
    "quadriceps": layer("TENDON", 2.5, 0.4, 0.1, 15000, 30),
    "patellar-tendon": layer("TENDON", 2.5, 0.4, 0.1, 15000, 30),
    "ligament": layer("TENDON", 2.5, 0.4, 0.1, 15000, 30),
    "cartilage": CARTILAGE,
    "meniscus": CARTILAGE,
}
NAMES = {"skin": "skin", "fat": "subcutaneous fat", "fascia": "fascia and retinaculum", "pad": "fat pads of the knee",
         "vastus": "vastus lateralis muscle", "muscle": "thigh and calf muscles", "capsule": "joint capsule",
         "recess": "suprapatellar recess", "quadriceps": "quadriceps tendon", "patellar-tendon": "patellar tendon",
         "ligament": "ligaments of the knee", "cartilage": "articular cartilage", "meniscus": "menisci"}
# What the tissue does not say; fibres; pulses in mm: set by hand
KINDS = {"fascia": "FASCIA", "recess": "FLUID", "ligament": "LIGAMENT", "nerve": "NERVE", "artery": "ARTERY", "vein": "VEIN"}
FIBRES = {id: TUBE for id in ("vastus", "muscle", "quadriceps", "patellar-tendon", "ligament", "artery", "vein", "nerve")}
PULSES = {"artery": 0.15}
FORCES = {"slender": (0.75, 0.45), "median": (1, 0.48), "heavy": (1, 0.41)}  # of cutting, of friction


class Knee:
    def __init__(self, p):
        self.p, lift = p, math.radians(LIFT)
        self.c, self.s = math.sin(lift), math.cos(lift)            # of the needle: to the front, to the outside
        self.recess = CORTEX + p.prefemoral + 0.5 * p.recess_depth
        self.tendon = self.recess + 0.5 * p.recess_depth + p.capsule + 0.3 + 0.5 * p.tendon
        front = self.tendon + 0.5 * p.tendon + p.fat + p.skin
        self.patella = CORTEX + p.femoral_cartilage + p.patella_thickness + 0.6  # its front: the groove is as deep as the shaft's front
        self.axis = front - p.thigh                                # of the thigh's roundness
        self.depth = self.to_circle(0, self.axis, p.thigh)[1]      # from the recess's middle out to the skin
        self.entry = (self.depth * self.s, self.recess + self.depth * self.c)
        self.joint = BASE + p.patella_length + 10
        # the vastus' lowest part: below the fascia, a little behind the needle
        under = self.to_circle(0, self.axis, p.thigh - p.skin - p.fat - 1)[1]
        behind = 0.4 * p.vastus
        self.vastus = (under * self.s + behind * self.c, self.recess + under * self.c - behind * self.s)

    def to_circle(self, r, a, radius):
        """Where the needle's line, from the recess's middle outwards, enters and leaves a circle."""
        middle = r * self.s + (a - self.recess) * self.c
        half = math.sqrt(radius ** 2 - (r ** 2 + (a - self.recess) ** 2 - middle ** 2))
        return middle - half, middle + half

    def at(self, x, r, a):
        out, front = r - self.entry[0], a - self.entry[1]
        return (x, self.s * front - self.c * out, self.c * front + self.s * out)

    def way(self, r, a):
        """The direction in the frame."""
        return (0, self.s * a - self.c * r, self.c * a + self.s * r)


def expected(p):
    """The layers along the needle, by formula."""
    k = Knee(p)

    def ring(d):
        return k.depth - k.to_circle(0, k.axis, p.thigh - d)[1]
    inner, _ = k.to_circle(*k.vastus, p.vastus)
    radii = (0.5 * p.recess_length, 0.5 * p.recess_width, 0.5 * p.recess_depth)
    low, high = 0.0, 30.0
    while high - low > 1e-6:
        t = 0.5 * (low + high)
        low, high = (t, high) if to_ellipsoid((0, t * k.s, t * k.c), radii) < p.capsule else (low, t)
    recess = 1 / math.sqrt((k.s / radii[1]) ** 2 + (k.c / radii[2]) ** 2)
    return [("skin", 0), ("fat", ring(p.skin)), ("fascia", ring(p.skin + p.fat)),
            ("vastus", ring(p.skin + p.fat + 1)), ("pad", k.depth - inner), ("capsule", k.depth - low), ("recess", k.depth - recess)]


def targets(p):
    return [("suprapatellar recess", "recess", (0, 0, -Knee(p).depth))]


def hazards(_):
    return [("quadriceps tendon", "OTHER", "quadriceps"), ("patella", "BONE", "patella")]


def wrong_paths(p):
    k = Knee(p)
    return [("too far down the leg", k.at(BASE + 0.4 * p.patella_length, 0, k.tendon + 1), "patella"),
            ("too far to the back", k.at(0, 0, 4), "femur")]


def measures(p):
    """words, structures, a point, a direction, mm inside (or, with two lists, from the one to the other), tolerance."""
    k = Knee(p)
    back, middle = CORTEX + 7 - 0.5 * p.condyle_depth, BASE + 0.5 * p.patella_length
    front = k.patella - 2
    return [("condyles, width", ["femur"], k.at(k.joint - 28, 0, back), k.way(1, 0), p.condyles, 2),
            ("condyle, depth", ["femur"], k.at(k.joint - 29, -0.5 * p.condyles + 16, back), k.way(0, 1), p.condyle_depth, 3),
            ("patella, length", ["patella"], k.at(middle, 0, front - 6), (1, 0, 0), p.patella_length, 3),
            ("patella, breadth", ["patella"], k.at(middle - 3, 0, front - 4), k.way(1, 0), p.patella_breadth, 3),
            ("patella, thickness", ["patella"], k.at(middle, -1, front - 6), k.way(0, 1), p.patella_thickness - p.patella_cartilage, 2),
            ("cartilage between patella and femur", (["femur"], ["patella"]), k.at(BASE + 0.4 * p.patella_length, 0, CORTEX + 3),
             k.way(0, 1), p.patella_cartilage + p.femoral_cartilage, 1),
            ("notch, width", (["femur"], ["femur"]), k.at(k.joint - 20, 0, back - 14), k.way(1, 0), p.notch, 4),
            ("quadriceps tendon", ["quadriceps"], k.at(-10, 0, k.tendon), k.way(0, 1), p.tendon, 0.6),
            ("recess, length", ["recess"], k.at(0, 0, k.recess), (1, 0, 0), p.recess_length, 0.1),
            ("recess, width", ["recess"], k.at(0, 0, k.recess), k.way(1, 0), p.recess_width, 0.1),
            ("fat before the femur", (["femur"], ["capsule", "recess"]), k.at(0, 0, 0), k.way(0, 1), p.prefemoral - p.capsule, 0.7)]


def bones(v, p, k):
    at, j, wide = k.at, k.joint, 0.5 * p.condyles
    thick = 0.5 * (wide - 0.5 * p.notch)
    side, deep = wide - thick, 0.5 * p.condyle_depth
    back = CORTEX + 7 - deep
    v.capsule("femur", at(-100, 2, 0), at(30, 0, 0), 14, CORTEX)
    v.capsule("femur", at(-100, 2, 0), at(12, 0, 0), 14, CORTEX)
    for r, low in ((side, 0), (-side, 1)):
        v.capsule("femur", at(-28, 0.1 * r, -2), at(j - 28, 0.86 * r, back + 3), 12, thick + 0.5, blend=8)
        v.ellipsoid("femur", at(j - 29 + low, r, back), (27, thick, deep), x_axis=(1, 0, 0), y_axis=k.way(1, 0), blend=6)
        inner = (0.5 * p.notch + 8.5) * (1 if r > 0 else -1)  # the wall of the notch
        v.capsule("femur", at(j - 24, inner, back - 14), at(j - 16, inner, back + 6), 8.5, blend=3)
        # the lips of the trochlea, the outer one higher
        lip = 1 if r > 0 else -1
        v.capsule("femur", at(j - 44, 0.36 * r, CORTEX - 4 + lip), at(j - 26, 0.46 * r, CORTEX - 3 + lip), 6, 8, blend=4)
        v.capsule("femur", at(j - 26, 0.46 * r, CORTEX - 3 + lip), at(j - 10, 0.55 * r, CORTEX - 10 + lip), 8, 8, blend=4)
    # tibia: cut flat at the top
    for r in (0.5 * side, -0.5 * side):
        v.capsule("tibia", at(j + 16, 1.75 * r, back + 3), at(j + 60, 0.35 * r, back + 4), thick + 2, 12, blend=10)
        v.ellipsoid("tibia", at(j + 12, 1.9 * r, back + 2), (14, thick + 2, 0.82 * deep), x_axis=(1, 0, 0), y_axis=k.way(1, 0), blend=8)
    v.capsule("tibia", at(j + 40, -1, back + 7), at(j + 120, -12, back + 17), 15, 12, blend=8)
    v.capsule("tibia", at(j + 34, 1, back + 21), at(j + 46, 1, back + 19), 7, blend=8)      # tuberosity
    v.half_space("sagittal", at(0, 0, 0), k.way(1, 0))
    v.half_space("joint-line", at(j, 0, 0), (1, 0, 0))
    for r in (5, -5):
        v.capsule("eminence", at(j - 1, r, back + 2), at(j + 8, 1.3 * r, back + 2), 2, 5, blend=3)
    # beside and behind the tibia, the joint's cartilage away
    head, neck, shaft = (beside(v, "tibia", at(j + x, r, back + a), k.way(0.3, -1), radius + 1)
                         for x, r, a, radius in ((17, side - 3, -12, 7.5), (34, side - 6, -11, 7), (120, side - 4, -6, 9)))
    v.capsule("fibula", head, neck, 7.5, 5.5)
    v.capsule("fibula", neck, shaft, 5.5, 5, blend=4)
    # patella: a shield with a ridge behind
    ridge = k.patella - (p.patella_thickness - p.patella_cartilage) + 0.6       # blending fills it
    middle, half = BASE + 0.5 * p.patella_length, 0.5 * p.patella_length
    thick, y = 0.36 * (p.patella_thickness - p.patella_cartilage), k.patella
    v.ellipsoid("patella", at(middle - 3, 1, y - thick), (half - 3, 0.5 * p.patella_breadth, thick), x_axis=(1, 0, 0),
                y_axis=k.way(1, 0))
    v.capsule("patella", at(middle + 2, 0, y - thick), at(middle + half - 4, 0, y - thick - 1), 7, 4, blend=6)          # apex
    v.capsule("patella", at(middle - 9, -1.5, ridge + 5), at(middle + 6, -1.5, ridge + 5), 5, blend=10)                 # ridge
    v.capsule("patella", at(middle - half + 6.4, -7, y - thick - 1.6), at(middle - half + 6.4, 7, y - thick - 1.6), 5.3, blend=6)  # base
    v.half_space("behind-patella", at(0, 0, y - thick - 1.5), scaled(k.way(0, 1), 1))


def soft(v, p, k):
    at, j, side = k.at, k.joint, 0.5 * p.condyles - 16
    back = CORTEX + 7 - 0.5 * p.condyle_depth
    v.ellipsoid("recess", at(0, 0, k.recess), (0.5 * p.recess_length, 0.5 * p.recess_width, 0.5 * p.recess_depth),
                x_axis=(1, 0, 0), y_axis=k.way(1, 0))
    v.capsule("vastus", at(-16, *k.vastus), at(7, *k.vastus), p.vastus)
    v.capsule("vastus", at(-100, 36, 8), at(-16, *k.vastus), 24, p.vastus)
    flat = 0.5 * p.tendon
    for i, r in enumerate((0, -5.5, 5.5, -11, 11)):
        v.capsule("quadriceps", at(-48, 0.6 * r, k.tendon - 1), at(8, r, k.tendon), 0.85 * flat, flat, blend=4 if i else 0)
    for i, r in enumerate((0, -5.5, 5.5, -11, 11)):
        v.capsule("quadriceps", at(8, r, k.tendon), at(BASE + 5 + 0.03 * r * r, r, k.tendon + 1), flat, 0.75 * flat, blend=3)
    for r in (0, -5.5, 5.5, -11, 11):  # thin where the rectus begins
        v.capsule("quadriceps", at(-62, 0.15 * r, k.tendon - 1.5), at(-48, 0.6 * r, k.tendon - 1), 0.2 * flat, 0.85 * flat)
    thin, low = 0.5 * p.patellar_tendon, BASE + p.patella_length
    spread = 0.5 * p.patellar_width - thin
    for i, r in enumerate((0, -0.5 * spread, 0.5 * spread, -spread, spread)):
        v.capsule("patellar-tendon", at(low - 8, r, k.tendon + 1), at(j + 36, 0.8 * r, back + 27), thin, blend=4 if i else 0)
    # the thigh's muscles fill its fascia, taper towards the knee and leave its fat pads; so does the calf
    u = (p.thigh - p.skin - p.fat) / 48
    v.capsule("muscles", at(-110, 4, k.axis + 22), at(-48, 4, 10), 36 * u, 26)                # vasti
    v.capsule("muscles", at(-110, -22, k.axis - 10), at(-36, -24, -24), 31 * u, 20)          # adductors, semimembranosus
    v.capsule("muscles", at(-110, 22, k.axis - 22), at(-36, 28, -32), 28 * u, 17)            # biceps
    v.capsule("muscles", at(j + 46, 5, back - 16), at(j + 120, 2, back - 8), 22, 35 * u)    # soleus, tibialis
    # vastus medialis and intermedius, hamstrings, calf
    v.capsule("muscles", at(-100, -34, 10), at(14, -27, 22), 24, 9)
    v.capsule("muscles", at(-100, 0, 22), at(-34, 0, k.recess), 16, 5)
    v.capsule("muscles", at(-100, 2, k.axis + p.thigh - p.fat - p.skin - 13), at(-46, 0, k.tendon), 12, 4)
    v.capsule("muscles", at(-100, -46, -12), at(24, -36, 4), 17, 9)
    v.capsule("muscles", at(-100, 46, -10), at(-6, 39, -2), 19, 8)
    v.capsule("muscles", at(-100, -48, -36), at(j + 30, -40, -24), 11, 6)                   # sartorius
    v.capsule("muscles", at(-100, 10, -58), at(30, 14, -46), 15, 8)
    for end in (at(60, -31, -34), at(72, 34, -28)):
        v.capsule("muscles", at(-100, 0.7 * (1 if end[2] > at(60, 0, -34)[2] else -1) * 34, -42), end, 19, 7)
    for r in (-17, 17):
        v.capsule("muscles", at(46, r, back - 34), at(j + 55, 1.1 * r, back - 30), 8, 18 * u)
        v.capsule("muscles", at(j + 55, 1.1 * r, back - 30), at(j + 120, r, back - 22), 18 * u, 23 * u)
    v.capsule("muscles", at(j + 40, 24, back + 8), at(j + 120, 16, back + 12), 9, 18 * u)
    for a, b, r0, r1 in ((at(j - 14, 8, back - 10), at(j + 4, -3, back + 8), 3.4, 3.4),            # anterior cruciate
                         (at(j - 14, -8, back + 6), at(j + 4, -1, back - 20), 4, 4),              # posterior
                         (at(j - 30, side + 16.5, back), at(j + 14, side + 9, back - 12), 2, 2),   # lateral collateral
                         (at(j - 30, -side - 17, back), at(j + 52, -side - 2, back + 8), 1.7, 1.7)):
        v.capsule("ligament", a, b, r0, r1)
    v.tube("artery", [(*at(-100, -12, -26), 3.4), (*at(-20, -2, -34), 3.2), (*at(j - 10, 1, back - 36), 3),
                      (*at(j + 70, 3, back - 22), 2.6)])
    v.tube("vein", [(*at(-100, -6, -32), 4), (*at(-20, 3, -41), 4), (*at(j - 10, 5, back - 43), 4), (*at(j + 70, 6, back - 28), 3)])
    v.tube("nerve", [(*at(-100, 6, -40), 4), (*at(-20, 7, -50), 3), (*at(j - 10, 7, back - 50), 2.8), (*at(j + 70, 2, back - 30), 2.4)])


def skins(v, p, k):
    at, j, low = k.at, k.joint, k.axis
    v.capsule("skin", at(-40, 0, low), at(46, 0, low), p.thigh)
    v.capsule("skin", at(-110, 2, low + 4), at(-40, 0, low), p.thigh + 9, p.thigh, blend=4)
    v.capsule("skin", at(46, 0, low), at(j + 8, 0, low + 1), p.thigh, p.thigh - 6, blend=4)
    v.capsule("skin", at(j + 8, 0, low + 1), at(j + 112, 2, low - 4), p.thigh - 6, p.thigh - 4, blend=8)
    cover = p.skin + 0.4 * p.fat
    y = k.patella
    v.ellipsoid("skin", at(BASE + 0.5 * p.patella_length, 0.5, y - 12),
                (0.5 * p.patella_length + 10.5, 0.5 * p.patella_breadth + 10.5, 12 + cover), x_axis=(1, 0, 0), y_axis=k.way(1, 0), blend=5)


def looks(v, p, k):
    """Thigh, calf and foot: skin alone, so that one sees what it is. Nothing changes within 40 mm of entry, recess and patella."""
    at, low, t = k.at, k.axis, p.thigh / 57
    calf, ankle = k.joint + 112, k.joint + 395
    v.tube("skin", [(*at(-112, 2, low + 4), p.thigh + 9), (*at(-340, 10, low), 1.5 * p.thigh)], blend=10)
    v.tube("skin", [(*at(calf, 2, low - 4), p.thigh - 4), (*at(calf + 120, 0, low + 2), 38 * t), (*at(ankle - 60, 0, low + 4), 30 * t),
                    (*at(ankle, 0, low + 2), 31 * t)], blend=14)
    for r in (-17, 15):                                                                        # gastrocnemius
        v.ellipsoid("skin", at(calf + 6, r * t, low - 26), (73, 32 * t, 34 * t), x_axis=(1, 0, 0), y_axis=k.way(1, 0), blend=14)
    v.ellipsoid("skin", at(k.joint + 66, 0, low + p.thigh - 20), (26, 15, 17), x_axis=(1, 0, 0), y_axis=k.way(1, 0), blend=9)  # tuberosity
    for r in (-30, 30):                                                                        # malleoli
        v.ellipsoid("skin", at(ankle + (4 if r < 0 else 12), r * t, low + 2), (16, 11, 14), x_axis=(1, 0, 0), y_axis=k.way(1, 0), blend=8)
    v.capsule("skin", at(ankle, 0, low - 8), at(ankle + 38, 0, low - 26), 30, 31, blend=14)     # heel
    v.ellipsoid("skin", at(ankle + 84, 0, low + 62), (90, 43, 26), x_axis=(0.78, *scaled(k.way(0, 1), 0.62)[1:]),
                y_axis=k.way(1, 0), blend=24)
    for r, front, big in ((-27, 56, 13), (-6, 58, 9), (9, 52, 8.5), (23, 45, 8), (35, 37, 8)):  # toes
        v.capsule("skin", at(ankle + 118, 0.85 * r, low + 98), at(ankle + 118 + 0.72 * front, 1.25 * r, low + 98 + 0.6 * front), 1.1 * big, big,
                  blend=3)


def volume(p):
    v, k = Volume("skin", "pad"), Knee(p)
    skins(v, p, k)
    looks(v, p, k)
    bones(v, p, k)
    soft(v, p, k)
    v.go_on(("artery", "vein", "nerve", "femur", "vastus", "muscles"), 0, -100, -180)
    v.go_on(("artery", "vein", "nerve"), 0, k.joint + 70, 200)
    share = FORCES[p.build]
    for id, made in LAYERS.items():
        v.structure(id, NAMES[id], softened(made, share))
    v.structure("artery", "popliteal artery", VESSEL)
    v.structure("vein", "popliteal vein", VESSEL)
    v.structure("nerve", "tibial nerve", NERVE)
    for bone in ("femur", "patella", "tibia", "fibula"):
        v.structure(bone, bone, BONE)
    for bone in ("femur", "patella", "fibula"):
        v.rule(bone, bone, None, 0)
    v.rule("tibia", "tibia", None, 0, ("joint-line", 4.5, None))
    v.rule("tibia", "eminence", None, 0)
    for thin in ("artery", "vein", "nerve", "ligament"):
        v.rule(thin, thin, None, 0)
    v.rule("cartilage", "femur", 0, p.femoral_cartilage, ("joint-line", -48, 3), ("sagittal", 6 - 0.5 * p.condyles, 0.5 * p.condyles - 6))
    v.rule("cartilage", "patella", 0, p.patella_cartilage, ("behind-patella", None, 0), ("femur", p.femoral_cartilage, 9),
           ("patellar-tendon", 0, None))
    v.rule("cartilage", "fibula", 0, 1.2, ("tibia", 0, 1.2))
    v.rule("cartilage", "joint-line", 2.6, 4.5, ("tibia", None, -1))
    v.rule("meniscus", "joint-line", -9, 4.5, ("femur", p.femoral_cartilage, 8), ("tibia", None, 2), ("eminence", 8, None))
    v.rule("quadriceps", "quadriceps", None, 0)
    v.rule("patellar-tendon", "patellar-tendon", None, 0)
    v.rule("recess", "recess", None, 0)
    v.rule("capsule", "recess", None, p.capsule)
    v.rule("skin", "skin", -p.skin, None)
    v.rule("fat", "skin", -p.skin - p.fat, None)
    v.rule("fascia", "skin", -p.skin - p.fat - 1, None)
    v.rule("vastus", "vastus", None, 0)
    v.rule("muscle", "muscles", None, 0)
    v.describe(KINDS, FIBRES, PULSES)
    return v


REGION = dict(
    id="knee", name="Knee", title="suprapatellar recess from the side",
    needle={"slender": (0.05, 21), "median": (0.05, 21), "heavy": (0.08, 21)}, tip=("HYPODERMIC", 0.3),
    fixture={"slender": 1.4, "median": 1.6, "heavy": 1.6}, cut_memory=True, landmark="patella",
    directions={"plus_x": "down the leg", "minus_x": "up the leg", "plus_y": "to the front", "minus_y": "to the back",
                "plus_z": "outwards", "minus_z": "to the inner side"},
    description="Right knee, straight: from the outer side under the quadriceps tendon into the recess above the patella. x down the leg, "
                "y to the front, z out along the needle.",
    forces="Attracted force 0.4 N, tendon 2.5 N, cartilage 3 N, bone 4 N: enhanced-tracking-wall paper; muscle: its range, by hand; skin, "
           "fat, capsule and fluid set by hand, thin ones so that they can be felt at 500 N/m; times {share} in this build, by hand. "
           "Share of cutting that a cut still costs: Barnett (18 of 79 %).")
