#include "client/view/model/plot.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/random.h"

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

TEST(AxisTicks, anEmptyReversedOrInfiniteRangeStillMakesAnAxis) {
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

TEST(MomentText, forcesHaveTheSameDecimalsEverywhere) {
  EXPECT_EQ(momentText(3.124, "N"), "3.12 N");
  EXPECT_EQ(momentText(0.0456, "N·m"), "0.046 N·m");
  EXPECT_EQ(momentText(-0.5, "N"), "\u22120.50 N");
  EXPECT_EQ(momentDecimals("N"), 2);
  EXPECT_FALSE(momentDecimals("mm")) << "the axis says";
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

TEST(AxisTicks, countsHaveWholeNumberTicks) {
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

TEST(PixelColumns, ofNoRangeOrNoColumnsAreEmpty) {
  const std::vector<double> x = {0, 1}, y = {1, 1};
  std::vector<PixelColumn> columns(2);
  columns[0].take(4);
  fillColumns(x, y, 1, 1, columns);
  EXPECT_TRUE(columns[0].empty() && columns[1].empty());
  fillColumns(x, y, 0, 1, {});
}

TEST(PixelColumns, aValueBeyondAFloatIsSkippedWithoutAffectingOthers) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<double> x = {0.5, 1.5, 2.5, 3.5, 4.5}, y = {1, 1e300, -1e300, infinity, 3};
  std::vector<PixelColumn> columns(5);
  fillColumns(x, y, 0, 5, columns);
  for (const std::size_t i : {1u, 2u, 3u}) EXPECT_TRUE(columns[i].empty()) << i;
  EXPECT_FLOAT_EQ(columns[0].max, 1);
  EXPECT_FLOAT_EQ(columns[4].max, 3);
}

TEST(PixelColumns, aPointFallsIntoOneColumnAndTheEndIsExcluded) {
  struct Row {
    double x;
    int column;  ///< of 4 over [1, 2); −1: none
  };
  for (const Row& row : {Row{1, 0}, Row{1.2, 0}, Row{1.3, 1}, Row{1.99, 3}, Row{2, -1}, Row{0.99, -1}}) {
    const std::vector<double> x = {row.x}, y = {7};
    std::vector<PixelColumn> columns(4);
    fillColumns(x, y, 1, 2, columns);
    for (int i = 0; i < 4; ++i) {
      const PixelColumn& column = columns[static_cast<std::size_t>(i)];
      EXPECT_EQ(column.empty(), i != row.column) << row.x << ", column " << i;
      if (i == row.column) {
        EXPECT_TRUE(column.min == 7 && column.max == 7 && column.last == 7) << row.x;
      }
    }
  }
}

TEST(PixelColumns, holdTheExtremesOfEveryRangeThatIsZoomedInto) {
  test::Random draw(21);
  std::vector<double> x, y;
  for (int i = 0; i < 3000; ++i) {
    x.push_back((x.empty() ? 0 : x.back()) + draw.in(0.0001, 0.02));
    y.push_back(draw.chance(0.05) ? std::numeric_limits<double>::quiet_NaN() : draw.in(-5, 5));
  }
  for (int round = 0; round < 40; ++round) {
    const double from = draw.in(-1, x.back()), to = from + draw.in(0.01, 40);
    std::vector<PixelColumn> columns(1 + draw.below(900));
    fillColumns(x, y, from, to, columns);
    float least = std::numeric_limits<float>::infinity(), greatest = -least;
    for (const PixelColumn& column : columns) {
      least = std::min(least, column.min);
      greatest = std::max(greatest, column.max);
    }
    float expected_least = std::numeric_limits<float>::infinity(), expected_greatest = -expected_least;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (x[i] < from || x[i] >= to || std::isnan(y[i])) continue;
      expected_least = std::min(expected_least, static_cast<float>(y[i]));
      expected_greatest = std::max(expected_greatest, static_cast<float>(y[i]));
    }
    EXPECT_EQ(least, expected_least) << from << " to " << to;
    EXPECT_EQ(greatest, expected_greatest) << from << " to " << to;
  }
}

TEST(AxisTicks, noTwoTicksHaveTheSameLabel) {
  test::Random draw(22);
  for (int round = 0; round < 500; ++round) {
    const double span = std::pow(10, draw.in(-6, 9)), low = draw.in(-3, 3) * span;
    const AxisTicks ticks = axisTicks(low, low + span, 2 + static_cast<int>(draw.below(7)), draw.chance(0.5));
    ASSERT_GE(ticks.at.size(), 2u) << low << " + " << span;
    for (std::size_t i = 1; i < ticks.at.size(); ++i)
      EXPECT_NE(tickText(ticks.at[i - 1], ticks.decimals), tickText(ticks.at[i], ticks.decimals))
          << low << " + " << span;
  }
}

TEST(ClockText, aTimeThatRoundsToZeroHasNoSign) {
  EXPECT_EQ(clockText(-0.2), "0:00");
  EXPECT_EQ(clockText(-0.04, 1), "0:00.0");
  EXPECT_EQ(clockText(-0.06, 1), "\u22120:00.1");
  EXPECT_EQ(clockText(-0.0), "0:00");
}

constexpr PlotQuantity kSpanned[] = {PlotQuantity::kNumber, PlotQuantity::kForce,    PlotQuantity::kTorque,
                                     PlotQuantity::kDepth,  PlotQuantity::kDistance, PlotQuantity::kSpeed,
                                     PlotQuantity::kAngle,  PlotQuantity::kTime,     PlotQuantity::kArea,
                                     PlotQuantity::kWork};

Plot plotOf(PlotQuantity quantity) {
  Plot plot;
  plot.quantity = quantity;
  return plot;
}

TEST(FittedSpan, ofAnEmptyPlotIsTheLeastSpanFromZero) {
  for (const PlotQuantity quantity : kSpanned) {
    ASSERT_GT(leastSpanOf(quantity), 0);
    for (const auto& data : {std::optional<AxisSpan>(), std::optional(AxisSpan{0, 0})}) {
      const AxisSpan span = fittedSpan(plotOf(quantity), data);
      EXPECT_EQ(span.low, 0);
      EXPECT_EQ(span.high, leastSpanOf(quantity));
    }
  }
}

// a plot with a unit always has a quantity
TEST(FittedSpan, isThatOfTheUnitWhereNoQuantityIsGiven) {
  Plot plot;
  for (const PlotQuantity quantity : {PlotQuantity::kForce, PlotQuantity::kSpeed, PlotQuantity::kAngle}) {
    plot.unit = quantity == PlotQuantity::kForce ? "N" : quantity == PlotQuantity::kSpeed ? "mm/s" : "°";
    EXPECT_EQ(fittedSpan(plot, AxisSpan{0, 0}).high, leastSpanOf(quantity)) << plot.unit;
  }
  plot.unit = "%";
  EXPECT_EQ(fittedSpan(plot, AxisSpan{20, 20.5}).high, 100);
  plot.unit.clear();
  EXPECT_EQ(fittedSpan(plot, AxisSpan{20, 20.5}).high, 20.5);
}

TEST(FittedSpan, centresDataThatSpanLess) {
  for (const auto& [low, high] : {std::pair{149.7, 149.8}, {149.7, 149.7}, {-80.05, -80.02}}) {
    const AxisSpan span = fittedSpan(plotOf(PlotQuantity::kDepth), AxisSpan{low, high});
    EXPECT_NEAR(span.high - span.low, leastSpanOf(PlotQuantity::kDepth), 1e-9);
    EXPECT_NEAR(0.5 * (span.low + span.high), 0.5 * (low + high), 1e-9);
  }
}

TEST(FittedSpan, doesNotCrossZeroWhereTheDataDoNot) {
  struct Row {
    AxisSpan data, expected;
  };
  for (const Row& row : {Row{{0, 0.03}, {0, 2}}, Row{{0.3, 0.4}, {0, 2}}, Row{{-0.4, -0.3}, {-2, 0}},
                         Row{{-0.1, 0.2}, {-0.95, 1.05}}}) {
    const AxisSpan span = fittedSpan(plotOf(PlotQuantity::kForce), row.data);
    EXPECT_NEAR(span.low, row.expected.low, 1e-9) << row.data.low;
    EXPECT_NEAR(span.high, row.expected.high, 1e-9) << row.data.low;
  }
}

TEST(FittedSpan, keepsAGivenEndAndMovesTheOther) {
  Plot plot = plotOf(PlotQuantity::kDistance);
  plot.low = 0;
  EXPECT_EQ(fittedSpan(plot, AxisSpan{0, 0.03}).high, leastSpanOf(PlotQuantity::kDistance));
  plot.low.reset();
  plot.high = 1;
  EXPECT_EQ(fittedSpan(plot, AxisSpan{0, 0.03}).low, 1 - leastSpanOf(PlotQuantity::kDistance));
  plot.low = 0.5;
  EXPECT_EQ(fittedSpan(plot, AxisSpan{0, 0.03}).low, 0.5) << "both given";
  EXPECT_EQ(fittedSpan(plot, AxisSpan{0, 0.03}).high, 1);
}

TEST(FittedSpan, holdsDataAndLimitsAndIsNeverNarrower) {
  test::Random draw(31);
  for (int round = 0; round < 500; ++round) {
    Plot plot = plotOf(kSpanned[draw.below(std::size(kSpanned))]);
    const double low = draw.in(-0.5, 0.5) * std::pow(10, draw.in(-2, 2)),
                 high = low + draw.in(0, 1) * std::pow(10, draw.in(-3, 1));
    plot.limits.push_back({draw.in(0, 10), "at most"});
    const AxisSpan span = fittedSpan(plot, AxisSpan{low, high});
    EXPECT_LE(span.low, low) << round;
    EXPECT_GE(span.high, std::max(high, plot.limits[0].at)) << round;
    EXPECT_GE(span.high - span.low, leastSpanOf(plot.quantity) - 1e-9) << round;
    if (low >= 0) {
      EXPECT_GE(span.low, 0) << round;
    }
  }
}

TEST(FittedSpan, ofNoQuantityIsTheData) {
  const AxisSpan span = fittedSpan({}, AxisSpan{3, 3.01});
  EXPECT_EQ(span.low, 3);
  EXPECT_EQ(span.high, 3.01);
}

TEST(PlotQuantity, isKnownOfEachUnitThatMeasuresHave) {
  for (const char* unit : {"", "N", "N·m", "mm", "mm/s", "°", "s", "cm²", "J", "%"})
    EXPECT_GT(leastSpanOf(quantityOfUnit(unit)), 0) << unit;
  EXPECT_EQ(quantityOfUnit("mm"), PlotQuantity::kDistance) << "a plot of depth says so itself";
  EXPECT_EQ(quantityOfUnit("kg"), PlotQuantity::kOther);
}

TEST(Plot, aCurveIsBrokenWhereAGapLiesBetweenItsColumns) {
  Plot plot;
  plot.from = 100;
  plot.to = 110;
  // ten columns of 1: gaps from column 1 to 4, within column 6, and from column 7 to the next
  plot.gaps = {{101.5, 104.5}, {106.2, 106.4}, {107.9, 108.1}};
  for (std::size_t left = 0; left + 1 < 10; ++left)
    EXPECT_EQ(isBroken(plot, left, left + 1, 10), (left >= 1 && left <= 3) || left == 7) << left;
  EXPECT_TRUE(isBroken(plot, 1, 4, 10));
  EXPECT_FALSE(isBroken(plot, 4, 7, 10)) << "what a column holds is not split";
  plot.gaps.clear();
  EXPECT_FALSE(isBroken(plot, 0, 9, 10));
}

TEST(PlotHeading, namesQuantityAndUnitAndNothingThatIsNotThere) {
  const auto heading = [](const char* title, const char* unit) {
    Plot plot;
    plot.title = title;
    plot.unit = unit;
    return headingOf(plot);
  };
  EXPECT_EQ(heading("force", "N"), "force, N");
  EXPECT_EQ(heading("layer", ""), "layer");
  EXPECT_EQ(heading("", "mm"), "mm");
  EXPECT_EQ(heading("", ""), "");
}

}  // namespace
}  // namespace needlelab
