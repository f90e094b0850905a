// The study of the largest stable stiffness, compared with theory.
#include "client/sim/stability/scan_limits.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "client/sim/stability/scan_nudge.h"
#include "tests/support/sanitized.h"

namespace needlelab {
namespace {

// the compiled-in cases with fewer rates, delays and frictions
Result<CaseFile> smallStudy() {
  auto file = CaseFile::embedded();
  if (!file.ok()) return file.error();
  nlohmann::json json = file->json();
  auto& study = json["cases"]["stiffness_limits"];
  // a sanitizer's findings do not depend on the rate, and it takes ten times as long
  study["rates_hz"] = test::kSanitized ? nlohmann::json::array({500}) : nlohmann::json::array({500, 4000});
  study["delays_ticks"] = {0, 2};
  study["rest"]["encoder_steps_m"] = {30e-6};
  study["rest"]["frictions_n"] = {0, 0.01, 0.03};
  return CaseFile::parse(json.dump(), "small.json");
}

TEST(StiffnessLimits, everyModelReachesItsLinearStiffnessLimit) {
  const auto file = smallStudy();
  ASSERT_TRUE(file.ok()) << file.error().message;
  const auto limits = findStiffnessLimits({*file, false}, {});
  ASSERT_TRUE(limits.ok()) << limits.error().message;
  EXPECT_TRUE(limits->notes.empty()) << limits->notes.front();
  ASSERT_EQ(limits->rows.size(), kAxialModelCount * (test::kSanitized ? 2 : 4));
  for (const StiffnessLimitRow& row : limits->rows) {
    // device 0.5 and hand 3 N·s/m: the stable limit with the hand is seven times the passive one
    EXPECT_NEAR(row.passive_N_per_m, 0.5 * row.rate_hz / (0.5 + row.delay_ticks), 1e-9);
    EXPECT_NEAR(row.coupled_N_per_m, 7 * row.passive_N_per_m, 1e-9);
    const std::string words = std::string(axialModelName(row.model)) + ", " + std::to_string(row.rate_hz) +
                              " Hz, " + std::to_string(row.delay_ticks) + " late";
    if (row.at_cap) {
      EXPECT_GT(row.sampled_N_per_m, 0.95 * row.stiffness_N_per_m) << words;
    } else {
      // bisection to 2 %, the quantised encoder, integration in steps: 10 % in total
      EXPECT_NEAR(row.stiffness_N_per_m / row.sampled_N_per_m, 1, 0.1) << words;
      EXPECT_NEAR(row.felt_N_per_m / row.stiffness_N_per_m, 1, 0.1) << words;  // the felt stiffness was K
    }
  }
}

TEST(StiffnessLimits, stableMeansThatANudgeDiesOut) {
  NudgeOutcome outcome;
  outcome.swing_middle_m = outcome.swing_end_m = 100e-6;
  EXPECT_FALSE(isStable(outcome, 10e-6)) << "swings on as it did";
  outcome.swing_end_m = 94e-6;
  EXPECT_TRUE(isStable(outcome, 10e-6)) << "becomes smaller";
  outcome.swing_end_m = outcome.swing_middle_m = 40e-6;
  EXPECT_TRUE(isStable(outcome, 10e-6)) << "is within what the encoder can tell";
  outcome.fault = Fault::kDeviceTooFast;
  EXPECT_FALSE(isStable(outcome, 10e-6));
}

TEST(StiffnessLimits, aStudyThatDoesNotFitIsNamed) {
  auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok());
  nlohmann::json json = file->json();
  json["cases"]["stiffness_limits"].erase("rates_hz");
  const auto broken = CaseFile::parse(json.dump(), "broken.json");
  ASSERT_TRUE(broken.ok());
  const auto limits = findStiffnessLimits({*broken, false}, {});
  ASSERT_FALSE(limits.ok());
  EXPECT_EQ(limits.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(limits.error().message.find("stiffness_limits.rates_hz"), std::string::npos)
      << limits.error().message;
}

}  // namespace
}  // namespace needlelab
