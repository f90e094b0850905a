// The search and the error measures of the fits.
#include "client/sim/curves/curve_fit.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(CurveFit, findsTheMinimumOfACurvedValley) {
  // Rosenbrock's function: its minimum is at (1, 1)
  const auto cost = [](const std::vector<double>& x) {
    return 100 * std::pow(x[1] - x[0] * x[0], 2) + std::pow(1 - x[0], 2);
  };
  const auto found = patternSearch(cost, {{"x", -1.2, -5, 5, 0.1}, {"y", 1, -5, 5, 0.1}}, 20000, 1e-6);
  EXPECT_NEAR(found.values[0], 1, 0.02);
  EXPECT_NEAR(found.values[1], 1, 0.04);
}

TEST(CurveFit, passesAJumpAndStaysWithinBounds) {
  const auto cost = [](const std::vector<double>& x) { return std::fabs(x[0] - 7) + (x[0] < 3 ? 10 : 0); };
  EXPECT_EQ(patternSearch(cost, {{"x", 0, -1, 5, 0.5}}, 1000).values[0], 5) << "7 is out of bounds";
  EXPECT_NEAR(patternSearch(cost, {{"x", 0, -1, 9, 0.5}}, 1000).values[0], 7, 0.01);
}

TEST(CurveFit, costsThatAreNoNumberAreNeverTaken) {
  const auto cost = [](const std::vector<double>& x) { return x[0] > 1 ? std::nan("") : -x[0]; };
  const auto found = patternSearch(cost, {{"x", 0, -9, 9, 0.3}}, 1000);
  EXPECT_LE(found.values[0], 1);
  EXPECT_GT(found.values[0], 0.99);
}

TEST(CurveFit, stopsWhenItsEvaluationsAreSpent) {
  int calls = 0;
  const auto found = patternSearch(
      [&](const std::vector<double>& x) {
        ++calls;
        return -x[0];
      },
      {{"x", 0, 0, 1e9, 1}}, 17);
  EXPECT_LE(calls, 18);
  EXPECT_EQ(found.evaluations, calls);
}

TEST(CurveBins, doNotStraddleBlocksAndKeepEveryRow) {
  const std::vector<double> at = {0.01, 0.24, 0.26, 0.49, 0.51, 0.51, 0.99, 3.2};
  const std::vector<double> value = {1, 3, 5, 5, 2, 4, 8, 7};
  const auto bins = binned(at, value, 0.25, 0.5);
  ASSERT_EQ(bins.size(), 5u);
  EXPECT_EQ(bins[0].value, 2);
  EXPECT_EQ(bins[0].scatter, 1);
  EXPECT_EQ(bins[2].rows, (std::vector<std::size_t>{4, 5}));
  EXPECT_EQ(bins[2].value, 3);
  EXPECT_EQ(bins[3].block, 1);
  EXPECT_EQ(bins[4].block, 6);
}

TEST(CurveBins, theErrorUsesBinMeansAndItsFloorTheScatter) {
  // one bin with 0 and 2, one with 5; the model says 1.5 and 5.5
  const auto bins = binned({0.1, 0.2, 1.1}, {0, 2, 5}, 0.5, 0.5);
  const auto error = curveError(bins, {0, 2, 5}, {1.5, 1.5, 5.5}, [](const CurveBin&) { return true; });
  EXPECT_DOUBLE_EQ(error.rms, 0.5);
  EXPECT_DOUBLE_EQ(error.max, 0.5);
  EXPECT_DOUBLE_EQ(error.rows_rms, std::sqrt((2.25 + 0.25 + 0.25) / 3));
  EXPECT_DOUBLE_EQ(error.floor, std::sqrt(2.0 / 3));
  EXPECT_EQ(curveError(bins, {0, 2, 5}, {1, 1, 9}, [](const CurveBin& b) { return b.block == 0; }).max, 0)
      << "values not asked for do not count";
}

}  // namespace
}  // namespace needlelab
