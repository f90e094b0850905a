"""The right shoulder for an injection into the subacromial bursa from the side.

Frame: x to the front, y towards the head, z out; the needle enters at the origin, 20 mm or so below the acromion.
"""
import math
from types import SimpleNamespace

from field import TUBE, Volume, add, beside, cross, dot, norm, scaled, sub, unit
from tissues import BONE, CARTILAGE, NERVE, VESSEL, layer, softened

# name, value in mm of a slender, a median, a heavy body, source
PARAMETERS = [
    ("depth", (22, 29, 36), "skin to bursa from the side 29 ± 7 mm: Arthroscopy 2008, doi 10.1016/j.arthro.2008.04.070"),
    ("skin", (1.7, 2, 2.3), "skin of the upper arm 2.00 ± 0.34 mm: Sim 2014, PMC4021299"),
    ("fat", (2.8, 5.5, 8.2), "fat of the upper arm 5.50 ± 2.68 mm: Sim 2014"),
    ("fascia", (0.5, 0.6, 0.6), "set by hand"),
    ("head", (22, 24, 26), "radius of the humeral head 24 ± 2.1 mm: Iannotti 1992"),
    ("cuff", (4.9, 5.6, 5.6), "supraspinatus tendon 4.9 mm women, 5.6 mm men: Karthikeyan 2014"),
    ("bursa", (1.3, 2, 2), "bursa 1.27 mm in painful shoulders, up to 2 mm: Tsai 2007"),
    ("gap", (7, 8, 8.8), "acromion to head 7.3 ± 1.4 mm in space, 8.8 ± 1.3 mm in the image: J Orthop Surg Res 2020;15"),
    ("acromion_length", (40.4, 43.2, 46), "acromion 43.2 ± 2.8 long: 100 dry scapulae, NRI Medical College, 2022"),
    ("acromion_breadth", (22.9, 25.5, 28), "25.5 ± 2.6 wide: the same"),
    ("acromion_thickness", (5.6, 6.8, 8.1), "6.8 ± 1.2 thick: the same"),
    ("glenoid_height", (35.5, 39, 42.5), "glenoid 39 ± 3.5 mm high: Iannotti 1992"),
    ("glenoid_width", (25.8, 29, 32.2), "29 ± 3.2 mm wide: Iannotti 1992"),
    ("nerve", (50.2, 56.2, 62.2), "axillary nerve 56 ± 6 mm below the acromion: Deshmukh 2025, 60 shoulders"),
    ("arm", (40, 46, 54), "radius of the arm: set by hand"),
    ("cartilage", (1.3, 1.5, 1.5), "set by hand"),
]
RISE, SLOPE = 10, 36  # degrees: of the path above the horizontal; of the bursa's entry around the head, from its top

LAYERS = {
    "skin": layer("SKIN", 0.6, 0.3, 0.1, 9000, 25, (300, 20000, 0.5)),
    "fat": layer("FAT", 0.4, 0.2, 0.05, 3000, 10),
    "fascia": layer("OTHER", 0.55, 0.2, 0.05, 9000, 15),
    "deltoid": layer("MUSCLE", 2, 0.4, 0.1, 12000, 25),
    "muscle": layer("MUSCLE", 2, 0.4, 0.1, 12000, 25),
    "bursa": layer("BURSA", 1.5, 0.4, 0.1, 6000, 10),
    "cuff": layer("TENDON", 2.5, 0.4, 0.1, 15000, 30),
    "ligament": layer("TENDON", 2.5, 0.4, 0.1, 15000, 30),
}
NAMES = {"skin": "skin", "fat": "subcutaneous fat", "fascia": "deltoid fascia", "deltoid": "deltoid muscle",
         "muscle": "muscle of arm and trunk", "bursa": "subacromial bursa", "cuff": "rotator cuff tendon",
         "ligament": "coracoacromial ligament"}
# What the tissue does not say; fibres along the arm or, in the cuff, out to the tubercle; pulses in mm: set by hand
KINDS = {"fascia": "FASCIA", "ligament": "LIGAMENT", "nerve": "NERVE", "artery": "ARTERY", "vein": "VEIN"}
FIBRES = {"deltoid": TUBE, "muscle": (0, -1, 0), "cuff": (0, 0, 1), "ligament": TUBE, "belly": TUBE, "biceps": TUBE, "nerve": TUBE,
          "artery": TUBE, "vein": TUBE}
