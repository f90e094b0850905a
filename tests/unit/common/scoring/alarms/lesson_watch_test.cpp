#include "common/scoring/alarms/lesson_watch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

/// Goes down to `depth_m` in a second and back up, with a force of 1 N per centimetre.
std::vector<GestureSample> downAndUp(double depth_m) {
  return gesture(1000, 2, [&](double t, GestureSample& sample) {
    const double depth = -0.005 + (depth_m + 0.005) * (1 - std::abs(t - 1));
    setDepth(sample, depth);
    sample.force_W_N[2] = 100 * std::max(0.0, depth);
  });
}

TEST(LessonWatch, matchesTheFinalScoreAtEachMoment) {
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "nerve", {0, 0, -0.015}, 0.001);
  addBallHazard(profile, "vessel", {0, 0, -0.024}, 0.001);
  addBallHazard(profile, "far away", {0.05, 0, -0.015}, 0.001);
  const auto samples = downAndUp(0.02);
  LessonWatch watch(profile, {});
  std::vector<std::size_t> when;  // samples at which the number of hazards grew
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::size_t before = watch.hazardsTouched().size();
    watch.add({&samples[i], 1});
    if (watch.hazardsTouched().size() != before) when.push_back(i);
  }
  // the tip reaches the nerve's upper edge at 14 mm: (14 + 5)/25 of a second
  ASSERT_EQ(when.size(), 1u);
  EXPECT_NEAR(static_cast<double>(when[0]), 1000 * 19.0 / 25.0, 1);
  EXPECT_EQ(watch.hazardsTouched(), std::vector<std::string>{"nerve"});
  EXPECT_NEAR(watch.peakForce_N(), 2, 1e-9);

  const auto rows = scoreGesture(samples, 1000, profile, {});
  const auto value = [&](const std::string& name) {
    const auto found =
        std::find_if(rows.begin(), rows.end(), [&](const Measure& m) { return m.name == name; });
    return found == rows.end() ? std::numeric_limits<double>::quiet_NaN() : found->value;
  };
  EXPECT_DOUBLE_EQ(value("hazards_touched"), 1);
  EXPECT_NEAR(value("peak_force_n"), watch.peakForce_N(), 1e-9);
}

TEST(LessonWatch, warnsOfBoneOnceWhereTheTipComesIntoIt) {
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "nerve", {0, 0, -0.015}, 0.001);
  addBallHazard(profile, "vessel", {0, 0, -0.025}, 0.001);
  auto samples = downAndUp(0.027);
  const auto again = samples;
  samples.insert(samples.end(), again.begin(), again.end());
  LessonWatch watch(profile, {});
  std::vector<std::size_t> when;  // samples at which the number of warnings grew
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::size_t before = watch.warnings().size();
    watch.add({&samples[i], 1});
    if (watch.warnings().size() != before) when.push_back(i);
  }
  EXPECT_EQ(watch.warnings(), (std::vector<std::string>{"nerve", "bone contact", "vessel"}));
  // at 14, 20 and 24 mm, of 32 mm in a second from 5 mm above
  ASSERT_EQ(when.size(), 3u);
  EXPECT_NEAR(static_cast<double>(when[0]), 1000 * 19.0 / 32.0, 1);
  EXPECT_NEAR(static_cast<double>(when[1]), 1000 * 25.0 / 32.0, 1);
  EXPECT_NEAR(static_cast<double>(when[2]), 1000 * 29.0 / 32.0, 1);
  EXPECT_EQ(watch.hazardsTouched(), (std::vector<std::string>{"nerve", "vessel"})) << "bone is distinguished";
}

TEST(LessonWatch, warnsOnceWhereTheHubComesOntoTheSkin) {
  // a needle of 18 mm, inserted 19.9 mm deep, twice
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "nerve", {0, 0, -0.015}, 0.001);
  auto samples = downAndUp(0.0199);
  const auto again = samples;
  samples.insert(samples.end(), again.begin(), again.end());
  LessonWatch watch(profile, {});
  std::optional<std::size_t> when;  // sample of the second warning
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i].insertion_m > 0.018) samples[i].flags |= kFlagBeyondNeedle;
    watch.add({&samples[i], 1});
    if (!when && watch.warnings().size() == 2) when = i;
  }
  EXPECT_EQ(watch.warnings(), (std::vector<std::string>{"nerve", "hub on the skin"}));
  EXPECT_EQ(watch.hazardsTouched(), std::vector<std::string>{"nerve"}) << "the hub is distinguished";
  ASSERT_TRUE(when);
  EXPECT_NEAR(static_cast<double>(*when), 1000 * 23.0 / 24.9, 1);
}

TEST(LessonWatch, theShaftTouchesToo) {
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "vessel", {0, 0.0005, -0.004}, 0.001);
  LessonWatch watch(profile, {});
  // enters beside it in one step: only the shaft is close
  GestureSample sample;
  setDown(sample);
  setDepth(sample, 0.02);
  watch.add({&sample, 1});
  EXPECT_EQ(watch.hazardsTouched().size(), 1u);
}

TEST(LessonWatch, theLayerHasItsNameAndOutsideHasNone) {
  pb::Profile profile = halfSpace();
  profile.mutable_layers(1)->set_name("Deltoid muscle");
  LessonWatch watch(profile, {});
  GestureSample sample;
  setDown(sample);
  const auto at = [&](double depth_m) {
    setDepth(sample, depth_m);
    watch.add({&sample, 1});
    return watch.layerName();
  };
  EXPECT_EQ(at(-0.01), "");
  EXPECT_EQ(at(0.005), "skin");
  EXPECT_EQ(at(0.015), "Deltoid muscle");
  EXPECT_EQ(at(0.025), "bone");
  sample.layer = 100;  // no layer of this profile
  watch.add({&sample, 1});
  EXPECT_EQ(watch.layerName(), "");
}

TEST(LessonWatch, theLimitIsTheExercisesOwn) {
  pb::Exercise exercise;
  exercise.add_requirements()->set_measure("entries");
  EXPECT_EQ(LessonWatch(halfSpace(), {}, &exercise).forceLimit_N(), 0);
  auto& force = *exercise.add_requirements();
  force.set_measure("peak_force_n");
  force.set_max(4.5);
  EXPECT_EQ(LessonWatch(halfSpace(), {}, &exercise).forceLimit_N(), 4.5);
  EXPECT_EQ(LessonWatch(halfSpace(), {}).forceLimit_N(), 0);
}

TEST(LessonWatch, whatIsNotFiniteIsPassedOver) {
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "nerve", {0, 0, -0.005}, 0.001);
  LessonWatch watch(profile, {});
  GestureSample sample;
  setDown(sample);
  setDepth(sample, 0.005);
  sample.p_WT_m[2] = std::numeric_limits<double>::quiet_NaN();
  sample.force_W_N[0] = std::numeric_limits<double>::infinity();
  watch.add({&sample, 1});
  setDepth(sample, 0.005);
  sample.q_WT[0] = sample.q_WT[1] = sample.q_WT[2] = sample.q_WT[3] = 0;
  watch.add({&sample, 1});
  EXPECT_TRUE(watch.hazardsTouched().empty());
  EXPECT_EQ(watch.peakForce_N(), 0);
}

}  // namespace
}  // namespace needlelab
