"""Measured force curves (needlelab-sim benchmark): headers, directions, and the result."""
import math

from lab import says

SPECIMENS = 3


def curve(specimen, flip_depth=1, flip_force=1, back=False):
    points = [(0.0005 * k, (0.2 + 0.1 * specimen) * (1 + 40 * 0.0005 * k) + 0.02 * math.sin(k)) for k in range(40)]
    if back:
        points += [(depth, -0.3 * force) for depth, force in reversed(points)]
    return [(flip_depth * depth, flip_force * force) for depth, force in points]


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

    def benchmark(path, *words):
        return lab.programs.run("sim", "benchmark", "--data", path, "--no-times", "--held-out", "specimen", *words)

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
        yield f"{name} are read", lambda name=name, write=write, header=header, lines=lines: says(benchmark(folder("shape " + name, write, header, lines)), 0)
    yield "lines above the header are passed over when a person says so", lambda: says(
        benchmark(folder("above", plain, head_lines=("Instrument 7", "run; 3")), "--lines-above", "2"), 0)
    yield "without that the line that was read is shown", lambda: says(benchmark(folder("above2", plain, head_lines=("Instrument 7", "run; 3"))), 2, "Instrument 7")
    yield "millimetres are not metres", lambda: says(benchmark(folder("mm", plain, "Depth [mm],Force [N]")), 2, "'Depth [mm],Force [N]'")
    yield "insertion and withdrawal are split, with a note", lambda: says(benchmark(folder("back", plain)), 0, f"{SPECIMENS} of {SPECIMENS} curves were split")
    yield "negative depths are refused", lambda: says(benchmark(folder("negative", plain)), 2, "--negate depth")
    yield "and taken when a person says so", lambda: says(benchmark(folder("negative2", plain), "--negate", "depth"), 0, "depth_m of all files is negated")
    yield "forces that pull are refused", lambda: says(benchmark(folder("pulls", plain)), 2, "--negate force")
    yield "and taken when a person says so", lambda: says(benchmark(folder("pulls2", plain), "--negate", "force"), 0, "force_n of all files is negated")
