/// By how much a needle on the planned line misses in each of the twelve patients, against the structures
/// that stand at each place of the line (layerAt): no distance is asked.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "common/profile/profile.h"
#include "common/scoring/targets/miss.h"

namespace needlelab {
namespace {

constexpr double kLineStep_m = 2e-5, kOnLine_m = 5e-5, kLine_m = 0.12;

struct Stretch {
  double from_m, to_m;
};

/// A needle's line in a patient, from the skin on.
struct PatientLine {
  pb::Profile profile;
  Anatomy anatomy;
  NeedleWay way;
  std::vector<Stretch> reachable;  ///< of the target, up to the first hazard behind its near side
  double hazard_m = std::numeric_limits<double>::infinity();

  [[nodiscard]] Miss missAtLength(double length_m) const {
    NeedleWay to = way;
    to.length_m = length_m;
    return missAt(anatomy, profile.directions(), {}, to);
  }
  /// Along the line, from the nearest of the stretches.
  [[nodiscard]] double tooDeep(double length_m) const {
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const Stretch& s : reachable) {
      const double off_m = length_m > s.to_m ? length_m - s.to_m : std::min(0.0, length_m - s.from_m);
      if (std::abs(off_m) < std::abs(nearest_m)) nearest_m = off_m;
    }
    return nearest_m;
  }
};

std::string structureAt(const pb::Profile& profile, const Anatomy& anatomy, Vec3 p) {
  const int layer = layerAt(anatomy, p);
  return layer < 0 ? "" : profile.volume().structures(layer).id();
}

/// `aside_L_m`: the entry is moved by it.
PatientLine lineIn(const std::string& patient, Vec3 aside_L_m = {}) {
  PatientLine line;
  const std::string folder = NEEDLELAB_SAMPLES "/volumes/";
  auto profile = loadProfile(folder + patient + ".json");
  if (!profile) throw std::runtime_error(profile.error().message);
  line.profile = *profile;
  line.anatomy = anatomyOf(line.profile, {});
  const auto course = nlohmann::json::parse(*readWholeFile(folder + "bodies-curriculum.json", 1u << 20));
  const std::string region = patient.substr(0, patient.find('-'));
  Vec3 axis{0, 0, -1};
  for (const auto& exercise : course["exercises"]) {
    if (exercise["id"] != region + "-median") continue;
    const auto& d = exercise["plan"]["direction"];
    axis = normalized(Vec3{d["x"], d["y"], d["z"]});
  }
  Vec3 skin = aside_L_m - 0.03 * axis;
  for (double s = 0; s < kLine_m && layerAt(line.anatomy, skin) < 0; s += kLineStep_m)
    skin = skin + kLineStep_m * axis;
  line.way = {skin, axis, 0};
  const std::string wanted = line.profile.targets(0).structure();
  bool was_in = false;
  for (double s = 0; s < kLine_m; s += kLineStep_m) {
    const std::string here = structureAt(line.profile, line.anatomy, line.way.at(s));
    const auto isHere = [&](const pb::Hazard& hazard) { return hazard.structure() == here; };
    if (!line.reachable.empty() && std::ranges::any_of(line.profile.hazards(), isHere)) {
      line.hazard_m = s;
      break;
    }
    const bool in = here == wanted;
    if (in && !was_in) line.reachable.push_back({s, s});
    if (in) line.reachable.back().to_m = s;
    was_in = in;
  }
  return line;
}

class PatientMiss : public testing::TestWithParam<const char*> {};

TEST_P(PatientMiss, isTooShallowInAndTooDeepAlongThePlannedLine) {
  const PatientLine line = lineIn(GetParam());
  ASSERT_FALSE(line.reachable.empty()) << "the planned line meets the target";
  const Stretch target = line.reachable.front();
  for (const double before_m : {0.002, 0.01}) {
    const Miss miss = line.missAtLength(target.from_m - before_m);
    EXPECT_FALSE(miss.in_target);
    EXPECT_NEAR(miss.too_deep_m, -before_m, kOnLine_m);
    EXPECT_EQ(miss.aside_m, 0);
  }
  EXPECT_TRUE(line.missAtLength(0.5 * (target.from_m + target.to_m)).in_target);
  for (const double behind_m : {0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04}) {
    const double length_m = target.to_m + behind_m, expected_m = line.tooDeep(length_m);
    const Miss miss = line.missAtLength(length_m);
    EXPECT_EQ(miss.in_target, expected_m == 0) << behind_m;
    if (expected_m != 0) EXPECT_NEAR(miss.too_deep_m, expected_m, kOnLine_m) << behind_m;
    if (length_m > line.hazard_m + kOnLine_m) {
      EXPECT_THAT(miss.through, testing::Not(testing::IsEmpty()));
      EXPECT_GT(miss.too_deep_m, 0) << "from the hazard on it becomes only deeper";
    }
  }
}

// moved aside until it misses, and back by what the miss says
TEST_P(PatientMiss, asideIsTheWayBackToTheTarget) {
  int beside = 0;
  for (const Vec3 aside_L_m : {Vec3{0.02, 0, 0}, Vec3{0, -0.015, 0}, Vec3{0, 0.04, 0}}) {
    const PatientLine line = lineIn(GetParam(), aside_L_m);
    if (!line.reachable.empty() || layerAt(line.anatomy, line.way.skin_W_m) < 0) continue;
    NeedleWay way = line.way;
    way.length_m = 0.02;
    const OffTarget off = offTarget(line.anatomy, line.anatomy.targets[0], way);
    ASSERT_GT(off.aside_m, 0);
    const auto isInAt = [&](double back_m) {
      for (double deeper_m = -0.5e-3; deeper_m <= 0.5e-3; deeper_m += kLineStep_m) {
        const Vec3 p = way.at(way.length_m - off.too_deep_m + deeper_m) - back_m * off.aside_W;
        if (structureAt(line.profile, line.anatomy, p) == line.profile.targets(0).structure()) return true;
      }
      return false;
    };
    EXPECT_TRUE(isInAt(off.aside_m + 1e-4)) << off.aside_m;
    for (double back_m = 0; back_m < off.aside_m - 1e-4; back_m += 2e-4)
      EXPECT_FALSE(isInAt(back_m)) << back_m;
    ++beside;
  }
  EXPECT_GT(beside, 0);
}

INSTANTIATE_TEST_SUITE_P(Each, PatientMiss,
                         testing::Values("shoulder-slender", "shoulder-median", "shoulder-heavy",
                                         "wrist-slender", "wrist-median", "wrist-heavy", "knee-slender",
                                         "knee-median", "knee-heavy", "lumbar-slender", "lumbar-median",
                                         "lumbar-heavy"),
                         [](const auto& info) {
                           std::string name = info.param;
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

// case 68: the space lies at 48.2 to 54.2 mm, the dural sac behind it, and the space's front part behind that
TEST(LumbarMiss, behindTheDuraItBecomesOnlyDeeper) {
  const PatientLine line = lineIn("lumbar-median");
  ASSERT_EQ(line.reachable.size(), 1u);
  EXPECT_NEAR(line.reachable[0].from_m, 0.0482, 1e-4);
  EXPECT_NEAR(line.reachable[0].to_m, 0.0542, 1e-4);
  for (const double tip_m : {0.0636, 0.0703, 0.0751, 0.0848}) {
    const Miss miss = line.missAtLength(tip_m - 0.0015);  // at the opening
    EXPECT_NEAR(miss.too_deep_m, tip_m - 0.0015 - line.reachable[0].to_m, kOnLine_m);
    EXPECT_THAT(missText(miss), testing::StartsWith("Through the dural sac"));
  }
  EXPECT_EQ(structureAt(line.profile, line.anatomy, line.way.at(0.0688)), "epidural") << "its front part";
  EXPECT_FALSE(line.missAtLength(0.0688).in_target);
}

}  // namespace
}  // namespace needlelab
