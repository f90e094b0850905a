/// Scores and events in a volume whose rules are the shells of a ball: those of the ball with these layers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <stdexcept>
#include <string_view>

#include "common/profile/profile.h"
#include "common/scoring/alarms/lesson_watch.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/measures/syringe_events.h"
#include "tests/support/anatomy/ball_profiles.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

constexpr double kGestureRate_hz = 200;

/// In at a slant past the nerve's place and the target, with an injection, and out again. The layer is the
/// one at the tip, as the engine reports it.
std::vector<GestureSample> slantedInjection(const Anatomy& anatomy) {
  const Vec3 entry{-0.002, 0.004, -0.0001}, axis = normalized(Vec3{0.2, -0.1, -1});
  return gesture(kGestureRate_hz, 8, [&](double t, GestureSample& sample) {
    const double way_m = 0.03 * (t < 3 ? t / 3 : t < 5 ? 1 : (8 - t) / 3) - 0.008;
    const Vec3 tip = entry + axis * way_m;
    setTip(sample, tip);
    const double turn = std::sqrt(axis.x * axis.x + axis.y * axis.y);
    // from +z to the axis, about z × axis
    const double angle = std::acos(axis.z);
    sample.q_WT[0] = -axis.y / turn * std::sin(0.5 * angle);
    sample.q_WT[1] = axis.x / turn * std::sin(0.5 * angle);
    sample.q_WT[2] = 0;
    sample.q_WT[3] = std::cos(0.5 * angle);
    sample.layer = static_cast<std::int8_t>(layerAt(anatomy, tip));
    const bool inside = sample.layer >= 0;
    sample.insertion_m = inside ? std::max(0.0, way_m) : 0;
    sample.phase = static_cast<std::uint8_t>(inside ? Phase::kInserting : Phase::kFree);
    sample.force_W_N[2] = inside ? 1 + 30 * way_m : 0;
    sample.plunger = t < 3.5 ? 0 : t < 4.5 ? t - 3.5 : 1;
  });
}

pb::Exercise plannedExercise() {
  auto exercise = parseExercise(R"({"id": "one", "name": "One", "profile_id": "ball",
    "plan": {"frame": "LIMB", "entry_m": {"x": 0, "y": 0, "z": 0}, "target_m": {"x": 0.004, "y": 0, "z": -0.015}}})",
                                "exercise");
  if (!exercise.ok()) throw std::runtime_error(exercise.error().message);
  return *std::move(exercise);
}

TEST(VolumeScores, ofShellsAreThoseOfTheBallOfLayers) {
  const pb::Profile of_layers = test::readProfile(test::ballOfLayers()),
                    of_rules = test::readProfile(test::ballOfRules());
  const std::vector<GestureSample> samples = slantedInjection(anatomyOf(of_rules, {}));
  const pb::Exercise exercise = plannedExercise();
  const std::vector<Measure> expected = scoreGesture(samples, kGestureRate_hz, of_layers, {}, &exercise);
  const std::vector<Measure> found = scoreGesture(samples, kGestureRate_hz, of_rules, {}, &exercise);
  ASSERT_EQ(found.size(), expected.size());
  ASSERT_GT(found.size(), 20U);
  bool in_fat = false, planned = false;
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].name, expected[i].name);
    EXPECT_EQ(found[i].words, expected[i].words);
    EXPECT_NEAR(found[i].value, expected[i].value, 2e-7) << found[i].name;
    in_fat = in_fat || found[i].words.find("eak force in fat") != std::string::npos;
    planned = planned || (found[i].name == "planned_entry_error_m");
  }
  EXPECT_TRUE(in_fat) << "a layer's measure has the structure's name";
  EXPECT_TRUE(planned);
}

