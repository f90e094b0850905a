// A needle pushed sideways through tissue: the score contains the swept area and the cost.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "common/haptics/engine.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/measures/measures.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/stored_sample.h"

namespace needlelab::test {
namespace {

constexpr double kRate_hz = 1000, kDegree = 0.017453292519943295;

// goes from 50 mm before the target of shoulder-frail along `way` to it, with the needle pointing along
// `axis`
std::map<std::string, double> scoreOf(Vec3 way, Vec3 axis) {
  const auto profile = loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / "shoulder-frail.json");
  const auto model = compile(*sceneSpecOf(*profile), kRate_hz);
  const Vec3 target_m{0, 0, -0.015};
  MotionBuilder hand(kRate_hz, target_m - way * 0.05, axis);
  const Motion motion = hand.slideTo(target_m, 0.02).take();
  const auto state = std::make_unique<SimState>();
  std::vector<GestureSample> samples;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    StepReport report;
    step(*model, motion[k], *state, report);
    samples.push_back(storedSample(k, motion[k], report));
  }
  std::map<std::string, double> values;
  for (const Measure& row : scoreGesture(samples, kRate_hz, *profile, Pose{})) values[row.name] = row.value;
  return values;
}

TEST(SweptAside, countsAsDamageAndAsWorkOfTheFixture) {
  const double slant = 35 * kDegree, length_m = 0.015 / std::cos(slant);
  const Vec3 way{-std::sin(slant), 0, -std::cos(slant)}, across{std::cos(slant), 0, -std::sin(slant)};
  auto straight = scoreOf({0, 0, -1}, {0, 0, -1});
  auto sideways = scoreOf(way, across);
  EXPECT_NEAR(straight["tissue_damage_m2"], 0, 1e-7);
  EXPECT_NEAR(straight["clamping_work_j"], 0, 1e-6);
  // near the skin the hole is dragged along, so a fifth of the triangle is missing
  const double triangle_m2 = 0.5 * length_m * length_m;
  EXPECT_NEAR(sideways["greatest_insertion_m"], length_m, 0.1 * length_m);
  EXPECT_NEAR(sideways["tissue_damage_m2"], triangle_m2, 0.2 * triangle_m2);
  EXPECT_GT(sideways["clamping_work_j"], 1e-3);
}

}  // namespace
}  // namespace needlelab::test