PULSES = {"artery": 0.15}
FORCES = {"slender": (0.65, 0.65), "median": (1, 0.95), "heavy": (1.15, 0.95)}  # of cutting, of friction


def places(p):
    """Where things lie that others are measured from."""
    q = SimpleNamespace()
    rise, slope = math.radians(RISE), math.radians(SLOPE)
    q.way = (0, math.sin(rise), -math.cos(rise))
    q.bursa = scaled(q.way, p.depth)
    out = (0, math.cos(slope), math.sin(slope))
    q.shell = p.head + p.cuff + p.bursa
    q.head = add(q.bursa, scaled(out, -q.shell))
    q.skin = add(q.head, (0, 0.5, 3))  # the middle of the shoulder's roundness
    q.round = norm(q.skin)
    q.under = q.head[1] + p.head + p.gap
    q.edge = q.head[2] + 0.62 * p.head
    q.nerve = q.under - p.nerve
    return q


def depth_in_ball(q, radius):
    """How far along the path the ball of `radius` around the shoulder's middle begins."""
    along = dot(q.way, q.skin)
    return along - math.sqrt(along * along - q.round ** 2 + radius ** 2)


def expected(p):
    """The layers from the origin to the cuff, by formula."""
    q = places(p)
    along = dot(q.way, q.head)
    beside = dot(q.head, q.head) - along * along
    cuff = along - math.sqrt((p.head + p.cuff) ** 2 - beside)
    fat, fascia = p.skin, p.skin + p.fat
    return [("skin", 0), ("fat", depth_in_ball(q, q.round - fat)), ("fascia", depth_in_ball(q, q.round - fascia)),
            ("deltoid", depth_in_ball(q, q.round - fascia - p.fascia)), ("bursa", p.depth), ("cuff", cuff)]


def targets(p):
    q, layers = places(p), dict(expected(p))
    middle = 0.5 * (layers["bursa"] + layers["cuff"])
    return [("subacromial bursa", "bursa", scaled(q.way, middle))]


def hazards(_):
    return [("axillary nerve", "NERVE", "nerve"), ("rotator cuff tendon", "OTHER", "cuff")]


def wrong_paths(p):
    q = places(p)
    return [("too steep towards the head", (0, q.under + 0.5 * p.acromion_thickness, q.edge - 5), "scapula"),
            ("level, below the bursa", (0, q.head[1] + 0.3 * p.head, q.head[2]), "humerus")]


def measures(p):
    """words, structures, a point, a direction, mm inside (or, with two lists, from the one to the other), tolerance."""
    q = places(p)
    mid = (0, q.under + 0.5 * p.acromion_thickness, q.edge - 0.5 * p.acromion_breadth)
    return [("head, front to back", ["humerus"], add(q.head, (0, 0, -0.3 * p.head)), (1, 0, 0), 1.9 * p.head, 2.5),
            ("acromion, length", ["scapula"], add(mid, (0, -0.5, 0)), (1, 0, 0), p.acromion_length, 3),
            ("acromion, breadth", ["scapula"], add(mid, (4, 0, 0)), (0, 0, 1), p.acromion_breadth, 3),
            ("acromion, thickness", ["scapula"], (0, mid[1], q.edge - 0.35 * p.acromion_breadth), (0, 1, 0), p.acromion_thickness, 1),
            ("head to acromion", (["humerus"], ["scapula"]), q.head, (0, 1, 0), p.gap, 0.8),
            ("glenoid, height", ["scapula"], add(q.head, (0, -1, -p.head - 6)), (0, 1, 0), p.glenoid_height, 3)]


