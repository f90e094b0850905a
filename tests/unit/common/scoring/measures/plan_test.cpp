// Errors relative to an exercise's plan: straight insertions whose errors follow from their offset and tilt.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "common/scoring/measures/measure_table.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

constexpr const char* kPlanRows[] = {"planned_entry_error_m", "planned_angle_error_rad",
                                     "mean_planned_line_error_m", "largest_planned_line_error_m"};

void putVector(pb::Vector3& to, Vec3 v) {
  to.set_x(v.x);
  to.set_y(v.y);
  to.set_z(v.z);
}

pb::Exercise planned(Vec3 entry_m = {}, Vec3 direction = {0, 0, -3}) {
  pb::Exercise exercise;
  exercise.mutable_plan()->set_frame(pb::Exercise::Plan::LIMB);
  putVector(*exercise.mutable_plan()->mutable_entry_m(), entry_m);
  putVector(*exercise.mutable_plan()->mutable_direction(), direction);
  return exercise;
}

/// The needle moves straight along its axis at 10 mm/s: through the skin of halfSpace() at (x, y, 0), leaning
/// by `lean_rad` towards +y, until 20 mm are in after 2 s; rests 1 s.
void goStraight(double t, GestureSample& s, double x_m, double y_m, double lean_rad) {
  const double length_m = std::min(0.02, 0.01 * t - 0.01003);
  setDown(s, lean_rad);
  setDepth(s, length_m * std::cos(lean_rad));
  setTip(s, {x_m, y_m + length_m * std::sin(lean_rad), -length_m * std::cos(lean_rad)});
  s.insertion_m = std::max(0.0, length_m);
}
std::vector<GestureSample> straight(double x_m, double y_m, double lean_rad) {
  return gesture(1000, 4.003, [=](double t, GestureSample& s) { goStraight(t, s, x_m, y_m, lean_rad); });
}

std::vector<Measure> scoredBy(const pb::Exercise& exercise, const std::vector<GestureSample>& samples) {
  return scoreGesture(samples, 1000, halfSpace(), {}, &exercise);
}

void expectNoPlanRows(const std::vector<Measure>& score) {
  for (const char* const name : kPlanRows) EXPECT_EQ(find(score, name), nullptr) << name;
}

TEST(Plan, aWayOnThePlanHasNoError) {
  const auto score = scoredBy(planned({0.001, 0.002, 0}), straight(0.001, 0.002, 0));
  for (const char* const name : kPlanRows) EXPECT_NEAR(valueOf(score, name), 0, 1e-12) << name;
}

TEST(Plan, aParallelPathHasAConstantLineError) {
  const auto score = scoredBy(planned(), straight(0.003, -0.004, 0));
  EXPECT_NEAR(valueOf(score, "planned_entry_error_m"), 0.005, 1e-12);
  EXPECT_NEAR(valueOf(score, "planned_angle_error_rad"), 0, 1e-12);
  EXPECT_NEAR(valueOf(score, "mean_planned_line_error_m"), 0.005, 1e-12);
  EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), 0.005, 1e-12);
}

TEST(Plan, aTiltedWayGoesAwayFromThePlan) {
  for (const double degrees : {3.0, 10.0, 40.0}) {
    const double lean = degrees * std::numbers::pi / 180, y = 0.002;
    const auto score = scoredBy(planned(), straight(0, y, lean));
    EXPECT_NEAR(valueOf(score, "planned_entry_error_m"), y, 1e-12);
    EXPECT_NEAR(valueOf(score, "planned_angle_error_rad"), lean, 1e-12);
    // y + l sin(lean) at path length l: 2 s from 0 to 20 mm, 1 s at 20 mm
    EXPECT_NEAR(valueOf(score, "mean_planned_line_error_m"), y + 0.04 / 3 * std::sin(lean), 1e-5);
    EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), y + 0.02 * std::sin(lean), 1e-12);
  }
  // relative to a plan that leans by 30° to the same side, 10° remain
  const double lean = 40 * std::numbers::pi / 180, plan_lean = 30 * std::numbers::pi / 180;
  const auto leaning = planned({}, {0, std::sin(plan_lean), -std::cos(plan_lean)});
  const auto score = scoredBy(leaning, straight(0, 0, lean));
  EXPECT_NEAR(valueOf(score, "planned_angle_error_rad"), lean - plan_lean, 1e-12);
  EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), 0.02 * std::sin(lean - plan_lean), 1e-12);
  // the same plan, given by a point on its line
  pb::Exercise by_target = leaning;
  by_target.mutable_plan()->clear_direction();
  putVector(*by_target.mutable_plan()->mutable_target_m(),
            {0, 0.03 * std::sin(plan_lean), -0.03 * std::cos(plan_lean)});
  const auto same = scoredBy(by_target, straight(0, 0, lean));
  for (const char* const name : kPlanRows) EXPECT_NEAR(valueOf(same, name), valueOf(score, name), 1e-12);
}

TEST(Plan, anOppositeDirectionIsHalfATurnOff) {
  // course files reject such a plan; a distance from a line does not depend on its direction
  const auto score = scoredBy(planned({}, {0, 0, 1}), straight(0.003, 0.004, 0));
  EXPECT_NEAR(valueOf(score, "planned_angle_error_rad"), std::numbers::pi, 1e-12);
  EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), 0.005, 1e-12);
}

