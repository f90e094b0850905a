#include "client/instructor/model/latency_meter.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(LatencyMeter, countsFromDueToPresented) {
  LatencyMeter meter;
  EXPECT_EQ(meter.quantile_ms(0.99), 0);
  meter.fed(1'000'000'000);
  meter.fed(1'020'000'000);
  meter.presented(1'050'000'000);
  EXPECT_EQ(meter.count(), 2u);
  EXPECT_NEAR(meter.last_ms(), 30, 1e-9);
  EXPECT_NEAR(meter.quantile_ms(1), 50, 1e-4);
  meter.presented(2'000'000'000);
  EXPECT_EQ(meter.count(), 2u) << "nothing new was shown";
}

TEST(LatencyMeter, quantilesAreByRank) {
  LatencyMeter meter;
  for (int i = 1; i <= 100; ++i) {
    meter.fed(1'000'000'000);
    meter.presented(1'000'000'000 + i * 1'000'000);
  }
  EXPECT_NEAR(meter.quantile_ms(0.5), 50, 1e-4);
  EXPECT_NEAR(meter.quantile_ms(0.99), 99, 1e-4);
}

TEST(LatencyMeter, theNewestAreKept) {
  LatencyMeter meter;
  for (std::size_t i = 0; i < LatencyMeter::kKept; ++i) {
    meter.fed(1);
    meter.presented(1'000'000'001);
  }
  for (std::size_t i = 0; i < LatencyMeter::kKept; ++i) {
    meter.fed(1);
    meter.presented(2'000'001);
  }
  EXPECT_NEAR(meter.quantile_ms(1), 2, 1e-4);
}

TEST(LatencyMeter, whatIsNotShownDoesNotCount) {
  LatencyMeter meter;
  meter.fed(0);  // a station without a clock
  meter.fed(5);
  meter.discard();
  meter.presented(1'000);
  EXPECT_EQ(meter.count(), 0u);
}

}  // namespace
}  // namespace needlelab
