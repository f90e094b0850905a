#!/usr/bin/env python3
"""Writes the patients whose bodies are fields: shoulder, knee, wrist and lumbar spine, each in three builds.

usage: patients.py          writes the profiles beside this file, and the paths for the tests (tests/data/profile/patient_paths.json)
       patients.py --table  prints each region's parameters: name, value by build, source

A parameter's value in mm and its source stand in the region's file (PARAMETERS). The paths are, for each profile: the planned one
with its layers, which structure is its target, which structures are hazards, and wrong ones with what they meet.
"""
import os
import sys
from types import SimpleNamespace

import knee
import lumbar
import shoulder
import wrist
from field import canonical, norm, point

BUILDS = ("slender", "median", "heavy")


def region_of(module):
    return SimpleNamespace(builds=BUILDS, parameters=module.PARAMETERS, share=module.FORCES, volume=module.volume,
                           expected=module.expected, targets=module.targets, hazards=module.hazards,
                           wrong_paths=module.wrong_paths, measures=module.measures, **module.REGION)


REGIONS = tuple(region_of(module) for module in (shoulder, knee, wrist, lumbar))
HERE = os.path.dirname(os.path.realpath(__file__))
PATHS = os.path.join(HERE, "../../../tests/data/profile/patient_paths.json")
NEEDLES = {18: 1.27, 21: 0.82, 22: 0.72, 23: 0.64, 25: 0.51}  # outer diameter in mm by gauge, ISO 9626
BEYOND = 20.0  # mm: how far behind the target a path is followed


def parameters(region, build):
    column = region.builds.index(build)
    return SimpleNamespace(build=build, **{name: values[column] for name, values, _ in region.parameters})


def sources_text(region, build):
    """Each length with its source; what has none is named at the end."""
    column, parts, by_hand = region.builds.index(build), [], []
    for name, values, source in region.parameters:
        words = f"{name.replace('_', ' ')} {values[column]:g} mm"
        if "set by hand" in source:
            by_hand.append(words)
        else:
            parts.append(f"{words} ({source})")
    return ("A teaching body, no measurement of a patient. " + "; ".join(parts) + ". Set by hand: " + ", ".join(by_hand) +
            (", " if by_hand else "") + "all other places and sizes, lateral stiffness, membranes, rejection, limits of clamping and "
            "orientation, stop times, stiffness of shaft friction and hub, stiffness and friction of bone, palpation. " + region.forces.format(share=f"{region.share[build][0]:g}") +
            " Wall stiffness 500 N/m: enhanced-tracking-wall paper. Shaft friction: about a fifth of the axial force at the target "
            "(Barnett: 21 %).")


def profile(region, build):
    p = parameters(region, build)
    length, gauge = region.needle[build]
    needle = {"length_m": length, "gauge": gauge, "tip": region.tip[0]}
    if region.tip[1]:
        needle["bevel_angle_rad"] = region.tip[1]
    targets = [{"name": name, "center_m": point(center), "structure": structure}
               for name, structure, center in region.targets(p)]
    hazards = [{"name": name, "kind": kind, "structure": structure} for name, kind, structure in region.hazards(p)]
    effects = ["CUTTING", "ATTRACTED", "CLAMPING", "ORIENTATION_LIMIT", "SHAFT_FRICTION", "PUNCTURE"]
    made = {
        "id": f"{region.id}-{build}", "name": f"{region.name}, {build}: {region.title}", "axial_model": "ENHANCED_TRACKING_WALL",
        "needle": needle,
        "tracking_wall": {"stiffness_n_per_m": 500, "stop_speed_m_s": 0.003, "stop_dwell_s": 0.05, "stop_duration_s": 0.8},
        "virtual_fixture": {"max_stiffness_n_per_m": 300, "max_force_n": region.fixture[build], "mode": "CONSERVATIVE"},
        "orientation_limit": {"stiffness_nm_per_rad": 0.5, "max_torque_nm": 0.2}, "shaft_friction": {"stiffness_n_per_m": 280},
        "max_force_n": 10, "targets": targets, "hazards": hazards,
        "effects": effects + (["CUT_MEMORY"] if region.cut_memory else []) + ["BONE", "HUB", "PALPATION"],
        "description": region.description, "sources": sources_text(region, build)}
    if region.cut_memory:
        made["cut_memory"] = {"cutting_share": 0.23, "radius_m": 0.001}

    def felt(name):
        return {name: getattr(region, name)} if build not in getattr(region, "unfelt", ()) and hasattr(region, name) else {}

    return {**made, "bone": {"stiffness_n_per_m": 600, "friction_coefficient": 0.3}, "hub": {"stiffness_n_per_m": 200},
            "directions": region.directions, "volume": region.volume(p).json(),
            "palpation": {"skin_stiffness_n_per_m": 105, "bone_stiffness_n_per_m": 600, "friction_coefficient": 0.3, "radius_m": 0.003,
                          **felt("landmark"), "stiffening_share": 0.5, **felt("landmark_name")}}


def paths(region, build):
    """The planned path and the wrong ones, with the layers that the generator's own evaluation finds."""
    p, v = parameters(region, build), region.volume(parameters(region, build))
    least = 0.5 * NEEDLES[region.needle[build][1]]
    _, structure, center = region.targets(p)[0]

    def layers(entry, through, reach):
        return [[structure, round(top, 3)] for structure, top in v.stack(entry, through, reach, least)]
    planned = layers((0, 0, 0), center, norm(center) + 8)
    wrong = []
    for words, through, meets in region.wrong_paths(p):
        wrong.append({"name": words, "through_m": point(through), "meets": meets,
                      "layers": layers((0, 0, 0), through, norm(through) + BEYOND)})
    return {"profile": f"{region.id}-{build}", "target": structure, "target_m": point(center),
            "hazards": sorted({hazard[2] for hazard in region.hazards(p)}),
            "expected": [[id, round(top, 3)] for id, top in region.expected(p)], "planned": planned, "wrong": wrong}


def write(folder, paths_file, only=None):
    all_paths = []
    for region in REGIONS:
        for build in region.builds:
            if only and not f"{region.id}-{build}".startswith(only):
                continue
            with open(os.path.join(folder, f"{region.id}-{build}.json"), "w", encoding="utf-8") as file:
                file.write(canonical(profile(region, build)) + "\n")
            all_paths.append(paths(region, build))
    with open(paths_file, "w", encoding="utf-8") as file:
        file.write(canonical({"paths": all_paths}) + "\n")


def main(arguments):
    if arguments == ["--table"]:
        for region in REGIONS:
            print(f"{region.name}: {', '.join(region.builds)}")
            for name, values, source in region.parameters:
                print(f"  {name:20} {' '.join(f'{value:6g}' for value in values)}  {source}")
        return 0
    if arguments:
        print(__doc__, file=sys.stderr)
        return 2
    write(HERE, PATHS)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
