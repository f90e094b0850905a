// No needle comes out of a bone on its other side: a hand that leans on a vertebra stays in its near half.
#include <gtest/gtest.h>

#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::patients_in_body::far_wall {
namespace {

struct Wall {
  Line line;
  double bone_m = 0, far_m = 0;
  bool sticks = false;  ///< the needle is within the cone of friction of the bone's surface there
};

constexpr double kLeast_m = 0.0146;  // in half of this the bone holds 22 mm of the hand's spring
constexpr double kAbove_m = 0.008, kInto_m = 0.022;

double cosineAt(const Patient& patient, Vec3 p_m, Vec3 axis) {
  constexpr double h = 1e-5;
  const auto d = [&](Vec3 by) { return patient.fromBone(p_m + by) - patient.fromBone(p_m - by); };
  return -dot(normalized(Vec3{d({h, 0, 0}), d({0, h, 0}), d({0, 0, h})}), axis);
}

// bone of L3 or L4, within the needle's reach
std::optional<Wall> wallAlong(const Patient& patient, const Line& line, double most_rad) {
  Wall wall{.line = line};
  bool is_vertebra = false;
  const double most_m = patient.scene.needle_length_m + 0.01;
  for (const Stretch& one : sampled(patient, line, 1e-5, most_m, 5e-5)) {
    const bool is_bone = patient.isBone(one.structure);
    if (!is_bone && (wall.far_m > 0 || one.structure == kOutside)) break;
    if (!is_bone) continue;
    if (wall.far_m == 0) {
      wall.bone_m = one.from_m;
      is_vertebra = patient.id(one.structure) == "l3" || patient.id(one.structure) == "l4";
    }
    wall.far_m = one.to_m;
  }
  const double thick_m = wall.far_m - wall.bone_m;
  if (!is_vertebra || thick_m < kLeast_m || thick_m > 0.022 || wall.bone_m < 0.015 ||
      wall.bone_m + kInto_m + 1e-3 > patient.scene.needle_length_m ||
      cosineAt(patient, line.at(wall.bone_m), line.axis) < std::cos(most_rad))
    return std::nullopt;
  wall.sticks = cosineAt(patient, line.at(wall.bone_m), line.axis) > std::cos(0.25);  // atan 0.3 = 0.29
  return wall;
}

// a line about 15 mm aside of the midline, and seven beside it
std::vector<Wall> wallsOf(const Patient& patient, std::size_t wanted) {
  test::Random random(691);
  std::vector<Wall> walls;
  for (int tries = 0; tries < 20'000 && walls.size() < wanted; ++tries) {
    const auto line = randomLine(patient, random, 0.03, 0.5);
    if (!line || std::fabs(std::fabs(line->origin_m.x) - 0.015) > 0.005) continue;
    const auto wall = wallAlong(patient, *line, 0.6);
    if (!wall) continue;
    for (int i = -3; i <= 3 && walls.size() < wanted; ++i) {
      // they begin in the air, where the middle one enters
      const Line beside{line->origin_m + Vec3{0, 0.002 * i, 0}, line->axis};
      if (i == 0 || patient.field().skinDistance(beside.at(-0.003)) > 0)
        if (const auto next = i == 0 ? wall : wallAlong(patient, beside, 0.6)) walls.push_back(*next);
    }
  }
  return walls;
}

// the hand wants to go from 8 mm above the bone to 22 mm beyond its surface, as from 47 to 77 mm. Where the
// surface is slanted by more than friction holds, the tip may slide off the bone, but not into it
TEST(FarWall, aHandThatLeansOnAVertebraStaysInItsNearHalf) {
  int stuck = 0;
  for (const Patient& patient : patients()) {
    if (!patient.name.starts_with("lumbar")) continue;
    const std::size_t wanted = test::longForm() ? 80 : 12;
    const auto walls = wallsOf(patient, wanted);
    EXPECT_EQ(walls.size(), wanted) << patient.name << ": too few lines through a vertebra";
    Share stays, held, near, out;
    double deepest_m = 0, off_m = 0;
    for (const Wall& wall : walls)
      for (const double speed_mps : {0.02, 0.05}) {
        Needle needle(patient);
        needle.rest(wall.line.at(-0.008), wall.line.axis);
        needle.to(wall.line.at(wall.bone_m - kAbove_m), 0.05);
        Hand hand{.place_m = needle.tip(), .speed_mps = wall.line.axis * speed_mps};
        const double half_m = 0.5 * (wall.far_m - wall.bone_m);
        double in_m = -1, proxy_m = 0;
        Share contact;
        for (int k = 0, rest = 0; rest < 300; ++k) {
          const double want_m = std::min(kInto_m, -kAbove_m + k * speed_mps / kRate_hz);
          rest += want_m == kInto_m;
          hand.tick(wall.line.at(wall.bone_m + want_m), needle.report().wrench_W.force_N);
          needle.at(hand.place_m, wall.line.axis);
          in_m = std::max(in_m, dot(needle.tip() - wall.line.origin_m, wall.line.axis) - wall.bone_m);
          const BoneContact& bone = needle.state().bone;
          if (patient.fromBone(needle.tip()) < -0.5e-3) contact.count(bone.touching);
          if (bone.touching) proxy_m = std::max(proxy_m, std::fabs(patient.fromBone(bone.p_proxy_W_m)));
        }
        held.count(contact.right == contact.all);
        near.count(proxy_m <= 0.5e-3);
        off_m = std::max(off_m, proxy_m);
        const double bone_from_mm = 1e3 * wall.bone_m;
        EXPECT_EQ(contact.right, contact.all)
            << patient.name << ", bone from " << bone_from_mm << " mm: ticks in bone without contact";
        EXPECT_LE(proxy_m, 0.5e-3) << patient.name << ", bone from " << bone_from_mm
                                   << " mm: the proxy is off the bone";
        out.count(in_m > 2 * half_m);
        if (!wall.sticks) continue;
        ++stuck;
        stays.count(in_m < half_m);
        deepest_m = std::max(deepest_m, in_m);
        EXPECT_LT(in_m, half_m) << patient.name << ", bone from " << bone_from_mm << " mm: past its middle";
      }
    std::printf(
        "far wall: %-14s %ld of %ld steep hands stay in the near half (deepest %.1f mm), all hands: %ld of %ld are held while in bone, proxy on bone in %ld (worst %.2f mm), %ld come out behind it\n",
        patient.name.c_str(), stays.right, stays.all, 1e3 * deepest_m, held.right, held.all, near.right,
        1e3 * off_m, out.right);
  }
  EXPECT_GE(stuck, 12) << "steep lines";
}

}  // namespace
}  // namespace needlelab::patients_in_body::far_wall
