"""A screen's values compared with the expected ones: every comparison is kept, so that a person can read which numbers were checked."""
import math
import re

# a displayed number's unit -> its factor to SI
UNITS = {"": 1, "s": 1, "N": 1, "mm": 1e-3, "m": 1, "mm/s": 1e-3, "m/s": 1, "mJ": 1e-3, "J": 1, "cm²": 1e-4, "%": 1e-2, "ms": 1e-3,
         "°": math.pi / 180, "B": 1, "kB": 1e3, "MB": 1e6, "GB": 1e9}


YES_OR_NO = ("ends_in_tissue", "target_reached", "aspirated_before_injection")


def differs(expected, seen, within):
    """True if `seen` differs from the expected value; a number may be off by `within`."""
    if isinstance(expected, bool) or isinstance(seen, bool) or not isinstance(expected, (int, float)):
        return type(expected) is not type(seen) or expected != seen
    if not isinstance(seen, (int, float)):
        return True
    if math.isnan(expected) or math.isnan(seen):
        return not (math.isnan(expected) and math.isnan(seen))
    return abs(seen - expected) > within


def spoilt(seen, within):
    """A wrong value as close to the right one as a person could still notice."""
    if isinstance(seen, bool):
        return not seen
    if isinstance(seen, int):
        return seen + max(1, math.ceil(2.1 * within))
    if isinstance(seen, float):
        return 0.0 if math.isnan(seen) else seen + max(2.1 * within, 1e-9 * abs(seen), 1e-12)
    if isinstance(seen, str):
        digit = re.search(r"\d(?!.*\d)", seen, re.S)
        if digit:
            return seen[:digit.start()] + str((int(digit[0]) + 1) % 10) + seen[digit.end():]
        return seen + "x"
    if isinstance(seen, (list, tuple)):
        return list(seen) + ["x"]
    return "x"


def last_quantity(text):
    """"Peak force 3.03 N" -> "3.03 N"; "Angle to the planned line 6.38°" -> "6.38°"; without a quantity, the text itself."""
    found = re.search(r"-?\d+(?:\.\d+)?(?: ?[^\d\s]+)?$", text)
    return found[0] if found else text


class Held:
    """Comparisons by (screen, number). `plant`: the kind whose first value is spoilt before it is compared."""

    def __init__(self, plant=None):
        self.plant, self.planted = plant, False
        self.counts, self.rounding, self.differences = {}, {}, []

    def same(self, screen, number, where, expected, seen, within=0.0):
        kind = (screen, number)
        if kind == self.plant and not self.planted:
            self.planted = True
            seen = spoilt(seen, within)
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if isinstance(expected, float) and within:
            self.rounding[kind] = max(self.rounding.get(kind, 0), within)
        if differs(expected, seen, within):
            self.differences.append((screen, number, where, expected, seen))

    def close(self, screen, number, where, expected, seen, relative=1e-9, absolute=1e-12):
        """A number computed twice: only the order of the sums may differ."""
        if not isinstance(expected, (int, float)) or isinstance(expected, bool):
            return self.same(screen, number, where, expected, seen)
        seen = float(seen) if isinstance(seen, (int, float)) and not isinstance(seen, bool) else seen
        return self.same(screen, number, where, float(expected), seen, max(absolute, relative * abs(expected)))

    def digits(self, screen, number, where, expected, text):
        """A number in printf's %.6g form."""
        self.same(screen, number, where, "-" if expected is None else f"{expected:.6g}" if isinstance(expected, float) else str(expected), text)

    def shown(self, screen, number, where, value, unit, text):
        """"3.03 N", "0.397 cm²", "12": in the unit it names, to as many decimals as are shown for its size."""
        found = re.fullmatch(r"(-?\d+(?:\.\d+)?)(?: ?([^\d\s].*))?", text)
        if not found or (found[2] or "") not in UNITS:
            self.same(screen, number, where, f"a number in {unit or 'nothing'}", text)
            return
        name = found[2] or ""
        if name.replace("mm", "m").replace("mJ", "J").replace("cm²", "m^2").replace("°", "rad") != unit:
            self.same(screen, number, where, f"a number in {unit}", text)
            return
        scaled = value / UNITS[name]
        size = abs(scaled)
        decimals = 0 if size >= 99.95 else 1 if size >= 9.995 else 2 if size >= 0.9995 else 3
        self.same(screen, number, where, float(scaled), float(found[1]), 0.5000001 * 10.0**-decimals)

    def measure(self, screen, number, where, measure, value, unit, text):
        """A measure like `shown`; a share in whole percents, a yes or no in words."""
        if measure in YES_OR_NO:
            self.same(screen, number, where, "yes" if value > 0 else "no", text)
        elif measure.endswith("_share"):
            self.same(screen, number, where, True, text.endswith(" %"))
            self.same(screen, number, where, float(100 * value), float(text.removesuffix(" %")), 0.5000001)
        else:
            self.shown(screen, number, where, value, unit, text)

    def table(self):
        width = max((len(screen) for screen, _ in self.counts), default=0)
        lines, before = [], None
        for (screen, number), count in self.counts.items():
            bad = sum(1 for d in self.differences if d[:2] == (screen, number))
            rounding = self.rounding.get((screen, number))
            lines.append(f"{screen if screen != before else '':{width}}  {number:44} {count:7} held"
                         f"{f', within {rounding:.2g}' if rounding else ''}{f', {bad} DIFFER' if bad else ''}")
            before = screen
        return "\n".join(lines)
