"""Measured force curves (common/python/examples/fit.py --list): headers, directions, and what is read."""
import math
import pathlib

from lab import near, says

FIT = pathlib.Path(__file__).resolve().parents[2] / "common/python/examples/fit.py"

SPECIMENS = 3


def curve(specimen, flip_depth=1, flip_force=1, back=False):
    points = [(0.0005 * k, (0.2 + 0.1 * specimen) * (1 + 40 * 0.0005 * k) + 0.02 * math.sin(k)) for k in range(40)]
    if back:
        points += [(depth, -0.3 * force) for depth, force in reversed(points)]
    return [(flip_depth * depth, flip_force * force) for depth, force in points]


def air(first_n, drift_n, specimen):
    """5 mm above the skin, then 20 mm in: about 0.5 N/mm in tissue, on a zero that goes on by drift_n."""
    return [(d, (500 + 50 * specimen) * max(0, d) + first_n + drift_n * k / 100 + (0.01 if k % 2 else -0.01)) for k in range(101) for d in [-0.005 + 0.00025 * k]]


def read(said):
    """What is said of each curve, by its name."""
    return dict(row.strip().split(": ", 1) for row in said.out.splitlines() if row.startswith("  "))


def mean_n(said):
    return sum(float(text.split("mean ")[1].split()[0]) for text in read(said).values())


def rows(lab):
    def folder(name, write, header="depth_m,force_n", head_lines=()):
        for specimen in range(SPECIMENS):
            body = [write(depth, force) for depth, force in curve_of(specimen, name)]
            lab.programs.file(f"{name}/s{specimen}.csv", "\n".join([*head_lines, header, *body]) + "\n")
        facts = ",".join(f'{{"file":"s{k}.csv","specimen":"s{k}","needle":"n","tissue":"t","speed_m_s":0.005}}' for k in range(SPECIMENS))
        lab.programs.file(f"{name}/data_set.json", f'{{"name":"{name}","curves":[{facts}]}}')
        return lab.programs.folder / name

    def curve_of(specimen, name):
        return curve(specimen, -1 if name.startswith("negative") else 1, -1 if name.startswith("pulls") else 1, name.startswith("back"))

    build = lab.programs.bin.parent
    environment = {"PYTHONPATH": f"{build}/lib/python3", "LD_LIBRARY_PATH": f"{build}/lib"}

    def fit(path, *words):
        return lab.programs.start(["/usr/bin/python3", "-B", FIT, "--list", "--data", path, *words], environment)

    def plain(depth, force):
        return f"{depth:.6f},{force:.6f}"

    def decimal(depth, force):
        return f"{depth:.6f};{force:.6f}".replace(".", ",")

    shapes = {
        "plain": (plain, "depth_m,force_n", ()),
        "semicolons and decimal commas": (decimal, "depth_m;force_n", ()),
        "tabs": (lambda d, f: f"{d:.6f}\t{f:.6f}", "depth_m\tforce_n", ()),
        "quoted and in capitals": (lambda d, f: f'"{d:.6f}","{f:.6f}"', '"DEPTH_M","FORCE_N"', ()),
        "units in brackets": (plain, "Depth [m],Force [N]", ()),
    }
    for name, (write, header, lines) in shapes.items():
        yield f"{name} are read", lambda name=name, write=write, header=header, lines=lines: says(fit(folder("shape " + name, write, header, lines)), 0)
    yield "lines above the header are passed over when a person says so", lambda: says(
        fit(folder("above", plain, head_lines=("Instrument 7", "run; 3")), "--lines-above", "2"), 0)
    yield "without that the line that was read is shown", lambda: says(fit(folder("above2", plain, head_lines=("Instrument 7", "run; 3"))), 2, "Instrument 7")
    yield "millimetres are not metres", lambda: says(fit(folder("mm", plain, "Depth [mm],Force [N]")), 2, "'Depth [mm],Force [N]'")
    yield "insertion and withdrawal are split, with a note", lambda: says(fit(folder("back", plain)), 0, f"{SPECIMENS} of {SPECIMENS} curves were split")
    yield "negative depths are refused", lambda: says(fit(folder("negative", plain)), 2, "--negate depth")
    yield "and taken when a person says so", lambda: says(fit(folder("negative2", plain), "--negate", "depth"), 0, "depth_m of all files is negated")
    yield "forces that pull are refused", lambda: says(fit(folder("pulls", plain)), 2, "--negate force")
    yield "and taken when a person says so", lambda: says(fit(folder("pulls2", plain), "--negate", "force"), 0, "force_n of all files is negated")
    yield from others(lab, folder, fit, plain)


