#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include "common/base/histogram.h"

namespace needlelab {
namespace {

constexpr std::array<std::int64_t, 3> kBounds = {10, 20, 50};
using Small = Histogram<kBounds>;

TEST(Histogram, aValueOnABoundBelongsBelowIt) {
  Small seen;
  for (const std::int64_t value : {-1, 0, 10, 11, 20, 50, 51, 1000}) seen.add(value);
  EXPECT_EQ(seen.buckets(), (std::array<std::uint64_t, 4>{3, 2, 1, 2}));
  EXPECT_EQ(seen.count(), 8u);
  EXPECT_EQ(seen.sum(), 1141);
  EXPECT_EQ(seen.max(), 1000);
}

TEST(Histogram, quantilesAreStraightWithinABucketAndNeverAboveTheGreatest) {
  Small seen;
  EXPECT_EQ(seen.quantile(0.5), 0);
  for (int i = 0; i < 100; ++i) seen.add(15);
  EXPECT_DOUBLE_EQ(seen.quantile(0.25), 12.5);
  EXPECT_DOUBLE_EQ(seen.quantile(0.99), 15);  // the bucket says 19.9, but no value is above 15
  seen.add(200);
  EXPECT_DOUBLE_EQ(seen.quantile(1), 200);
}

TEST(Histogram, theTablesAscend) {
  EXPECT_TRUE(std::is_sorted(kDurationBoundsNs.begin(), kDurationBoundsNs.end()));
  EXPECT_TRUE(std::is_sorted(kCountBounds.begin(), kCountBounds.end()));
}

TEST(LatencyHistogram, quantilesAreAtMostOneBucketAboveTheSortedOnes) {
  std::mt19937_64 random(7);
  LatencyHistogram histogram;
  std::vector<std::int64_t> all;
  for (int i = 0; i < 20'000; ++i) {
    // from ns to seconds
    const auto value = static_cast<std::int64_t>(std::exp2(static_cast<double>(random() % 30'000) / 1000));
    all.push_back(value);
    histogram.add(value);
  }
  std::sort(all.begin(), all.end());
  for (const double q : {0.001, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto exact = static_cast<double>(all[static_cast<std::size_t>(std::ceil(q * 20'000)) - 1]);
    const auto found = static_cast<double>(histogram.quantile_ns(q));
    EXPECT_GE(found, exact) << q;
    EXPECT_LE(found, exact * (1 + 1.0 / 32) + 1) << q;
  }
  EXPECT_EQ(histogram.max_ns(), all.back());
  EXPECT_EQ(histogram.total(), 20'000u);
}

TEST(LatencyHistogram, extremesFindTheirPlace) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile_ns(0.5), 0);
  histogram.add(-5);
  histogram.add(std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(histogram.total(), 2u);
  EXPECT_EQ(histogram.quantile_ns(0.5), 0);
  EXPECT_EQ(histogram.quantile_ns(1.0), (std::int64_t{1} << 40) - 1);
}

TEST(LatencyHistogram, oneAddedToAnotherIsAsIfAllWereInOne) {
  LatencyHistogram all, one, other;
  for (std::int64_t i = 0; i < 1000; ++i) {
    all.add(i * i);
    (i % 3 == 0 ? one : other).add(i * i);
  }
  one.add(other);
  const LatencyHistogram copy = one;
  EXPECT_EQ(copy.total(), 1000u);
  EXPECT_EQ(copy.max_ns(), all.max_ns());
  for (const double q : {0.01, 0.5, 0.99}) EXPECT_EQ(copy.quantile_ns(q), all.quantile_ns(q));
}

TEST(LatencyHistogram, concurrentReadersSeeWholeGrowingCounts) {
  LatencyHistogram histogram;
  std::atomic<bool> done{false};
  std::thread reader([&] {
    std::uint64_t before = 0;
    while (!done.load()) {
      const LatencyQuantiles q = histogram.quantiles();
      ASSERT_GE(q.total, before);
      ASSERT_LE(q.p50_ns, q.p99_ns);
      ASSERT_LE(q.p99_ns, 1000);
      before = q.total;
    }
  });
  for (int i = 0; i < 200'000; ++i) histogram.add(i % 1000);
  done.store(true);
  reader.join();
  EXPECT_EQ(histogram.total(), 200'000u);
  EXPECT_EQ(histogram.max_ns(), 999);
}

TEST(LatencyHistogram, smallDurationsAreExact) {
  for (std::int64_t value = 0; value < 64; ++value) {
    LatencyHistogram histogram;
    histogram.add(value);
    EXPECT_EQ(histogram.quantile_ns(0.5), value);
  }
}

}  // namespace

}  // namespace needlelab
