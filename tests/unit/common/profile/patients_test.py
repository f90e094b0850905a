#!/usr/bin/env python3
"""The patients in db/samples/volumes are what their generator writes, and the planned paths meet the layers of its tables."""
import filecmp
import json
import os
import sys
import tempfile
import unittest

VOLUMES = os.path.join(os.path.dirname(os.path.realpath(__file__)), "../../../../db/samples/volumes")
sys.path.insert(0, VOLUMES)
import field  # noqa: E402
import patients  # noqa: E402

WITHIN = 0.03  # mm


def until(v, start, way, ids, inside):
    """How far from `start` the structures end that are of `ids` (`inside`), or that are not."""
    t = 0
    while t < 100 and (v.at(field.add(start, field.scaled(way, t))) in ids) == inside:
        t += 0.25
    low, high = t - 0.25, t
    for _ in range(10):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (v.at(field.add(start, field.scaled(way, middle))) in ids) == inside else (low, middle)
    return high


def measured(v, ids, start, way):
    """The length within the structures along a line, or from the one kind to the other."""
    way = field.unit(way)
    back = field.scaled(way, -1)
    if isinstance(ids, list):
        return until(v, start, way, ids, True) + until(v, start, back, ids, True)
    one, other = ids
    if v.at(start) in one:
        surface = field.add(start, field.scaled(way, until(v, start, way, one, True)))
        return until(v, surface, way, other, False)
    return until(v, start, way, other, False) + until(v, start, back, one, False)


class Patients(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.paths_file = os.path.join(cls.folder.name, "paths")
        patients.write(cls.folder.name, cls.paths_file)
        with open(cls.paths_file, encoding="utf-8") as file:
            cls.paths = json.load(file)["paths"]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_committed_files_are_the_generators_output(self):
        def profiles(folder):
            return sorted(name for name in os.listdir(folder) if name.endswith(".json") and "curriculum" not in name)
        self.assertEqual(profiles(self.folder.name), profiles(VOLUMES))
        self.assertEqual(len(self.paths), 12)
        self.assertFalse(set(profiles(VOLUMES)) & set(os.listdir(os.path.join(VOLUMES, ".."))), "an id names one profile")
        pairs = [(os.path.join(self.folder.name, name), os.path.join(VOLUMES, name)) for name in profiles(VOLUMES)]
        for written, committed in [*pairs, (self.paths_file, patients.PATHS)]:
            self.assertTrue(filecmp.cmp(written, committed, shallow=False), f"{committed}: run db/samples/volumes/patients.py")

    def test_the_planned_layers_are_those_of_the_tables(self):
        for path in self.paths:
            with self.subTest(path["profile"]):
                expected, found = path["expected"], path["planned"]
                self.assertEqual([id for id, _ in found[:len(expected)]], [id for id, _ in expected])
                for (id, top), (_, wanted) in zip(found, expected):
                    self.assertAlmostEqual(top, wanted, delta=WITHIN, msg=id)

    def test_the_planned_path_reaches_its_target_first(self):
        for path in self.paths:
            with self.subTest(path["profile"]):
                depth = 1e3 * field.norm(tuple(path["target_m"].values()))
                above = [id for id, top in path["planned"] if top < depth]
                self.assertEqual(above[-1], path["target"])
                self.assertFalse(set(above) & set(path["hazards"]))

    def test_a_wrong_path_meets_what_it_names(self):
        for path in self.paths:
            self.assertGreaterEqual(len(path["wrong"]), 2)
            for wrong in path["wrong"]:
                with self.subTest(path["profile"], wrong=wrong["name"]):
                    self.assertIn(wrong["meets"], [id for id, _ in wrong["layers"]])

    def test_the_bodies_have_the_sizes_of_the_tables(self):
        for region in patients.REGIONS:
            for build in region.builds:
                p = patients.parameters(region, build)
                v = region.volume(p)
                for words, ids, start, way, wanted, within in region.measures(p):
                    with self.subTest(f"{region.id}-{build}", words=words):
                        self.assertAlmostEqual(measured(v, ids, start, way), wanted, delta=within)

    def test_bones_lie_under_skin(self):
        for region in patients.REGIONS:
            for build in region.builds:
                p = patients.parameters(region, build)
                v = region.volume(p)
                bones = {ranges[0][0] for structure, ranges in v.rules if v.is_bone(structure)}
                ends = [end for group in bones for part in v.groups[group] for piece in part.pieces
                        for end in ((piece[0], piece[2]), (piece[1], piece[3]))]
                for part in (part for group in bones for part in v.groups[group] if part.ellipsoid):
                    center, radii, axes = part.ellipsoid
                    ends += [(tuple(c + side * r * x for c, x in zip(center, axis)), 0)
                             for r, axis in zip(radii, axes) for side in (-1, 1)]
                self.assertGreater(len(ends), 20)
                for at, radius in ends:
                    self.assertLess(v.distance("skin", at) + radius, -p.skin, (region.id, build, at))

    def test_every_length_names_its_source(self):
        for region in patients.REGIONS:
            for build in region.builds:
                text = patients.sources_text(region, build)
                for name, values, source in region.parameters:
                    self.assertTrue(source)
                    words = f"{name.replace('_', ' ')} {values[region.builds.index(build)]:g} mm"
                    self.assertIn(words, text.split(" Set by hand: ")["set by hand" in source])

    def test_numbers_are_as_short_as_to_chars(self):
        for value, text in ((0.0008, "8e-04"), (0.001, "0.001"), (0.0012, "0.0012"), (100000, "1e+05"), (9000, "9000"),
                            (0, "0"), (-0.05, "-0.05"), (0.00085, "0.00085"), (1, "1"), (0.1 + 0.2, "0.30000000000000004")):
            self.assertEqual(field.number_text(value), text)

    def test_distances_to_an_ellipsoid_are_those_of_its_axes(self):
        radii = (10, 6, 3)
        for axis in range(3):
            for off in (-1.5, 0, 4):
                p = [0, 0, 0]
                p[axis] = radii[axis] + off
                if radii[axis] == min(radii) or off >= 0:  # inside, the nearest point is on the least axis
                    self.assertAlmostEqual(field.to_ellipsoid(p, radii), off, places=6)


if __name__ == "__main__":
    unittest.main()