def bones(v, p, q):
    r, (_, hy, hz) = p.head, q.head
    s = r / 24

    def at(x, y, z):
        return (x * s, hy + y * s, hz + z * s)
    v.ball("humerus", q.head, r)
    v.ellipsoid("humerus", at(1, 8.4, 18), (14 * s, 10.1 * s, 9.1 * s), blend=8 * s)       # greater tubercle
    v.ellipsoid("humerus", at(20, 1, 10), (7 * s, 10 * s, 7.5 * s), blend=6 * s)           # lesser tubercle
    v.capsule("humerus", at(0, -3, 4), at(0, -46, 6.5), 20 * s, 12.5 * s, blend=10 * s)
    v.capsule("humerus", at(0, -46, 6.5), (0, hy - 150, hz + 5), 12.5 * s, 11 * s, blend=4 * s)
    v.capsule("humerus", (0, hy - 150, hz + 5), (0, hy - 230, hz + 4), 11 * s)
    v.ball("head", q.head, r)

    # acromion: a plate between two rounded edges, the front a little lower
    half, y = 0.5 * p.acromion_thickness, q.under + 0.5 * p.acromion_thickness + 1.1  # blending fills its underside
    back, front, wide = -0.56 * p.acromion_length, 0.44 * p.acromion_length, p.acromion_breadth
    edge, inner = q.edge - half, q.edge - wide + half
    v.capsule("scapula", (back + 8, y - 1.5, edge - 1), (front - half - 5, y - 0.6, edge - 1), 0.86 * half, 0.82 * half)
    v.ellipsoid("scapula", (0.5 * (back + front), y - 0.3, q.edge - 0.5 * wide), (0.49 * p.acromion_length, 0.8 * half, 0.47 * wide),
                blend=6)
    v.capsule("scapula", (front - half - 2, y - 1.6, q.edge - 0.5 * wide), (back + 8, y - 0.6, inner), 0.8 * half, blend=6)
    v.tube("scapula", [(back + 7, y - 3, q.edge - 0.75 * wide, 6 * s), (*at(-28.5, 22, -30), 5.5 * s),
                       (*at(-47, 22, -66), 5 * s), (*at(-54, 12, -100), 3.5 * s)], blend=6)  # spine
    v.ellipsoid("scapula", add(q.head, (0, -1, -r - 6.5)), (0.5 * p.glenoid_width, 0.5 * p.glenoid_height, 7 * s),
                x_axis=(1, 0, -0.09), y_axis=(0, 1, 0.1))
    v.tube("scapula", [(*at(-2, -1, -35), 11 * s), (*at(-13, -4, -52), 7 * s)], blend=6)     # neck
    # the blade: a slab between three borders, each a rounded rod
    joint, lower, upper = at(-9, 4, -46), at(-46, -92, -92), at(-52, 24, -104)
    normal = unit(cross(sub(upper, lower), sub(joint, lower)))
    v.half_space("blade", lower, normal)
    for group, a, b in (("blade-lateral", joint, lower), ("blade-medial", lower, upper), ("blade-upper", upper, joint)):
        v.half_space(group, a, cross(normal, sub(a, b)))
    v.tube("scapula", [(*joint, 7 * s), (*add(scaled(joint, 0.5), scaled(lower, 0.5)), 4.5 * s), (*lower, 5 * s)], blend=6)
    v.tube("scapula", [(*lower, 4 * s), (*add(scaled(lower, 0.4), scaled(upper, 0.6)), 2.4 * s), (*upper, 3 * s), (*joint, 4 * s)],
           blend=4)
    v.tube("scapula", [(*at(4, 14, -38), 9 * s), (*at(17, 27, -36), 7 * s), (*at(29, 21, -21), 5.6 * s),
                       (*at(33.5, 12, -11), 4.6 * s)], blend=6)                              # coracoid
    medial = q.edge - wide
    v.tube("clavicle", [(6, y - 1, medial - 6.5, 5 * s), (9, y - 1, medial - 24, 5.2 * s), (16, y - 1.5, medial - 62, 5.5 * s),
                        (19, y - 5, medial - 92, 5.5 * s)])


