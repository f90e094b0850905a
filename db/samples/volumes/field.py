"""A body as one field (common/anatomy/README.md): written in millimetres, asked for distances and layers.

The evaluation is that of common/anatomy, written a second time: a generator places things by it, and a test compares
its stacks of layers with those of the engine's march.
"""
import math

OUTSIDE = "outside"
TUBE = "along its tube"  # of fibres
FAR = 1e6


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scaled(a, k):
    return (a[0] * k, a[1] * k, a[2] * k)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a):
    return math.sqrt(dot(a, a))


def unit(a):
    return scaled(a, 1 / norm(a))


def smooth_minimum(a, b, blend):
    overlap = blend - abs(a - b)
    return min(a, b) - (overlap * overlap / (4 * blend) if overlap > 0 else 0)


def to_segment(p, a, b, radius_a, radius_b):
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    apx, apy, apz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    square = abx * abx + aby * aby + abz * abz
    along = min(max((apx * abx + apy * aby + apz * abz) / square, 0), 1) if square > 0 else 0
    x, y, z = apx - along * abx, apy - along * aby, apz - along * abz
    return math.sqrt(x * x + y * y + z * z) - (radius_a + (radius_b - radius_a) * along)


def to_ellipsoid(p, radii):
    """Eberly's root of sum (r p/(t + r²))² = 1 by bisection; `p` in the ellipsoid's own axes."""
    x, y, z = (max(abs(own), 1e-9) for own in p)
    rx, ry, rz = radii
    low = max(rx * (x - rx), ry * (y - ry), rz * (z - rz))
    high = math.sqrt((rx * x) ** 2 + (ry * y) ** 2 + (rz * z) ** 2)
    while True:
        t = 0.5 * (low + high)
        if t <= low or t >= high:  # neighbouring numbers
            break
        if (rx * x / (t + rx * rx)) ** 2 + (ry * y / (t + ry * ry)) ** 2 + (rz * z / (t + rz * rz)) ** 2 > 1:
            low = t
        else:
            high = t
    return high * math.sqrt((x / (high + rx * rx)) ** 2 + (y / (high + ry * ry)) ** 2 + (z / (high + rz * rz)) ** 2)


class Part:
    """One shape of a group. `pieces`: segments of a capsule or a tube."""

    def __init__(self, json, blend, pieces=(), ellipsoid=None, plane=None):
        self.json, self.blend = json, blend
        self.pieces, self.ellipsoid, self.plane = pieces, ellipsoid, plane

    def join(self, value, p):
        """The group's distance with this part. The first piece of a tube blends; the others follow it."""
        if self.plane:
            return smooth_minimum(value, dot(sub(p, self.plane[0]), self.plane[1]), self.blend)
        if self.ellipsoid:
            center, radii, axes = self.ellipsoid
            own = [dot(sub(p, center), axis) for axis in axes]
            return smooth_minimum(value, to_ellipsoid(own, radii), self.blend)
        for i, piece in enumerate(self.pieces):
            value = smooth_minimum(value, to_segment(p, *piece), self.blend if i == 0 else 0)
        return value


def metres(mm):
    """Millimetres as metres, to a micrometre."""
    return round(mm * 1e-3, 6) + 0.0


def point(p):
    return {"x": metres(p[0]), "y": metres(p[1]), "z": metres(p[2])}


def direction(v):
    return {"x": round(v[0], 6) + 0.0, "y": round(v[1], 6) + 0.0, "z": round(v[2], 6) + 0.0}


