/// Tests what a tick costs, from given durations: nothing here depends on the machine's times.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "client/sim/accuracy/row.h"
#include "client/sim/accuracy/tick_cost.h"

namespace needlelab {
namespace {

SingleTicks runOf(double hot_ns, double flushed_ns, double slept_ns) {
  return {std::vector<double>(1000, hot_ns), std::vector<double>(21, flushed_ns),
          std::vector<double>(1000, slept_ns)};
}

TEST(TickQuantiles, areThoseOfSingleTicks) {
  std::vector<double> ticks_ns;
  for (int i = 1; i <= 1000; ++i) ticks_ns.push_back(1001 - i);
  const TickQuantiles q = quantilesOf(ticks_ns);
  EXPECT_EQ(q.p50_ns, 500);
  EXPECT_EQ(q.p99_ns, 990);
  EXPECT_EQ(q.p999_ns, 999);
  EXPECT_EQ(quantilesOf({}).p999_ns, 0);
}

TEST(TickCost, isTheFlushedMedianLessAnEmptyCallsWithTheRangeOfItsRuns) {
  const std::vector<SingleTicks> runs = {runOf(50, 900, 300), runOf(50, 1000, 300), runOf(50, 980, 300),
                                         runOf(50, 1200, 300), runOf(50, 990, 300)};
  const std::vector<SingleTicks> empty = {runOf(20, 100, 60), runOf(20, 150, 60), runOf(20, 100, 60),
                                          runOf(20, 100, 60), runOf(20, 90, 60)};
  // 800, 850, 880, 1100 and 900
  const TickCost cost = tickCostOf(runs, empty);
  EXPECT_EQ(cost.cost_ns.value, 880);
  EXPECT_EQ(cost.cost_ns.low, 800);
  EXPECT_EQ(cost.cost_ns.high, 1100);
  EXPECT_EQ(cost.hot.p50_ns, 50);
  EXPECT_EQ(cost.hot_empty.p50_ns, 20);
  EXPECT_EQ(cost.slept_empty.p999_ns, 60);
  EXPECT_EQ(cost.runs, 5u);
  EXPECT_EQ(cost.flushed_count, 105u);
  EXPECT_EQ(tickCostOf({runOf(1, 80, 1)}, {runOf(1, 100, 1)}).cost_ns.value, 0) << "never below nothing";
}

TEST(TickCost, anIntervalRunsFromTheLeastToTheGreatestRun) {
  const CostInterval interval = intervalOf({70, 62, 66, 90, 64});
  EXPECT_EQ(interval.value, 66);
  EXPECT_EQ(interval.low, 62);
  EXPECT_EQ(interval.high, 90);
  EXPECT_EQ(intervalOf({}).high, 0);
}

TEST(TickCost, aSlowSingleTickIsInTheTailWhereAMeanOfItsBatchWouldHideIt) {
  std::vector<SingleTicks> runs(5, runOf(50, 900, 300));
  for (SingleTicks& run : runs) run.hot_ns[7] = run.hot_ns[8] = 20'000;  // two in a thousand
  const std::vector<SingleTicks> empty(5, runOf(20, 100, 60));
  const TickCost cost = tickCostOf(runs, empty);
  EXPECT_EQ(cost.hot.p999_ns, 20'000);
  EXPECT_EQ(cost.tail_ns, 20'000);
  AccuracyRow row;
  setCost(row, cost, 1000);
  EXPECT_TRUE(*row.fits_rate);
  setCost(row, cost, 60'000);
  EXPECT_FALSE(*row.fits_rate) << "a period of 17 µs";
  EXPECT_DOUBLE_EQ(*row.cpu_share, 800 * 60'000e-9) << "by the price, not by hot ticks";
  EXPECT_EQ(*row.median_ns, 30);
}

TEST(TickCost, oneDisturbedRunDecidesNoTail) {
  std::vector<SingleTicks> runs(5, runOf(50, 900, 300));
  std::fill(runs[2].slept_ns.begin(), runs[2].slept_ns.end(), 5e6);
  const TickCost cost = tickCostOf(runs, std::vector<SingleTicks>(5, runOf(20, 100, 60)));
  EXPECT_EQ(cost.slept.p999_ns, 5e6) << "shown";
  EXPECT_EQ(cost.tail_ns, 300) << "not judged";
}

TEST(MeasureTicks, timesEachTickAloneAndSpreadsThemOverTheGesture) {
  std::size_t first = 0, second = 0;
  const auto costs = measureTicks({{[&] { ++first; }, 100}, {[&] { ++second; }, 1}}, {2, 30, 4, 5});
  ASSERT_EQ(costs.size(), 2u);
  for (const TickCost& cost : costs) {
    EXPECT_EQ(cost.runs, 2u);
    EXPECT_EQ(cost.hot_count, 60u);
    EXPECT_EQ(cost.flushed_count, 8u);
    EXPECT_EQ(cost.slept_count, 10u);
  }
  // 100 to warm up and 30 hot; then 25 ticks to each of four, and 20 to each of five
  EXPECT_EQ(first, 2u * (100 + 30 + 4 * 25 + 5 * 20));
  EXPECT_EQ(second, 2u * (100 + 30 + 4 + 5));
}

}  // namespace
}  // namespace needlelab
