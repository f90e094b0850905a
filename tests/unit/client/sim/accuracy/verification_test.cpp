// The engine compared with closed forms: each law as documented is accepted, a wrong one is rejected.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "client/sim/accuracy/study.h"

namespace needlelab {
namespace {

const ClosedForm& formOf(AxialModel model) {
  return *std::find_if(closedForms().begin(), closedForms().end(),
                       [model](const ClosedForm& form) { return form.model == model; });
}

TEST(ClosedForms, areThereForEveryModelButThoseWithoutAFormula) {
  std::set<AxialModel> models;
  for (const ClosedForm& form : closedForms()) models.insert(form.model);
  EXPECT_EQ(models.size(), kAxialModelCount - 2);
  EXPECT_EQ(models.count(AxialModel::kStatistical) + models.count(AxialModel::kFem), 0u);
}

// by hand: layers of 10 mm with 2, 3 and 4 N, walls of 500 N/m; on the way in the spring is full after 4 mm
TEST(ClosedForms, theWallsForceIsThatOfTheScene) {
  const ClosedForm& wall = formOf(AxialModel::kEnhancedTrackingWall);
  const TurnGesture gesture{0.001, 0.025, 0.01};
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.002, false), -1);
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.008, false), -2);
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.011, false), -2.5);
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.02, false), -3);
  // out: it gives back 4 N over 8 mm, then pulls with up to 1 N, which fades out over the last 2 mm
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.021, true), -2);
  EXPECT_NEAR(wall.force_N(gesture, 0.017, true), 0, 1e-12);
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.01, true), 1);
  EXPECT_DOUBLE_EQ(wall.force_N(gesture, 0.001, true), 0.5);
}

constexpr TurnGesture kGesture{0.001, 0.025, 0.0123};

// DIRECT holds up to each layer's cutting force: it jumps at 10 and 20 mm, on the way in and out. The proxy
// of GOD_OBJECT lets go at 2 N and 500 N/m, 4 mm into the first layer, and 6 mm into the second; the third
// holds.
TEST(Jumps, areWhereTheLawsLetGo) {
  const auto at = [](std::vector<double> way_m) {
    for (double& way : way_m) way = (way + kGesture.from_m) / kGesture.speed_mps;
    return way_m;
  };
  const auto expectEqual = [](const std::vector<double>& found_s, const std::vector<double>& right_s) {
    ASSERT_EQ(found_s.size(), right_s.size());
    for (std::size_t i = 0; i < right_s.size(); ++i) EXPECT_NEAR(found_s[i], right_s[i], 1e-9);
  };
  expectEqual(jumpsOf(formOf(AxialModel::kDirect), kGesture), at({0.01, 0.02, 0.03, 0.04}));
  expectEqual(jumpsOf(formOf(AxialModel::kGodObject), kGesture), at({0.004, 0.010 + 0.006}));
  expectEqual(jumpsOf(formOf(AxialModel::kEnhancedTrackingWall), kGesture), {});
}

// A held force is late by up to a tick: with exact encoders its error is slope × speed × time since the tick,
// here at 1/8, 3/8, 5/8 and 7/8 of it. PRECOMPUTED has 150 N/m in; out 500 N/m while its spring turns from
// 0.3 D to −0.1 x (500 x − 350 D = −50 x at x = 7/11 D), and 50 N/m up to the skin.
TEST(Verification, theErrorOfAHeldForceIsItsSlopeTimesItsAge) {
  const TurnGesture gesture{0.001, 0.025, 0.0125};  // turns in a tick at each of these rates
  const ClosedForm& table = formOf(AxialModel::kPrecomputed);
  const double share = 7.0 / 11;
  const double slope_N_per_m = std::sqrt((150.0 * 150 + 500.0 * 500 * (1 - share) + 50.0 * 50 * share) / 2);
  const double age = std::sqrt((1 + 9 + 25 + 49) / (4 * 64.0));
  for (const double rate_hz : {250.0, 1000.0, 4000.0}) {
    const auto error = errorOf(table, table, gesture, rate_hz, 0);
    ASSERT_TRUE(error.ok());
    const double late_m = gesture.speed_mps / rate_hz;
    EXPECT_NEAR(error->between.rms_N(), age * slope_N_per_m * late_m, 0.02 * slope_N_per_m * late_m);
    EXPECT_NEAR(error->between.greatest_N(), 7.0 / 8 * 500 * late_m, 0.01 * 500 * late_m);
    EXPECT_FALSE(error->delay_s) << "it has no jump";
  }
}

// With exact encoders a jump is shown in the next tick; between jumps nothing is left of it.
TEST(Verification, aJumpIsLateAndNotPartOfTheErrorBetweenJumps) {
  const ClosedForm& direct = formOf(AxialModel::kDirect);
  for (const double rate_hz : {250.0, 1000.0}) {
    double latest_s = 0;
    for (const double way_m : {0.01, 0.02, 0.03, 0.04}) {
      const double ticks = (way_m + kGesture.from_m) / kGesture.speed_mps * rate_hz;
      latest_s = std::max(latest_s, (std::ceil(ticks) - ticks) / rate_hz);
    }
    const auto error = errorOf(direct, direct, kGesture, rate_hz, 0);
    ASSERT_TRUE(error.ok());
    EXPECT_NEAR(error->delay_s.value_or(-1), latest_s, 1e-8);
    EXPECT_LT(error->between.greatest_N(), 500 * kGesture.speed_mps / rate_hz) << "the jumps are 1 N";
  }
}