TEST(VolumeScores, anInjectionIsWhereItIsInTheBallOfLayers) {
  const pb::Profile of_layers = test::readProfile(test::ballOfLayers()),
                    of_rules = test::readProfile(test::ballOfRules());
  const std::vector<GestureSample> samples = slantedInjection(anatomyOf(of_rules, {}));
  const auto expected = syringeEvents(samples, kGestureRate_hz, of_layers, {}),
             found = syringeEvents(samples, kGestureRate_hz, of_rules, {});
  ASSERT_EQ(found.size(), expected.size());
  ASSERT_FALSE(found.empty());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const pb::SyringePlace &place = found[i].begin(), &like = expected[i].begin();
    EXPECT_EQ(found[i].kind(), expected[i].kind());
    EXPECT_EQ(place.layer(), like.layer());
    EXPECT_EQ(place.layer_name(), "muscle");
    EXPECT_EQ(place.tissue(), like.tissue());
    EXPECT_NEAR(place.depth_m(), like.depth_m(), 1e-12);
    EXPECT_NEAR(place.target_distance_m(), like.target_distance_m(), 1e-12);
  }
}

// straight in at the origin, where the lumbar spine's skin is flat: as deep as the way is long
TEST(VolumeScores, greatestDepthInTheLumbarSpineIsTheWay) {
  const auto profile =
      loadProfile(std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "db/samples/volumes/lumbar-median.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const Anatomy anatomy = anatomyOf(*profile, {});
  const auto samples = gesture(kGestureRate_hz, 3, [&](double t, GestureSample& sample) {
    const Vec3 tip{0, 0, 0.005 - 0.055 * std::sin(std::numbers::pi * t / 3)};
    setTip(sample, tip);
    sample.layer = static_cast<std::int8_t>(layerAt(anatomy, tip));
    sample.insertion_m = std::max(0.0, -tip.z);
    sample.phase = static_cast<std::uint8_t>(sample.layer >= 0 ? Phase::kInserting : Phase::kFree);
  });
  const auto measures = scoreGesture(samples, kGestureRate_hz, *profile, {});
  const auto row = std::ranges::find(measures, "greatest_depth_m", &Measure::name);
  ASSERT_NE(row, measures.end());
  EXPECT_NEAR(row->value, 0.05, 2e-4);
}

TEST(VolumeScores, aStructureIsTouchedAndReachedByItsOwnSurface) {
  const pb::Profile profile = test::readProfile(test::withCyst());
  const Anatomy anatomy = anatomyOf(profile, {});
  // past the cyst at 1 mm less and 1 mm more than its radius: only the first one touches it
  for (const double beside_m : {test::kCystRadius_m - 1e-3, test::kCystRadius_m + 1e-3}) {
    const bool touches = beside_m < test::kCystRadius_m;
    const auto samples = gesture(kGestureRate_hz, 4, [&](double t, GestureSample& sample) {
      const Vec3 tip{test::kCyst_m.x + beside_m, test::kCyst_m.y, 0.005 - 0.01 * t};
      setTip(sample, tip);
      sample.layer = static_cast<std::int8_t>(layerAt(anatomy, tip));
      const bool inside = sample.layer >= 0;
      sample.insertion_m = std::max(0.0, depthAt(anatomy, tip));
      sample.phase = static_cast<std::uint8_t>(inside ? Phase::kInserting : Phase::kFree);
    });
    pb::Exercise exercise;
    exercise.set_target_dwell_s(0.1);
    const auto measures = scoreGesture(samples, kGestureRate_hz, profile, {}, &exercise);
    const auto valueOf = [&](std::string_view name) {
      const auto row = std::ranges::find(measures, name, &Measure::name);
      return row == measures.end() ? -1 : row->value;
    };
    EXPECT_EQ(valueOf("hazards_touched"), touches ? 1 : 0);
    EXPECT_EQ(valueOf("target_reached"), touches ? 1 : 0);
    if (touches) {
      const double chord_m = 2 * std::sqrt(test::kCystRadius_m * test::kCystRadius_m - beside_m * beside_m);
      EXPECT_NEAR(valueOf("time_at_target_s"), chord_m / 0.01, 2 / kGestureRate_hz);
    }
    LessonWatch watch(profile, {}, nullptr);
    watch.add(samples);
    EXPECT_EQ(watch.hazardsTouched().size(), touches ? 1U : 0U);
  }
}

}  // namespace
}  // namespace needlelab
