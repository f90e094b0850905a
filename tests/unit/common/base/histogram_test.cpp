#include "common/base/histogram.h"

#include <gtest/gtest.h>

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
  EXPECT_DOUBLE_EQ(seen.quantile(0.99), 15);  // 19.9 by the bucket, but nothing was above 15
  seen.add(200);
  EXPECT_DOUBLE_EQ(seen.quantile(1), 200);
}

TEST(Histogram, theTablesAscend) {
  EXPECT_TRUE(std::is_sorted(kDurationBoundsNs.begin(), kDurationBoundsNs.end()));
  EXPECT_TRUE(std::is_sorted(kCountBounds.begin(), kCountBounds.end()));
}

}  // namespace
}  // namespace needlelab