def others(lab, folder, fit, plain):
    """Names, signs, letters, units, zeros and copies that other systems make."""
    file = lab.programs.file

    def as_plain(name, change, *words):
        """The folder, changed, gives the numbers of the plain one."""
        plainly = fit(folder(f"plain {name}", plain))
        place = folder(f"as plain {name}", plain)
        for path in sorted(place.glob("s*.csv")):
            change(path)
        said = fit(place, *words)
        return says(said, 0) or ("" if read(said) == read(plainly) != {} else f"other numbers: {read(said)}")

    def edit(change, encoding="utf-8"):
        return lambda path: path.write_bytes(change(path.read_text()).encode(encoding))

    def signed(text):
        return "\n".join([text.splitlines()[0], *(",".join(f"+{cell}\u00a0" for cell in row.split(",")) for row in text.splitlines()[1:])])

    def cells(text, more):
        return "\n".join(row + more(k) for k, row in enumerate(text.splitlines()))

    texts = {
        "plus signs and blanks that do not break": edit(signed),
        "numpy's header": edit(lambda text: "# " + text),
        "comments": edit(lambda text: "% by hand\n" + text.replace("\n", "\n// here it begins\n", 1) + "# end, of it\n"),
        "comments behind rows": edit(lambda text: cells(text, lambda k: " # touched, then held" if k == 3 else "")),
        "a degree sign in Latin-1": edit(lambda text: cells(text, lambda k: ",21.5" if k else ",temperature [\u00b0C]"), "latin-1"),
        "companions of a Mac": lambda path: path.with_name("._" + path.name).write_bytes(b"\x05\x16\x07\xff"),
    }
    for name, change in texts.items():
        yield f"{name} are passed over: the numbers are the plain ones", lambda name=name, change=change: as_plain(name, change)

    def renamed(ending):
        place = folder(f"ending {ending}", plain)
        for path in place.glob("s*.csv"):
            path.rename(path.with_suffix(ending))
        facts = place / "data_set.json"
        facts.write_text(facts.read_text().replace(".csv", ending))
        (place / "photo.jpg").write_bytes(b"x")
        return says(fit(place), 0, f"{SPECIMENS} curves", f"1 of {SPECIMENS + 1} files in the folder are left out", "photo.jpg")

    for ending in (".CSV", ".TXT", ".Csv"):
        yield f"{ending} is read, and what is left out is counted", lambda ending=ending: renamed(ending)

    def tables(name, *curves):
        for k, points in enumerate(curves):
            body = "".join(f"{d:.7f},{f:.6f},0.005,gel {k},18G,gel\n" for d, f in points)
            file(f"{name}/s{k}.csv", "depth_m,force_n,speed_m_s,specimen,needle,tissue\n" + body)
        return lab.programs.folder / name

    copied = [curve(0), curve(1), curve(2), curve(0)]
    yield "a copy under another name and specimen counts once, and is named", lambda: says(
        fit(tables("copied", *copied)), 0, "3 curves", "1 of 4 curves", "s3.csv is a copy of s0.csv")

    def zeroed(name, first_n, drift_n, *texts):
        place = tables(name, *(air(first_n + 0.1 * k, drift_n, k) for k in range(3)))
        tared, right = fit(place, "--tare"), fit(tables(name + " right", *(air(0, 0, k) for k in range(3))))
        wrong = says(fit(place), 0, *texts, "--tare takes it off") or says(tared, 0, "it is taken off (--tare)")
        return wrong or near(mean_n(tared), mean_n(right), 0.02, "the mean force")

    yield "a sensor that was not tared is named, and tared by --tare", lambda: zeroed("offset", 0.8, 0, "1.00 N in s2.csv")
    yield "a zero that drifts is named", lambda: zeroed("drift", -0.6, 0.42, "the zero drifts by 0.4")
    yield "grams in newtons are asked for", lambda: says(
        fit(tables("grams", *([(d, f / 9.80665e-3) for d, f in curve(k)] for k in range(3)))), 2, "looks like gram-force", "--force-unit")

    def weighed(name, unit, size):
        said = fit(tables(name, *([(d, f / size) for d, f in curve(k)] for k in range(3))), "--force-unit", unit)
        plainly = fit(tables(name + " plain", *(curve(k) for k in range(3))))
        return says(said, 0, f"1 in force_n is {size:g} N") or ("" if read(said) == read(plainly) != {} else f"other numbers: {read(said)}")

    yield "and read with their unit", lambda: weighed("gf", "gf", 9.80665e-3)
    yield "millinewtons too", lambda: weighed("mN", "mN", 0.001)
    for name, factor, unit in (("mm", 1000, "millimetres"), ("cm", 100, "centimetres")):
        yield f"depths in {unit} are asked for", lambda name=name, factor=factor, unit=unit: says(
            fit(tables(name + " deep", *([(d * factor, f) for d, f in curve(k)] for k in range(3)))), 2, "'depth_m'", f"looks like {unit}")

    def timed(name, phase):
        head = "t_s,force_n,speed_m_s,specimen,needle,tissue" + (",phase" if phase else "")
        for k in range(3):
            body = [f"{0.1 * i:.1f},{0.02 * min(i, 40) + 0.01 * k:.3f},0.005,gel {k},18G,gel" + (("," + ("insert" if i < 40 else "hold")) if phase else "")
                    for i in range(80)]
            file(f"{name}/s{k}.csv", "\n".join([head, *body]) + "\n")
        return fit(lab.programs.folder / name)

    yield "force over time alone does not say where the needle stops", lambda: says(timed("time", False), 2, "where the needle stops or turns", "'phase'")
    yield "and is read when it does", lambda: says(timed("time and phase", True), 0, "3 curves")