class Volume:
    """A volume in the making. All lengths in millimetres, in the profile's frame; errors are programming errors."""

    def __init__(self, skin, rest):
        self.skin, self.rest = skin, rest
        self.groups, self.structures, self.facts, self.rules = {}, {}, {}, []

    def _part(self, group, part):
        self.groups.setdefault(group, []).append(part)

    def capsule(self, group, a, b, radius_a, radius_b=None, blend=0):
        json = {"a_m": point(a), "b_m": point(b), "radius_a_m": metres(radius_a)}
        if radius_b is not None:
            json["radius_b_m"] = metres(radius_b)
        piece = (a, b, radius_a, radius_a if radius_b is None else radius_b)
        self._part(group, Part({"capsule": json}, blend, [piece]))

    def ball(self, group, center, radius, blend=0):
        self.capsule(group, center, center, radius, blend=blend)

    def tube(self, group, points, blend=0):
        """`points`: (x, y, z, radius)."""
        json = {"points": [{"at_m": point(p), "radius_m": metres(p[3])} for p in points]}
        pieces = [(a[:3], b[:3], a[3], b[3]) for a, b in zip(points, points[1:])]
        self._part(group, Part({"tube": json}, blend, pieces))

    def ellipsoid(self, group, center, radii, x_axis=None, y_axis=None, blend=0):
        json = {"center_m": point(center), "radii_m": point(radii)}
        if x_axis:
            json["x_axis"] = direction(x_axis)
        if y_axis:
            json["y_axis"] = direction(y_axis)
        x = unit(x_axis or (1, 0, 0))
        z = unit(cross(x, y_axis or (0, 1, 0)))
        self._part(group, Part({"ellipsoid": json}, blend, ellipsoid=(center, radii, (x, cross(z, x), z))))

    def half_space(self, group, at, normal, blend=0):
        json = {"point_m": point(at), "normal": direction(normal)}
        self._part(group, Part({"half_space": json}, blend, plane=(at, unit(normal))))

    def go_on(self, groups, axis, at, to):
        """Tubes without blend, and capsules, that end at `at` along an axis go on to `to`, parallel to it: out of the picture."""
        for group in groups:
            for part in list(self.groups[group]):
                tube = "tube" in part.json
                for end, (a, b, r, other) in ((0, part.pieces[0]), (-1, part.pieces[-1])) if part.pieces else ():
                    if end:
                        a, r = b, other
                    if abs(a[axis] - at) > 1e-9:
                        continue
                    far = (*a[:axis], to, *a[axis + 1:])
                    if not tube:
                        self.capsule(group, far, a, r)
                    elif end or not part.blend:
                        where = len(part.json["tube"]["points"]) if end else 0
                        part.json["tube"]["points"].insert(where, {"at_m": point(far), "radius_m": metres(r)})
                        part.pieces.insert(len(part.pieces) if end else 0, (a, far, r, r) if end else (far, a, r, r))

    def structure(self, id, name, layer):
        self.structures[id] = {"tissue": layer["tissue"], "name": name, **layer}

    def describe(self, kinds, fibres, pulses):
        """What the structures are, by id: a kind, where the tissue does not say it; which way fibres run, TUBE or a
        direction; how far an artery's wall moves."""
        assert {*kinds, *fibres, *pulses} <= {*self.structures}
        for id, layer in self.structures.items():
            self.facts[id] = {"kind": kinds.get(id, layer["tissue"])}
            if id in fibres:
                way = fibres[id]
                self.facts[id]["fibre"] = {"along_tube": True} if way == TUBE else {"direction": direction(way)}
            if id in pulses:
                self.facts[id]["pulse_m"] = metres(pulses[id])

    def rule(self, structure, group, low=None, high=None, *clips):
        """Points whose distance from `group` is in [low, high), and from each clip's group in its own range, are of
        the structure, unless an earlier rule took them."""
        self.rules.append((structure, [(group, low, high), *clips]))

    # ---- asked ----

    def distance(self, group, p):
        value = FAR
        for part in self.groups[group]:
            value = part.join(value, p)
        return value

    def at(self, p):
        """The structure's id at a point."""
        known = {}

        def distance(group):
            if group not in known:
                known[group] = self.distance(group, p)
            return known[group]
        if distance(self.skin) >= 0:
            return OUTSIDE
        for structure, ranges in self.rules:
            if all((low is None or distance(group) >= low) and (high is None or distance(group) < high)
                   for group, low, high in ranges):
                return structure
        return self.rest

    def is_bone(self, structure):
        return structure != OUTSIDE and self.structures[structure]["tissue"] == "BONE"

    def stack(self, entry, target, reach, least, step=0.1):
        """The layers along the line from `entry` through `target`: [(structure, top)], in mm from the entry. Ends at
        the first bone, outside, or at `reach`. A layer thinner than `least` goes to the one before it."""
        axis = unit(sub(target, entry))

        def at(t):
            return self.at(add(entry, scaled(axis, t)))
        layers, before, t = [(at(1e-3), 0.0)], at(1e-3), 1e-3
        while t < reach and before != OUTSIDE and not self.is_bone(before):
            following = at(t + step)
            if following != before:
                low, high = t, t + step
                while high - low > 1e-4:
                    middle = 0.5 * (low + high)
                    low, high = (middle, high) if at(middle) == before else (low, middle)
                before, t = at(high), high
                if layers and high - layers[-1][1] < least:
                    layers.pop()
                if not layers or layers[-1][0] != before:
                    layers.append((before, high if layers else 0.0))
            else:
                t += step
        return layers

    # ---- written ----

    def json(self):
        def bounds(group, low, high):
            found = {"group": group}
            if low is not None:
                found["from_m"] = metres(low)
            if high is not None:
                found["to_m"] = metres(high)
            return found
        rules = []
        for structure, ranges in self.rules:
            rule = {**bounds(*ranges[0]), "structure": structure}
            if ranges[1:]:
                rule["clips"] = [bounds(*clip) for clip in ranges[1:]]
            rules.append(rule)
        groups = [{"id": name, "parts": [{**part.json, **({"blend_m": metres(part.blend)} if part.blend else {})}
                                         for part in parts]} for name, parts in self.groups.items()]
        structures = [{"id": id, "layer": layer, **self.facts[id]} for id, layer in self.structures.items()]
        return {"groups": groups, "structures": structures, "rules": rules, "skin": self.skin, "rest": self.rest}