TEST(Plan, measuresAreAbsentWithoutAPlanOrAnEntry) {
  const auto samples = straight(0.003, 0.004, 0.1);
  expectNoPlanRows(scoreGesture(samples, 1000, halfSpace(), {}));
  const pb::Exercise plain;
  const auto without = scoredBy(plain, samples), with = scoredBy(planned(), samples);
  expectNoPlanRows(without);
  EXPECT_EQ(scoreJson(without).find("plan"), std::string::npos);
  // everything else is the same
  ASSERT_EQ(with.size(), without.size() + std::size(kPlanRows));
  for (const Measure& row : without) EXPECT_EQ(valueOf(with, row.name), row.value) << row.name;
  // plans without a valid line
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const pb::Exercise& none : {planned({}, {}), planned({}, {nan, 0, 0}), planned({nan, 0, 0})})
    expectNoPlanRows(scoredBy(none, samples));
  // a needle that stays outside, and no samples at all
  const auto outside = gesture(1000, 1, [](double, GestureSample& s) { setDepth(s, -0.01); });
  expectNoPlanRows(scoredBy(planned(), outside));
  expectNoPlanRows(scoredBy(planned(), {}));
}

TEST(Plan, theEntryIsTheFirstAndTheAngleTheLast) {
  // goes in along the plan, comes out, and goes in again 6 mm aside, leaning
  auto samples = straight(0, 0, 0);
  const auto outside = gesture(1000, 0.5, [](double, GestureSample& s) { setDepth(s, -0.01); });
  const auto again = straight(0, 0.006, 0.3);
  for (const auto* part : {&outside, &again}) {
    const std::uint64_t after = samples.back().tick + 1 - part->front().tick;
    for (GestureSample sample : *part) {
      sample.tick += after;
      samples.push_back(sample);
    }
  }
  const auto score = scoredBy(planned(), samples);
  EXPECT_NEAR(valueOf(score, "planned_entry_error_m"), 0, 1e-12);
  EXPECT_NEAR(valueOf(score, "planned_angle_error_rad"), 0.3, 1e-12);
  EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), 0.006 + 0.02 * std::sin(0.3), 1e-12);
  // equal times in tissue
  EXPECT_NEAR(valueOf(score, "mean_planned_line_error_m"), 0.5 * (0.006 + 0.04 / 3 * std::sin(0.3)), 1e-5);
}

TEST(Plan, theEntryLiesWhereTheWayCrossesTheSkin) {
  // in one tick from 1 mm above to 3 mm below, and 4 mm aside: a quarter of the way to the skin
  const auto fast = gesture(1000, 1, [](double t, GestureSample& s) {
    setDepth(s, t < 0.5 ? -0.001 : 0.003);
    setTip(s, {t < 0.5 ? 0.0 : 0.004, 0, t < 0.5 ? 0.001 : -0.003});
  });
  EXPECT_NEAR(valueOf(scoredBy(planned(), fast), "planned_entry_error_m"), 0.001, 1e-12);
  // its entry was not recorded: extrapolated back along the needle
  auto late = straight(0.001, 0.002, 0.3);
  late.erase(late.begin(), late.begin() + 2000);
  EXPECT_NEAR(valueOf(scoredBy(planned(), late), "planned_entry_error_m"), std::hypot(0.001, 0.002), 1e-12);
  // the same after a gap of 0.3 s
  auto gap = straight(0.001, 0.002, 0.3);
  gap.erase(gap.begin() + 900, gap.begin() + 1200);
  EXPECT_NEAR(valueOf(scoredBy(planned(), gap), "planned_entry_error_m"), std::hypot(0.001, 0.002), 1e-12);
}

TEST(Plan, oneTickInTissueHasNoMean) {
  auto samples = straight(0.003, 0.004, 0);
  samples = {samples[2000]};
  const auto score = scoredBy(planned(), samples);
  EXPECT_EQ(find(score, "mean_planned_line_error_m"), nullptr);
  EXPECT_NEAR(valueOf(score, "largest_planned_line_error_m"), 0.005, 1e-12);
}

TEST(Plan, measuresMayBeRequiredAndAreShownInDegrees) {
  pb::Exercise exercise = planned();
  const auto require = [&](const char* name, double max) {
    exercise.add_requirements()->set_measure(name);
    exercise.mutable_requirements()->rbegin()->set_max(max);
  };
  require("planned_angle_error_rad", 5 * std::numbers::pi / 180);
  require("planned_entry_error_m", 0.003);
  require("largest_planned_line_error_m", 0.004);
  ASSERT_TRUE(checkRequirements(exercise).ok());
  const auto score = scoredBy(exercise, straight(0, 0.002, 10 * std::numbers::pi / 180));
  EXPECT_EQ(find(score, "planned_angle_error_rad")->words,
            "Angle to the planned line 10°: above the 5° allowed");
  EXPECT_EQ(find(score, "planned_entry_error_m")->words, "Entry-site error 2 mm: within the 3 mm allowed");
  EXPECT_EQ(find(score, "largest_planned_line_error_m")->words,
            "Largest distance from the planned line 5.47 mm: above the 4 mm allowed");
  EXPECT_EQ(find(score, "largest_lateral_error_m")->words, "Largest distance from the needle's own line 0 mm")
      << "the text names the line";
  // the plan was removed from the exercise, but not its requirements
  exercise.clear_plan();
  const Status refused = checkRequirements(exercise);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(
      refused.error().message,
      "requirements[0].measure: planned_angle_error_rad needs a plan, and the exercise has none: give it a "
      "plan, or take the requirement away");
}

TEST(Plan, theTableMarksMeasuresThatNeedAPlan) {
  std::vector<std::string> names;
  for (const MeasureKind& kind : measureKinds())
    if (kind.need == MeasureNeed::kPlan) names.emplace_back(kind.name);
  EXPECT_EQ(names, std::vector<std::string>(std::begin(kPlanRows), std::end(kPlanRows)));
}

}  // namespace
}  // namespace needlelab