def soft(v, p, q):
    r, (_, hy, hz) = p.head, q.head
    s, y = r / 24, q.under + 0.5 * p.acromion_thickness

    def at(x, y, z):
        return (x * s, hy + y * s, hz + z * s)
    tip = (0.44 * p.acromion_length - 5, y - 4, q.edge - 0.45 * p.acromion_breadth)
    for k in (0, 5):
        v.capsule("arch", (*at(30.5 - 0.9 * k, 19 + 0.6 * k, -19 - k),), add(tip, (0, 0.5, -k)), 1.5, blend=4 if k else 0)
    # bellies of supraspinatus, infraspinatus and subscapularis, from the tendons' shell to the scapula
    v.tube("bellies", [(*at(-3, 27, -8), 3.6 * s), (*at(-8, 30, -30), 8 * s), (*at(-27, 26, -66), 10 * s),
                       (*at(-42, 20, -98), 8 * s)])
    v.tube("bellies", [(*at(-26, 4, -10), 3.5 * s), (*at(-34, -2, -36), 9 * s), (*at(-52, -16, -74), 12 * s)])
    v.tube("bellies", [(*at(25, 0, -10), 3.5 * s), (*at(8, -12, -44), 9 * s), (*at(-18, -30, -78), 12 * s)])
    v.ball("bursa-floor", q.head, r + p.cuff)
    v.ellipsoid("bursa-floor", at(1, 8.4, 18), (15 * s, 11.1 * s, 10.1 * s), blend=3)
    v.ellipsoid("bursa-extent", at(5, 18, 12), (25 * s, 23 * s, 25 * s))
    v.half_space("cuff-extent", at(0, 7, 27), (0, 0.85, -0.53))
    v.half_space("cuff-extent", at(0, -6, 0), (0, 1, 0.35))
    v.half_space("above-recess", at(0, -6, 0), (0, 1, 0.35))
    v.ellipsoid("outer", at(0, -12, 40), (75 * s, 140 * s, 54 * s))     # the deltoid's rounded inner bound
    v.half_space("articular-side", at(-1.5, 2.5, -4), (-0.3, 0.5, -0.81))
    v.ellipsoid("under-acromion", (-0.06 * p.acromion_length, y, q.edge - 0.5 * p.acromion_breadth),
                (0.6 * p.acromion_length, 50, 0.5 * p.acromion_breadth))
    v.tube("axilla", [(*at(12, -30, -48), 8), (6, hy - 80, hz - 46 * s, 12.5), (4, hy - 150, hz - 48 * s, 12.5)])
    over = (r + 2.4 * s) / 24 / s
    groove = [(*beside(v, "humerus", at(x, y, z), (x, 0, z), 1.6), 2.4)  # shallow: 0.8 mm
              for x, y, z in ((13, 18 * over, 10), (14.5, 12, 16), (15.5, 6, 21), (15, -7, 20.5), (13, -20, 19.5))]
    v.tube("biceps", [(*at(2, 20, -27), 2.2), (*at(8, 23 * over, -4), 2.3), *groove, (16, hy - 60, hz + 16, 2.8),
                      (24, hy - 100, hz + 14, 7), (24, hy - 220, hz + 10, 9)])
    # around the surgical neck, on the deltoid's inner face
    n, w, z = q.nerve, 0.46 * r + 7, hz + 5 * s
    ring = [(-4, -14, -1.7), (-w, 2, -0.55), (-w * 0.95, 3, 0.35), (-w * 0.5, 1, 0.95), (2, 0, 1.1), (w * 0.78, -1, 1.14),
            (w * 1.35, -2, 0.45)]  # outside of the tendon in its groove
    from_plexus = [(*at(6, 10, -140), 3), (*at(10, -16, -66), 2.6)]
    around = [(*at(11, -43, -25), 2.4), (0.8 * w, n - 9, z - 0.8 * w, 1.8)]  # the arteries' ring is closed at the axillary artery
    for group, shift, thick, begins, ends in (("nerve", 0, (2, 2, 1.8, 1.6, 1.5, 1.4, 1.3), from_plexus, []),
                                              ("artery", -5.5, (2.2, 2, 1.8, 1.8, 1.8, 1.8, 1.8), around[:1], around[::-1])):
        v.tube(group, [*begins, *((x, n + dy + shift, z + k * w, t) for (x, dy, k), t in zip(ring, thick)), *ends])
    v.tube("nerve", [(2, n, z + 1.05 * w, 1.5), (6, n + 9, z + 1.15 * w, 1.2)])
    v.tube("artery", [(*at(8, 18, -140), 4.2), (*at(20, 0, -78), 3.8), (*at(22, -14, -46), 3.4), (8, hy - 50, hz - 20 * s, 3.2),
                      (2, hy - 150, hz - 16 * s, 2.4), (0, hy - 230, hz - 14 * s, 2.2)])
    # to the axillary vein, in front of the coracoid
    v.tube("vein", [(*at(20, 16, -140), 3), (*at(36, 10, -56), 2.4), (*at(41, 20, -24), 1.9), (30 * s, hy - 10, hz + 22 * s, 1.8),
                    (24 * s, hy - 60, hz + 28 * s, 1.6), (36 * s, hy - 140, hz + 26 * s, 1.6), (38 * s, hy - 230, hz + 24 * s, 1.6)])


