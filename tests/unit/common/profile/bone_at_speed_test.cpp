// Bone is where bone is, at every speed: none beside it, no way through it, and a tip that slides on it stays
// on its surface.
#include <gtest/gtest.h>

#include <map>
#include <numbers>
#include <utility>

#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::patients_in_body::bone_at_speed {
namespace {

constexpr double kSpeeds_mps[] = {0.02, 0.05, 0.1, 0.2, 0.5};
constexpr double kBoneOff_m = 0.5e-3;  // a tip is in bone or beside it from here on

// a line through tissue only, more than 0.5 mm off any bone: its size is at most √1.25 times the distance
std::optional<double> endBesideBone(const Patient& patient, const Line& line, double& nearest_m) {
  constexpr double kStep_m = 2e-4, kOff_m = kMostSteep * (kBoneOff_m + 0.5 * kStep_m);
  const double most_m = 0.95 * patient.scene.needle_length_m;
  nearest_m = 1;
  double s_m = -0.012;
  for (; s_m < most_m; s_m += kStep_m) {
    const double here_m = patient.fromBone(line.at(s_m));
    if (here_m < kOff_m) return std::nullopt;
    nearest_m = std::min(nearest_m, here_m);
    if (s_m > 0.005 && patient.field().skinDistance(line.at(s_m)) > -1e-3) break;
  }
  if (s_m < 0.01) return std::nullopt;
  return s_m - 2e-3;
}

TEST(BoneAtSpeed, besideABoneThereIsNoneAtAnySpeed) {
  const int wanted = test::longForm() ? 36 : 5;
  for (const Patient& patient : patients()) {
    test::Random random(621);
    int lines = 0;
    long touched[5] = {};
    double worst_N[5] = {};
    for (int tries = 0; tries < 20'000 && lines < wanted; ++tries) {
      const auto line = randomLine(patient, random, 0.035, 0.7);
      double nearest_m = 0;
      const auto end_m = line ? endBesideBone(patient, *line, nearest_m) : std::nullopt;
      if (!end_m || nearest_m > 0.012) continue;  // others have no bone to be beside of
      ++lines;
      const double above_m = random.in(0.006, 0.010);
      for (int i = test::longForm() || lines == 1 ? 0 : 1; i < 5; ++i) {
        Needle needle(patient);
        needle.rest(line->at(-above_m), line->axis);
        double most_N = 0;
        const auto each = [&](const StepReport&) { most_N = std::max(most_N, needle.bone_N()); };
        needle.to(line->at(*end_m), kSpeeds_mps[i], each);
        needle.to(line->at(-above_m), kSpeeds_mps[i], each);
        touched[i] += most_N > 0;
        worst_N[i] = std::max(worst_N[i], most_N);
      }
    }
    EXPECT_EQ(lines, wanted) << patient.name << ": too few lines beside a bone";
    std::printf(
        "beside bone: %-16s %d lines, pressed by bone at 20, 50, 100, 200, 500 mm/s: %ld %ld %ld %ld %ld (up to %.2f %.2f %.2f %.2f %.2f N)\n",
        patient.name.c_str(), lines, touched[0], touched[1], touched[2], touched[3], touched[4], worst_N[0],
        worst_N[1], worst_N[2], worst_N[3], worst_N[4]);
    for (int i = 0; i < 5; ++i)
      EXPECT_EQ(worst_N[i], 0) << patient.name << ", " << kSpeeds_mps[i] << " m/s: bone where there is none";
  }
}

struct Thrust {
  Line line;
  double bone_m = 0, far_m = 0;  ///< where bone begins and ends
};

Vec3 boneNormal(const Patient& patient, Vec3 p_m) {
  constexpr double h = 1e-5;
  const auto d = [&](Vec3 by) { return patient.fromBone(p_m + by) - patient.fromBone(p_m - by); };
  return normalized(Vec3{d({h, 0, 0}), d({0, h, 0}), d({0, 0, h})});
}

// within 40 degrees of the bone's normal, 8 mm of bone, and tissue of at least 4 mm above it
std::optional<Thrust> thrustAlong(const Patient& patient, const Line& line) {
  Thrust thrust{.line = line};
  for (const Stretch& one : sampled(patient, line, 1e-5, 0.9 * patient.scene.needle_length_m, 5e-5)) {
    if (!patient.isBone(one.structure)) {
      if (thrust.far_m > 0 || one.structure == kOutside) break;
      continue;
    }
    if (thrust.far_m == 0) thrust.bone_m = one.from_m;
    thrust.far_m = one.to_m;
  }
  if (thrust.far_m - thrust.bone_m < 0.008 || thrust.bone_m < 0.004) return std::nullopt;
  // not beside a bone's side, where a hand may go round
  double most_m = 0;
  for (double s_m = thrust.bone_m; s_m < thrust.far_m; s_m += 2e-4)
    most_m = std::max(most_m, -patient.fromBone(line.at(s_m)));
  if (most_m < 0.0025) return std::nullopt;
  const double cosine = -dot(boneNormal(patient, line.at(thrust.bone_m)), line.axis);
  if (cosine < std::cos(40 * std::numbers::pi / 180)) return std::nullopt;
  return thrust;
}

// found once
const std::vector<Thrust>& thrustsOf(const Patient& patient, int wanted, std::uint64_t seed) {
  static std::map<std::pair<std::string, std::uint64_t>, std::vector<Thrust>> all;
  std::vector<Thrust>& found = all[{patient.name, seed}];
  if (!found.empty()) return found;
  test::Random random(seed);
  for (int tries = 0; tries < 20'000 && static_cast<int>(found.size()) < wanted; ++tries)
    if (const auto line = randomLine(patient, random, 0.035, 0.7))
      if (const auto thrust = thrustAlong(patient, *line)) found.push_back(*thrust);
  EXPECT_EQ(static_cast<int>(found.size()), wanted) << patient.name << ": too few lines onto bone";
  return found;
}

// of a contact, over its ticks
struct Contact {
  Share held;            // ticks in bone that have contact
  double proxy_m = 0;    // the proxy's greatest distance from the bone's surface
  Share strong;          // ticks in bone whose force is at least the spring's over the depth there
  bool is_over = false;  // after withdrawal

  void tick(const Patient& patient, const Needle& needle) {
    const double in_m = -patient.fromBone(needle.tip());
    const BoneContact& bone = needle.state().bone;
    if (in_m > kBoneOff_m) {
      held.count(bone.touching);
      // the field's size is at most √1.25 times the depth; the sum is capped, the term is not
      const double spring_N =
          patient.scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] * in_m / kMostSteep;
      strong.count(needle.bone_N() >= std::min(0.95 * spring_N - 0.02, 0.95 * patient.scene.max_force_N));
    }
    // a tip that is out again has a proxy on its way to it
    if (bone.touching && in_m > 0) proxy_m = std::max(proxy_m, std::fabs(patient.fromBone(bone.p_proxy_W_m)));
  }
};

// prescribed tips, 4 mm into the bone and out again
TEST(BoneAtSpeed, aThrustOntoBoneIsHeldByItsSurface) {
  const int wanted = test::longForm() ? 17 : 2;  // of each of twelve patients
  for (const double speed_mps : kSpeeds_mps) {
    Share held, strong, over, near;
    double proxy_m = 0;
    for (const Patient& patient : patients())
      for (const Thrust& thrust : thrustsOf(patient, wanted, 631)) {
        Needle needle(patient);
        Contact contact;
        const auto each = [&](const StepReport&) { contact.tick(patient, needle); };
        needle.rest(thrust.line.at(-0.008), thrust.line.axis);
        const double quick_m = std::max(-0.008, thrust.bone_m - 0.04);
        needle.to(thrust.line.at(quick_m), speed_mps);
        needle.to(thrust.line.at(thrust.bone_m + 0.004), speed_mps, each);
        needle.to(thrust.line.at(thrust.bone_m - 0.003), speed_mps, each);
        needle.rest(thrust.line.at(thrust.bone_m - 0.003), thrust.line.axis, 20);
        over.count(!needle.state().bone.touching || patient.fromBone(needle.tip()) <= 1e-3);
        held.right += contact.held.right, held.all += contact.held.all;
        strong.right += contact.strong.right, strong.all += contact.strong.all;
        near.count(contact.proxy_m <= 0.5e-3);
        proxy_m = std::max(proxy_m, contact.proxy_m);
        EXPECT_EQ(contact.held.right, contact.held.all)
            << patient.name << ", " << speed_mps << " m/s: in bone without contact";
        EXPECT_EQ(contact.strong.right, contact.strong.all)
            << patient.name << ", " << speed_mps << " m/s: weaker than the bone's spring over the depth";
        EXPECT_LE(contact.proxy_m, 0.5e-3)
            << patient.name << ", " << speed_mps << " m/s: the proxy is off the bone";
      }
    std::printf(
        "thrust, %3.0f mm/s: held in %.2f %% of %ld ticks in bone, strong in %.2f %%, proxy on bone in %ld of %ld (worst %.2f mm), over in %ld of %ld\n",
        1e3 * speed_mps, held.percent(), held.all, strong.percent(), near.right, near.all, 1e3 * proxy_m,
        over.right, over.all);
    EXPECT_EQ(over.right, over.all) << speed_mps << " m/s: contact 3 mm off the bone";
  }
}

TEST(BoneAtSpeed, aHandIsStoppedByBone) {
  const int wanted = test::longForm() ? 17 : 2;
  for (const double speed_mps : kSpeeds_mps) {
    Share stopped, held, near;
    double proxy_m = 0, deepest_m = 0;
    for (const Patient& patient : patients())
      for (const Thrust& thrust : thrustsOf(patient, wanted, 632)) {
        Needle needle(patient);
        Contact contact;
        needle.rest(thrust.line.at(-0.008), thrust.line.axis);
        Hand hand{.place_m = needle.tip(), .speed_mps = {}};
        // the hand wants to be 8 mm in the bone, and stays there for 0.4 s
        const double to_m = thrust.bone_m + 0.008, step_m = speed_mps / kRate_hz;
        for (int k = 0, rest = 0; rest < 400; ++k) {
          const double want_m = std::min(to_m, -0.008 + step_m * k);
          rest += want_m == to_m;
          hand.tick(thrust.line.at(want_m), needle.report().wrench_W.force_N);
          needle.at(hand.place_m, thrust.line.axis);
          contact.tick(patient, needle);
        }
        const double in_m = dot(needle.tip() - thrust.line.origin_m, thrust.line.axis) - thrust.bone_m;
        deepest_m = std::max(deepest_m, in_m);
        // not there where it wants to be: before it, or, where the bone pushed it aside, well nearer to the
        // surface
        const bool aside = patient.fromBone(needle.tip()) > 0.75 * patient.fromBone(thrust.line.at(to_m));
        stopped.count((in_m < 0.008 || aside) && contact.held.right == contact.held.all);
        held.right += contact.held.right, held.all += contact.held.all;
        near.count(contact.proxy_m <= 0.5e-3);
        proxy_m = std::max(proxy_m, contact.proxy_m);
        EXPECT_EQ(contact.held.right, contact.held.all)
            << patient.name << ", " << speed_mps << " m/s: in bone without contact";
        EXPECT_EQ(contact.strong.right, contact.strong.all)
            << patient.name << ", " << speed_mps << " m/s: weaker than the bone's spring over the depth";
        EXPECT_LE(contact.proxy_m, 0.5e-3)
            << patient.name << ", " << speed_mps << " m/s: the proxy is off the bone";
      }
    std::printf(
        "hand onto bone, %3.0f mm/s: %ld of %ld stopped (deepest at rest %.1f mm), held in %.2f %% of %ld ticks in bone, proxy on bone in %ld of %ld (worst %.2f mm)\n",
        1e3 * speed_mps, stopped.right, stopped.all, 1e3 * deepest_m, held.percent(), held.all, near.right,
        near.all, 1e3 * proxy_m);
    EXPECT_GE(stopped.percent(), 99) << speed_mps << " m/s: a hand went through bone";
  }
}

// the place 1 mm below the bone's surface nearest to a place
Vec3 below(const Patient& patient, Vec3 p_m) {
  for (int i = 0; i < 2; ++i) p_m = p_m - boneNormal(patient, p_m) * (patient.fromBone(p_m) + 1e-3);
  return p_m;
}

TEST(BoneAtSpeed, aTipThatSlidesInBoneStaysInContact) {
  const int wanted = test::longForm() ? 17 : 2;
  constexpr double kSlide_m = 0.010;
  for (const double speed_mps : {0.02, 0.05, 0.1, 0.2}) {
    Share held, near;
    double proxy_m = 0;
    int slides = 0;
    test::Random random(641);
    for (const Patient& patient : patients())
      for (const Thrust& thrust : thrustsOf(patient, wanted, 633)) {
        Needle needle(patient);
        Contact contact;
        needle.rest(thrust.line.at(-0.008), thrust.line.axis);
        needle.to(below(patient, thrust.line.at(thrust.bone_m + 1e-3)), 0.05);
        Vec3 along =
            normalized(cross(thrust.line.axis, {random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)}));
        double way_m = 0;
        for (; way_m < kSlide_m; way_m += speed_mps / kRate_hz) {
          const Vec3 normal = boneNormal(patient, needle.tip());
          if (norm(along - normal * dot(along, normal)) < 0.3) break;  // an edge of the bone
          along = normalized(along - normal * dot(along, normal));
          const Vec3 next = below(patient, needle.tip() + along * (speed_mps / kRate_hz));
          // the bone comes near the skin, is thinner than 2 mm, or has an edge or another bone at it
          if (patient.body->depth(next) < 0.004 || dot(boneNormal(patient, next), normal) < 0.9 ||
              std::fabs(patient.fromBone(next) + 1e-3) > 5e-5 ||
              norm(next - needle.tip()) > 1.5 * speed_mps / kRate_hz)
            break;
          needle.at(next, thrust.line.axis);
          contact.tick(patient, needle);
        }
        slides += way_m > 0.003;
        held.right += contact.held.right, held.all += contact.held.all;
        near.count(contact.proxy_m <= 0.5e-3);
        proxy_m = std::max(proxy_m, contact.proxy_m);
      }
    std::printf(
        "slide in bone, %3.0f mm/s: %d slides, held in %.2f %% of %ld ticks, proxy on bone in %ld of %ld (worst %.2f mm)\n",
        1e3 * speed_mps, slides, held.percent(), held.all, near.right, near.all, 1e3 * proxy_m);
    EXPECT_GE(slides, 8 * wanted) << "slides of more than 3 mm";
    EXPECT_GE(held.percent(), 99) << speed_mps << " m/s: a sliding tip loses its contact";
    EXPECT_EQ(near.right, near.all) << speed_mps << " m/s: the proxy is off the bone";
  }
}

}  // namespace
}  // namespace needlelab::patients_in_body::bone_at_speed
