#include "client/view/model/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(AxisTicks, areMultiplesOfOneTwoOrFiveTimesAPowerOfTen) {
  for (const double high : {0.0013, 0.07, 1.0, 3.7, 42.0, 980.0, 12345.0}) {
    const AxisTicks ticks = axisTicks(0, high, 5, false);
    const double power = std::pow(10, std::floor(std::log10(ticks.step) + 1e-9));
    const double factor = ticks.step / power;
    EXPECT_TRUE(std::fabs(factor - 1) < 1e-6 || std::fabs(factor - 2) < 1e-6 || std::fabs(factor - 5) < 1e-6)
        << high;
    ASSERT_GE(ticks.at.size(), 2u) << high;
    EXPECT_LE(ticks.at.size(), 7u) << high;
    for (const double at : ticks.at) EXPECT_NEAR(at / ticks.step, std::round(at / ticks.step), 1e-9);
    EXPECT_GE(ticks.at.front(), ticks.low - 1e-12);
    EXPECT_LE(ticks.at.back(), ticks.high + 1e-12);
  }
}

TEST(AxisTicks, widenedAxisHoldsTheRangeAndEndsOnTicks) {
  const AxisTicks ticks = axisTicks(-0.37, 4.12, 5, true);
  EXPECT_DOUBLE_EQ(ticks.low, -1);
  EXPECT_DOUBLE_EQ(ticks.high, 5);
  EXPECT_DOUBLE_EQ(ticks.at.front(), -1);
  EXPECT_DOUBLE_EQ(ticks.at.back(), 5);
}

TEST(AxisTicks, aRangeWithoutWidthTurnedRoundOrNotFiniteStillMakesAnAxis) {
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               infinity = std::numeric_limits<double>::infinity();
  const double ranges[][2] = {{3, 3},        {0, 0}, {5, 1}, {nan, nan}, {0, infinity}, {-infinity, infinity},
                              {1e300, 2e300}};
  for (const auto& range : ranges) {
    for (const bool widen : {false, true}) {
      const AxisTicks ticks = axisTicks(range[0], range[1], 5, widen);
      EXPECT_LT(ticks.low, ticks.high);
      EXPECT_TRUE(std::isfinite(ticks.low) && std::isfinite(ticks.high));
      EXPECT_LT(ticks.at.size(), 20u);
    }
  }
}

TEST(AxisTicks, decimalsTellTheTicksApart) {
  EXPECT_EQ(axisTicks(0, 1, 5, false).decimals, 1);
  EXPECT_EQ(axisTicks(0, 100, 5, false).decimals, 0);
  EXPECT_EQ(axisTicks(0, 0.01, 5, false).decimals, 3);
}

TEST(TickText, hasAProperMinusAndNoNegativeZero) {
  EXPECT_EQ(tickText(-1.25, 2), "\u22121.25");
  EXPECT_EQ(tickText(-0.0001, 2), "0.00");
  EXPECT_EQ(tickText(3, 0), "3");
}

TEST(ClockText, roundsBeforeItSplits) {
  EXPECT_EQ(clockText(0), "0:00");
  EXPECT_EQ(clockText(59.96, 1), "1:00.0");
  EXPECT_EQ(clockText(61.24, 1), "1:01.2");
  EXPECT_EQ(clockText(3599.6), "60:00");
  EXPECT_EQ(clockText(-5), "\u22120:05");
  EXPECT_EQ(clockText(std::numeric_limits<double>::infinity()), "–:––");
}

TEST(AxisTicks, areNeverOneAloneThatTellsNoScale) {
  for (const auto& [low, high] :
       {std::pair{63.7, 65.9}, std::pair{2.5, 3.9}, std::pair{0.1, 1.9}, std::pair{-0.9, 0.9}})
    for (const int wanted : {2, 3, 8}) {
      const AxisTicks ticks = axisTicks(low, high, wanted, false);
      EXPECT_GE(ticks.at.size(), 2u) << low << " to " << high << ", " << wanted;
    }
}

TEST(AxisTicks, ofWhatIsCountedAreWhole) {
  EXPECT_EQ(axisTicks(1, 2, 5, false, 1).at, (std::vector<double>{1, 2}));
  EXPECT_EQ(axisTicks(1, 2, 5, false, 1).decimals, 0);
  EXPECT_EQ(axisTicks(1, 3.001, 9, false, 1).at, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(axisTicks(1.2, 1.8, 5, false, 1).at, std::vector<double>{});
  EXPECT_EQ(axisTicks(1, 40, 4, false, 1).step, 10);
}

TEST(PixelColumns, keepLeastGreatestAndLastOfTheirTime) {
  const std::vector<double> x = {0.0, 0.2, 0.4, 1.1, 2.5}, y = {3, 9, 1, 5, 7};
  std::vector<PixelColumn> columns(3);
  fillColumns(x, y, 0, 3, columns);
  EXPECT_FLOAT_EQ(columns[0].min, 1);
  EXPECT_FLOAT_EQ(columns[0].max, 9);
  EXPECT_FLOAT_EQ(columns[0].last, 1);
  EXPECT_FLOAT_EQ(columns[1].last, 5);
  EXPECT_FLOAT_EQ(columns[2].last, 7);
}

TEST(PixelColumns, leaveOutWhatIsNotFiniteOrOutside) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> x = {-1, 0.5, 1.5, 3}, y = {100, nan, 2, 100};
  std::vector<PixelColumn> columns(2);
  fillColumns(x, y, 0, 2, columns);
  EXPECT_TRUE(columns[0].empty());
  EXPECT_FLOAT_EQ(columns[1].max, 2);
}

TEST(PixelColumns, ofNoRangeOrNoColumnsAreEmpty) {
  const std::vector<double> x = {0, 1}, y = {1, 1};
  std::vector<PixelColumn> columns(2);
  columns[0].take(4);
  fillColumns(x, y, 1, 1, columns);
  EXPECT_TRUE(columns[0].empty() && columns[1].empty());
  fillColumns(x, y, 0, 1, {});
}

TEST(PixelColumns, aLoneSpikeIsNeverLost) {
  std::vector<double> x, y;
  for (int i = 0; i < 100000; ++i) {
    x.push_back(i * 0.001);
    y.push_back(i == 54321 ? 42 : 0);
  }
  std::vector<PixelColumn> columns(300);
  columnsOf(x, y)(0, 100, columns);
  float greatest = 0;
  for (const PixelColumn& column : columns) greatest = std::max(greatest, column.max);
  EXPECT_FLOAT_EQ(greatest, 42);
}

}  // namespace
}  // namespace needlelab