def skins(v, p, q):
    (_, cy, cz), a, r = q.skin, p.arm, q.round
    v.tube("skin", [(*q.skin, r), (0, cy - 62, cz + 2, a), (0, cy - 145, cz + 1, a - 5)])
    v.tube("skin", [(0, cy + 0.06 * r, cz - 0.62 * r, 0.9 * r), (-4, cy + 0.34 * r, cz - 1.9 * r, 0.95 * r),
                    (-12, cy + 0.75 * r, cz - 2.7 * r, 0.95 * r)], blend=0.5 * r)
    v.tube("skin", [(-4, cy - 60, cz - 100 - 0.4 * r, 58 + 0.25 * r), (-2, cy - 150, cz - 104 - 0.4 * r, 60 + 0.25 * r)], blend=26)
    s, (_, hy, hz) = p.head / 24, q.head
    v.capsule("skin", (-20 * s, hy + 22 * s, hz - 80 * s), (-24 * s, hy - 98 * s, hz - 82 * s), 47 * s + 0.5 * p.fat, blend=20)  # over the blade
    v.ball("deltoid", q.skin, r)
    v.capsule("deltoid", (0, cy, cz + 4), (0, cy - 110, cz + 18), r, 0.45 * r, blend=0)


def looks(v, p, q):
    """Arm, chest, neck and head: skin alone, so that one sees what it is. Nothing changes within 40 mm of entry and acromion."""
    (_, cy, cz), a, r = q.skin, p.arm, q.round
    mid = cz - 172                        # of the body
    v.tube("skin", [(0, cy - 145, cz + 1, a - 5), (6, cy - 290, cz + 4, a - 11), (30, cy - 430, cz, a - 16)], blend=10)
    v.tube("skin", [(8, cy - 40, mid, 84), (16, cy - 180, mid, 96), (18, cy - 400, mid, 92)], blend=30)
    for side in (-1, 1):
        v.tube("skin", [(8, cy - 110, mid + 44 * side, 86), (6, cy - 200, mid + 56 * side, 90), (6, cy - 400, mid + 54 * side, 84)], blend=24)
        v.ellipsoid("skin", (66, cy - 112, mid + 74 * side), (42, 52, 62), blend=30)           # breast
    far = 2 * mid - cz                    # the other shoulder
    v.tube("skin", [(0, cy, far, r), (0, cy - 140, far - 2, a), (6, cy - 290, far - 4, a - 10), (30, cy - 430, far, a - 16)], blend=20)
    v.tube("skin", [(-12, cy + 0.75 * r - 12, mid, r), (-2, cy + 0.3 * r, far + 60, 0.9 * r)], blend=30)
    v.capsule("skin", (-10, cy + 40, mid), (2, cy + 140, mid), 62, 56, blend=20)
    v.ellipsoid("skin", (14, cy + 232, mid), (98, 104, 76), blend=10)
    v.ellipsoid("skin", (58, cy + 176, mid), (46, 44, 52), blend=20)                           # jaw
    v.capsule("skin", (108, cy + 238, mid), (122, cy + 206, mid), 8, 13, blend=8)              # nose
    for side in (-1, 1):
        v.ellipsoid("skin", (2, cy + 214, mid + 76 * side), (16, 31, 10), blend=4)             # ears


