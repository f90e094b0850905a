// A row's error and share, checked by formulas.
#include "client/sim/accuracy/row.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "client/sim/tools/hand_thresholds.h"

namespace needlelab {
namespace {

TEST(AccuracyRow, beyondMeansOverSevenPercentOrAPerceptibleStep) {
  EXPECT_DOUBLE_EQ(localLimit_N(10), 0.7);
  EXPECT_DOUBLE_EQ(localLimit_N(-10), 0.7);
  EXPECT_DOUBLE_EQ(localLimit_N(0.1), kNoticeableStep_N);
  ForceError error;
  error.add(10.6, 10);  // 6 %
  error.add(10.8, 10);  // 8 %
  error.add(0.01, 0);   // 10 mN where the truth is 0
  error.add(-0.03, 0);  // 30 mN
  EXPECT_EQ(error.count(), 4u);
  EXPECT_NEAR(error.greatest_N(), 0.8, 1e-12);
  EXPECT_DOUBLE_EQ(error.beyond(), 0.5);
  EXPECT_NEAR(error.rms_N(), std::sqrt((0.36 + 0.64 + 0.0001 + 0.0009) / 4), 1e-12);
}

// the same 0.3 N is 3 % of a large force and 30 % of a small one: a single limit for the whole scene hid that
TEST(AccuracyRow, theSameErrorIsBeyondOnlyAtSmallForces) {
  ForceError great, small;
  great.add(10.3, 10);
  small.add(1.3, 1);
  EXPECT_EQ(great.beyond(), 0);
  EXPECT_EQ(small.beyond(), 1);
}

TEST(AccuracyRow, aRowsIntervalIsStudentsOverItsGestures) {
  std::vector<ForceError> gestures(3);
  for (std::size_t i = 0; i < 3; ++i) gestures[i].add(0.1 * static_cast<double>(i + 1), 0);
  AccuracyRow row;
  setError(row, gestures);
  // mean 0.2, standard deviation 0.1; t with 2 degrees of freedom 4.303
  EXPECT_NEAR(row.error_N->mean, 0.2, 1e-12);
  EXPECT_NEAR(row.error_N->high, 0.2 + 4.303 * 0.1 / std::sqrt(3.0), 1e-4);
  EXPECT_EQ(row.error_N->low, 0) << "no error is negative";
  EXPECT_EQ(row.beyond, 1.0);
  EXPECT_NEAR(*row.greatest_N, 0.3, 1e-12);
  setError(row, {gestures[0]});
  EXPECT_TRUE(std::isinf(row.error_N->high)) << "one gesture has no interval";
}

TEST(AccuracyJson, hasTheReportsColumnsAndNullWhereAComparatorHasNone) {
  AccuracyRow row;
  row.model = "FEM";
  row.error_N =
      MeanInterval{0.1, -std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(), 1};
  row.time = LoopTimes{1000, 900, 1200, 3000};
  row.delay_s = 0.002;
  row.prepare_s = 1.5;
  const auto json = jsonOf(row);
  EXPECT_EQ(json["comparator"], "verification");
  EXPECT_EQ(json["error_n"], 0.1);
  EXPECT_TRUE(json["error_high_n"].is_null()) << "one value has no interval";
  EXPECT_EQ(json["p50_ns"], 1000);
  EXPECT_EQ(json["p50_low_ns"], 900);
  EXPECT_EQ(json["p50_high_ns"], 1200);
  EXPECT_EQ(json["p999_ns"], 3000);
  EXPECT_EQ(json["delay_s"], 0.002);
  EXPECT_EQ(json["prepare_ms"], 1500);
  for (const char* absent :
       {"greatest_n", "greatest_at", "beyond", "instructions", "margin", "nodes", "variant"})
    EXPECT_TRUE(json.at(absent).is_null()) << absent;
}

TEST(Comparators, eachSaysWhatItShowsAndWhatItDoesNot) {
  for (std::size_t c = 0; c < kComparatorCount; ++c) {
    const ComparatorText& text = textOf(static_cast<Comparator>(c));
    EXPECT_NE(text.shows.find("not w"), std::string_view::npos) << text.name;
    EXPECT_EQ(text.title.find_first_of("0123456789 "), text.name.size() + 1) << text.title;
  }
}

}  // namespace
}  // namespace needlelab