// without encoder steps and at a high rate the engine gives the formula: the remaining error falls with the
// rate
TEST(Verification, everyModelGoesToItsClosedFormWithTheRate) {
  const TurnGesture gesture = turnGestures(1).front();
  for (const ClosedForm& form : closedForms()) {
    SCOPED_TRACE(std::string(axialModelName(form.model)) + " " + form.variant);
    const auto slow = errorOf(form, form, gesture, 1000, 0), fast = errorOf(form, form, gesture, 16'000, 0);
    ASSERT_TRUE(slow.ok() && fast.ok());
    EXPECT_GT(slow->between.count(), 1000u);
    EXPECT_LT(fast->between.rms_N(), 0.012);
    EXPECT_LT(fast->between.rms_N(), 0.5 * slow->between.rms_N());
    EXPECT_LT(fast->between.beyond(), 0.01);
  }
}

// A manufactured scene: the model's own law is accepted. The same law with 10 % more stiffness or cutting,
// the law of 2018 (no attraction) and other models' laws are rejected.
TEST(ManufacturedScene, acceptsTheTrueLawAndRejectsWrongOnes) {
  const ClosedForm& wall = formOf(AxialModel::kEnhancedTrackingWall);
  ClosedForm stiffer = wall, more_cutting = wall;
  stiffer.scene.tracking_wall.stiffness_N_per_m *= 1.1;
  for (LayerSpec& layer : more_cutting.scene.layers) layer.cutting_force_N *= 1.1;
  const auto rowOf = [&](const ClosedForm& rendered) {
    std::vector<ForceError> errors;
    for (const TurnGesture& gesture : turnGestures(8)) {
      const auto error = errorOf(rendered, wall, gesture, kStationRate_hz, kStationEncoder_m);
      EXPECT_TRUE(error.ok());
      errors.push_back(error->between);
    }
    AccuracyRow row;
    setError(row, errors);
    return row;
  };
  const AccuracyRow right = rowOf(wall);
  EXPECT_LT(*right.beyond, 0.01);
  EXPECT_LT(right.error_N->high, 0.02);
  const std::map<std::string, ClosedForm> wrong = {{"stiffer", stiffer},
                                                   {"more cutting", more_cutting},
                                                   {"no attraction", formOf(AxialModel::kTrackingWall)},
                                                   {"another model", formOf(AxialModel::kFirstOrder)},
                                                   {"a spring", formOf(AxialModel::kVoigt)}};
  for (const auto& [name, form] : wrong) {
    const AccuracyRow row = rowOf(form);
    EXPECT_GT(*row.beyond, 0.05) << name;
    EXPECT_GT(row.error_N->low, 3 * right.error_N->high) << name << ": outside the printed intervals";
  }
}

TEST(ManufacturedScene, eachModelFitsItsOwnLawBest) {
  const TurnGesture gesture = turnGestures(1).front();
  for (const ClosedForm& truth : closedForms()) {
    if (!truth.variant.empty()) continue;
    const auto own = errorOf(truth, truth, gesture, kStationRate_hz, kStationEncoder_m);
    ASSERT_TRUE(own.ok());
    for (const ClosedForm& other : closedForms()) {
      if (other.model == truth.model) continue;
      const auto error = errorOf(other, truth, gesture, kStationRate_hz, kStationEncoder_m);
      ASSERT_TRUE(error.ok());
      EXPECT_GT(error->between.rms_N(), 2 * own->between.rms_N())
          << axialModelName(other.model) << " as " << axialModelName(truth.model);
    }
  }
}

TEST(VerificationRows, haveEveryRateAndEncoderAndRepeatExactly) {
  std::vector<std::string> notes;
  const auto rows = verificationRows(
      {}, [](std::string_view, double) {}, notes);
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  EXPECT_EQ(rows->size(), closedForms().size() * 15 + 1) << "STATISTICAL has its mean only";
  const auto again = verificationRows(
      {}, [](std::string_view, double) {}, notes);
  ASSERT_TRUE(again.ok());
  for (std::size_t i = 0; i < rows->size(); ++i) {
    const AccuracyRow& row = (*rows)[i];
    SCOPED_TRACE(row.model + " " + row.variant);
    EXPECT_EQ(row.error_N->mean, (*again)[i].error_N->mean);
    EXPECT_EQ(row.delay_s, (*again)[i].delay_s);
    EXPECT_LE(row.error_N->low, row.error_N->mean);
    EXPECT_GE(row.error_N->high, row.error_N->mean);
    EXPECT_FALSE(row.against.empty() || row.cannot_show.empty());
    if (row.model != "STATISTICAL") continue;
    // its table's mean is within four standard errors (0.4 N over 200 insertions)
    EXPECT_LT(row.error_N->mean, 4 * 0.4 / std::sqrt(200.0));
  }
}

}  // namespace
}  // namespace needlelab
