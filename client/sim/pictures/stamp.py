#!/usr/bin/env python3
"""Which sources the pictures and tables of client/sim were made from.

usage: stamp.py                    names those whose sources have changed since, or that were changed by hand
       stamp.py --write NAME…      notes the sources as they are: after drawing (`draw` does it)

A source counts without its comments and spaces, so that a remark asks for no new picture. NAME is a file below client/sim,
or FILE#PART for a table in a page, between the lines that `tables.py` looks for: the text around it may change.
"""
import glob
import hashlib
import json
import os
import re
import sys

import tables

HERE = os.path.dirname(os.path.realpath(__file__))
FOLDER = "client/sim"
STAMPS = f"{FOLDER}/pictures/made_from.json"
ENGINE = ["common/haptics/**/*.cpp", "common/haptics/**/*.h"]
LOOP = ENGINE + ["client/device/hand/hand*", "client/device/hand/simulated_device*", "client/device/haptic_chain*", "client/sim/tools/closed_loop*"]
FIGURES = LOOP + ["client/sim/figures.cpp", "client/sim/plots/style.gp"]
REPORT = LOOP + ["client/sim/accuracy/*.cpp", "client/sim/accuracy/*.h", "client/sim/curves/*", "client/sim/benchmark/*.cpp", "client/sim/benchmark/*.h",
                 "client/sim/plots/style.gp", "client/sim/plots/accuracy.gp",
                 "common/fem/*.cpp", "common/fem/*.h", "db/samples/paper-1dof.json", "db/samples/paper-six-layers.json"]
CASES = LOOP + ["client/sim/stability/**/*.cpp", "client/sim/stability/**/*.h", "client/sim/stability_command.cpp", "tests/stability/cases.json",
                "client/sim/plots/style.gp", "client/sim/plots/models.gp", "common/fem/*.cpp", "common/fem/*.h"]
SKILL = LOOP + ["client/sim/skill/*.cpp", "client/sim/skill/*.h", "client/sim/skill_command.cpp", "client/sim/tools/small_sample*",
                "common/fem/*.cpp", "common/fem/*.h", "common/gesture/*.cpp", "common/gesture/*.h", "common/scoring/**/*.cpp", "common/scoring/**/*.h",
                "db/samples/deltoid-adult.json", "db/samples/shoulder-posterior.json", "db/samples/knee-adult.json",
                "db/samples/hip-adult.json", "db/samples/finger-adult.json", "db/samples/carpal-tunnel.json"]
BENCHMARK = ENGINE + ["client/sim/benchmark/**/*.cpp", "client/sim/benchmark/**/*.h", "client/sim/benchmark/known/needle_force.json",
                      "client/sim/benchmark_command.cpp", "client/sim/curves/*",
                      "client/sim/stability/gestures/passivity_observer*", "client/sim/stability/gestures/passivity_gesture*", "client/sim/tools/small_sample*"]
TABLES = ["client/sim/pictures/tables.py"]
SOURCES = {
    "pictures/six-layers.png": FIGURES + ["client/sim/plots/fig09.gp", "client/sim/plots/phases.gp", "db/samples/paper-six-layers.json"],
    "pictures/clamping.png": FIGURES + ["client/sim/plots/fig10.gp", "db/samples/paper-clamping.json"],
    "pictures/effects.png": ENGINE + ["client/effect_cost/*.cpp", "client/sim/effects_study.cpp", "client/sim/plots/effects.gp",
                             "client/sim/plots/style.gp"],
    "pictures/accuracy.png": REPORT,
    "pictures/accuracy.txt": REPORT,
    "stability/pictures/cases.png": CASES + ["client/sim/plots/stability.gp"],
    "stability/pictures/holds.png": CASES + ["client/sim/plots/stability-holds.gp"],
    "stability/pictures/stiffness_limits.png": CASES + ["client/sim/plots/stiffness_limits.gp"],
    "stability/pictures/stiffness_rest.png": CASES + ["client/sim/plots/stiffness_rest.gp"],
    "skill/pictures/skill.png": SKILL + ["client/sim/plots/skill.gp", "client/sim/plots/style.gp"],
    "skill/README.md#skill": SKILL + TABLES,
    "benchmark/pictures/needle_force.png": BENCHMARK + ["client/sim/plots/benchmark.gp", "client/sim/plots/style.gp"],
    "benchmark/README.md#benchmark": BENCHMARK + TABLES,
}


def matter(path):
    """What of a source can change a picture."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if path.endswith((".cpp", ".h")):
        text = re.sub(r"(?m)//.*$", "", text)
    elif path.endswith((".gp", ".py")):
        text = re.sub(r"(?m)^#.*$", "", text)
    return re.sub(r"\s+", "", text)


def hash_of_sources(root, patterns):
    digest = hashlib.sha256()
    paths = sorted({path for pattern in patterns for path in glob.glob(os.path.join(root, pattern), recursive=True)})
    for path in paths:
        if not path.endswith((".cpp", ".h", ".gp", ".json", ".py")):
            continue
        digest.update(os.path.relpath(path, root).encode() + b"\0" + matter(path).encode() + b"\0")
    return digest.hexdigest()[:16]


def stamp_of(root, name, sources=SOURCES):
    page, _, part = name.partition("#")
    with open(os.path.join(root, FOLDER, page), "rb") as file:
        content = file.read()
    if part:
        content = tables.part_of(content.decode(), part).encode()
    made = hashlib.sha256(content).hexdigest()[:16]
    return {"made": made, "sources": hash_of_sources(root, sources[name])}


def check(root, sources=SOURCES):
    """The faults, as lines; empty when every picture comes from the sources beside it."""
    with open(os.path.join(root, STAMPS), encoding="utf-8") as file:
        stamps = json.load(file)
    faults = []
    for name in sources:
        path = f"{FOLDER}/{name}"
        page, _, part = path.partition("#")
        if not os.path.exists(os.path.join(root, page)):
            faults.append(f"there is no {page}")
            continue
        if part:
            with open(os.path.join(root, page), encoding="utf-8") as file:
                if tables.part_of(file.read(), part) is None:
                    faults.append(f"{page} has no table between {tables.begin_of(part)} and {tables.end_of(part)}")
                    continue
        noted, now = stamps.get(name, {}), stamp_of(root, name, sources)
        if noted.get("sources") != now["sources"]:
            faults.append(f"{path} was made from other sources: run client/sim/pictures/draw on a quiet machine")
        elif noted.get("made") != now["made"]:
            faults.append(f"{path} is not what was drawn: run client/sim/pictures/draw")
    return faults


def write(root, names, sources=SOURCES):
    path = os.path.join(root, STAMPS)
    stamps = {}
    if os.path.exists(path):
        with open(path, encoding="utf-8") as file:
            stamps = json.load(file)
    for name in names:
        stamps[name] = stamp_of(root, name, sources)
    with open(path, "w", encoding="utf-8") as file:
        json.dump(stamps, file, indent=2, sort_keys=True)
        file.write("\n")


def main(arguments):
    root = os.path.join(HERE, "../../..")
    if arguments[:1] == ["--write"]:
        write(root, arguments[1:])
        return 0
    faults = check(root)
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