def beside(v, group, start, way, clearance):
    """Where a line from `start` first is `clearance` away from what the group has so far."""
    at = start
    while v.distance(group, at) < clearance - 1e-3:
        at = add(at, scaled(unit(way), max(0.5 * (clearance - v.distance(group, at)), 1e-3)))
    return at


LINE = 110  # as in common/profile/message_json.cpp


def number_text(value):
    """As std::to_chars: fixed, or scientific where that is shorter."""
    if value == 0:
        return "0"
    for places in range(17):  # the fewest digits that give the value back
        if float(f"{value:.{places}e}") == value:
            digits, exponent = f"{value:.{places}e}".split("e")
            break
    fixed = f"{value:.{max(0, places - int(exponent))}f}"
    scientific = f"{digits}e{exponent}"
    return scientific if len(scientific) < len(fixed) else fixed


def canonical(value, indent=0):
    """JSON as `profileJson` writes it: on one line what fits into one."""
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if value is True:
        return "true"
    if isinstance(value, (int, float)):
        return number_text(value)
    if isinstance(value, dict):
        items, ends = [f'"{key}": {canonical(item, indent + 2)}' for key, item in value.items()], "{}"
    else:
        items, ends = [canonical(item, indent + 2) for item in value], "[]"
    if not items:
        return ends
    if not any("\n" in item for item in items) and indent + 2 + sum(len(item.encode()) + 2 for item in items) <= LINE:
        return ends[0] + ", ".join(items) + ends[1]
    lines = (",\n" + " " * (indent + 2)).join(items)
    return f"{ends[0]}\n{' ' * (indent + 2)}{lines}\n{' ' * indent}{ends[1]}"