def volume(p):
    v, q = Volume("skin", "muscle"), places(p)
    skins(v, p, q)
    looks(v, p, q)
    bones(v, p, q)
    soft(v, p, q)
    share = FORCES[p.build]
    for id, made in LAYERS.items():
        v.structure(id, NAMES[id], softened(made, share))
    v.structure("belly", "rotator cuff muscle", softened(LAYERS["muscle"], share))
    v.structure("cartilage", "articular cartilage", softened(CARTILAGE, share))
    v.structure("capsule", "joint capsule", softened(layer("CAPSULE", 2, 0.4, 0.1, 14000, 25, (320, 20000, 0.6)), share))
    v.structure("biceps", "long head of biceps", softened(LAYERS["cuff"], share))
    v.structure("nerve", "axillary nerve", NERVE)
    v.structure("artery", "axillary and circumflex arteries", VESSEL)
    v.structure("vein", "cephalic vein", VESSEL)
    v.structure("axilla", "axillary fat", softened(LAYERS["fat"], share))
    joint = p.cartilage + 1.8  # from bone to bone: the socket is hollowed by the head, the groove by the tendon
    for bone, clip in (("humerus", ("biceps", 0, None)), ("scapula", ("head", joint, None)), ("clavicle", ("scapula", 1.5, None))):
        v.structure(bone, {"scapula": "scapula with acromion"}.get(bone, bone), BONE)
        v.rule(bone, bone, None, 0, clip)
    v.rule("scapula", "blade", -1.6, 1.6, ("blade-lateral", None, 0), ("blade-medial", None, 0), ("blade-upper", None, 0))
    for thin in ("nerve", "artery", "vein", "biceps"):
        v.rule(thin, thin, None, 0)
    v.rule("ligament", "arch", None, 0)
    v.rule("cartilage", "head", p.cartilage, joint, ("scapula", None, 2))
    v.rule("cartilage", "head", 0, p.cartilage, ("articular-side", 0, None), ("biceps", 0, None))
    v.rule("cartilage", "clavicle", None, 1.5, ("scapula", 0, 1.5))
    v.rule("cuff", "head", 0, p.cuff, ("cuff-extent", 0, None), ("biceps", 0, None), ("scapula", 2, None))
    v.rule("capsule", "head", 0, 2.2, ("above-recess", None, 0), ("articular-side", -12, None))
    v.rule("bursa", "bursa-floor", 0, p.bursa, ("bursa-extent", None, 0))
    v.rule("ligament", "under-acromion", None, 0, ("bursa-floor", 0, p.gap + p.acromion_thickness - p.cuff - 0.3))
    v.rule("skin", "skin", -p.skin, None)
    v.rule("fat", "skin", -p.skin - p.fat, None)
    v.rule("fascia", "skin", -p.skin - p.fat - p.fascia, None)
    v.rule("belly", "bellies", None, 0)
    v.rule("axilla", "axilla", None, 0)
    v.rule("deltoid", "deltoid", None, 0, ("outer", None, 0))
    v.describe(KINDS, FIBRES, PULSES)
    return v


REGION = dict(
    id="shoulder", name="Shoulder", title="subacromial bursa from the side",
    needle={"slender": (0.05, 23), "median": (0.06, 22), "heavy": (0.08, 21)}, tip=("HYPODERMIC", 0.3),
    fixture={"slender": 1.5, "median": 2.2, "heavy": 2}, cut_memory=False, landmark="scapula", landmark_name="acromion",
    directions={"plus_x": "to the front", "minus_x": "to the back", "plus_y": "towards the head", "minus_y": "down the arm",
                "plus_z": "outwards", "minus_z": "towards the chest"},
    description="Right shoulder, from the side: below the acromion's edge and upwards by 10°. x to the front, y towards the head, "
                "z out of the body.",
    forces="Cutting of muscle, bursa, tendon, cartilage and bone (2, 1.5, 2.5, 3, 4 N) and attracted force 0.4 N: "
           "enhanced-tracking-wall paper; skin 0.6 N, so that 2 mm can be felt at 500 N/m, fascia and fat set by hand; times {share} in "
           "this build, by hand.")
