/// Fields for tests: numbers in millimetres, made in a line or two each.
#pragma once

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/anatomy/field.h"
#include "tests/support/random.h"

namespace needlelab::test {

inline constexpr double kNoBound = std::numeric_limits<double>::infinity();

inline Vec3 mm(double x, double y, double z) {
  return {1e-3 * x, 1e-3 * y, 1e-3 * z};
}
inline FieldPart capsule(Vec3 a_m, Vec3 b_m, double radius_a_mm, double radius_b_mm, double blend_mm = 0) {
  return {CapsulePart{a_m, b_m, 1e-3 * radius_a_mm, 1e-3 * radius_b_mm}, 1e-3 * blend_mm};
}
inline FieldPart ball(Vec3 center_m, double radius_mm, double blend_mm = 0) {
  return capsule(center_m, center_m, radius_mm, radius_mm, blend_mm);
}
inline FieldPart ellipsoid(Vec3 center_m, Vec3 radii_m, double blend_mm = 0) {
  return {EllipsoidPart{center_m, radii_m}, 1e-3 * blend_mm};
}
inline FieldPart halfSpace(Vec3 point_m, Vec3 normal) {
  return {HalfSpacePart{point_m, normal}};
}
inline FieldRule rule(std::string group, double from_mm, double to_mm, std::string structure,
                      std::vector<FieldRange> clips = {}) {
  return {{std::move(group), 1e-3 * from_mm, 1e-3 * to_mm}, std::move(clips), std::move(structure)};
}
inline FieldStructure structure(std::string id, bool is_bone = false) {
  FieldStructure made;
  made.name = made.id = std::move(id);
  made.layer.is_bone = is_bone;
  return made;
}

/// A field that passes its checks.
inline Field fieldOf(const FieldSpec& spec) {
  Result<Field> field = Field::make(spec);
  if (!field.ok()) throw std::runtime_error(field.error().message);
  return *std::move(field);
}

/// z > 0 is air; layers of 2, 6 and 1 mm above muscle.
inline FieldSpec slab() {
  FieldSpec spec;
  spec.groups = {{"skin", {halfSpace({}, {0, 0, 2})}}};
  spec.structures = {structure("dermis"), structure("fat"), structure("fascia"), structure("muscle")};
  spec.rules = {rule("skin", -2, 0, "dermis"), rule("skin", -8, -2, "fat"), rule("skin", -9, -8, "fascia")};
  spec.skin = "skin";
  spec.rest = "muscle";
  return spec;
}

/// A forearm near the wrist, about as complicated as a patient: 9 structures, 22 shapes, blends, tapered
/// capsules, a tilted ellipsoid, a tube with a branch, a clip. The skin's top is near z = 0.
inline FieldSpec forearm() {
  FieldSpec spec;
  FieldGroup skin{"skin", {}}, tendons{"tendons", {}};
  for (const double y : {-11.0, 0.0, 11.0})
    skin.parts.push_back(capsule(mm(-60, y, -17), mm(60, 1.15 * y, -17.5), 17, 18, 10));
  for (int i = 0; i < 8; ++i) {
    const double y = i < 4 ? -7 + 4.6 * i : -8 + 4.8 * (i - 4), z = i < 4 ? -11.5 : -16;
    tendons.parts.push_back(capsule(mm(-60, 1.45 * y, z), mm(60, y, z + 3.6), 2.6, 1.9));
  }
  EllipsoidPart carpus{mm(40, 2, -21), mm(12, 20, 8), {1, 0.2, 0.1}, {0, 1, -0.3}};
  TubePart artery{{{mm(-60, 16.5, -8), 1.4e-3}, {mm(0, 17.5, -6.5), 1.3e-3}, {mm(60, 18, -5.4), 1.2e-3}}};
  TubePart branch{{{mm(0, 17.5, -6.5), 0.9e-3}, {mm(20, 12, -5.5), 0.7e-3}}};
  spec.groups = {std::move(skin),
                 {"bone",
                  {capsule(mm(-60, 13, -21), mm(30, 14, -20), 6, 9),
                   capsule(mm(-60, -13, -22), mm(30, -14, -21), 5.5, 6.5),
                   {carpus, 4e-3}}},
                 std::move(tendons),
                 {"nerve",
                  {capsule(mm(-60, 3.6, -9), mm(60, 3.2, -5.4), 1.7, 1.6),
                   capsule(mm(-60, -14, -9.5), mm(60, -14, -7.4), 1.3, 1.2)}},
                 {"artery", {{artery, 0}, {branch, 1e-3}}},
                 {"distal", {halfSpace(mm(10, 0, 0), {-1, 0, 0})}}};
  for (const char* id : {"dermis", "fat", "fascia", "muscle", "tendon", "sheath", "nerve", "artery"})
    spec.structures.push_back(structure(id));
  spec.structures.push_back(structure("bone", true));
  spec.rules = {rule("bone", -kNoBound, 0, "bone"),
                rule("artery", -kNoBound, 0, "artery"),
                rule("nerve", -kNoBound, 0, "nerve"),
                rule("tendons", -kNoBound, 0, "tendon"),
                rule("tendons", 0, 0.4, "sheath", {{"distal", -kNoBound, 0}}),
                rule("skin", -1.3, 0, "dermis"),
                rule("skin", -3.6, -1.3, "fat"),
                rule("skin", -4.2, -3.6, "fascia")};
  spec.skin = "skin";
  spec.rest = "muscle";
  return spec;
}

/// A point in a box, in millimetres.
inline Vec3 randomPoint(Random& random, Vec3 low, Vec3 high) {
  const double x = random.in(low.x, high.x), y = random.in(low.y, high.y), z = random.in(low.z, high.z);
  return mm(x, y, z);
}

/// A line into the forearm from above; the same for the same seed.
struct Line {
  Vec3 from_m, axis;
};
inline Line randomLine(Random& random) {
  const double x = random.in(-20, 30), y = random.in(-18, 18);
  const double tilt_x = random.in(-0.8, 0.8), tilt_y = random.in(-0.8, 0.8);
  return {mm(x, y, 8), normalized(Vec3{tilt_x, tilt_y, -1})};
}

}  // namespace needlelab::test
