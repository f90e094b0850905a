#include "server/live/decimator.h"

#include <gtest/gtest.h>

#include <vector>

namespace needlelab {
namespace {

std::vector<GestureSample> samplesAt(double rate_hz, double seconds, std::int64_t start_ns = 12345) {
  std::vector<GestureSample> samples(static_cast<std::size_t>(rate_hz * seconds));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = i;
    samples[i].time_ns = start_ns + static_cast<std::int64_t>(static_cast<double>(i) * 1e9 / rate_hz);
  }
  return samples;
}

TEST(Decimator, theRateComesOutWhateverTheLoopsRate) {
  for (const double loop_hz : {250.0, 1000.0, 4000.0}) {
    for (const double wanted_hz : {1.0, 30.0, 60.0, 100.0}) {
      Decimator decimator(wanted_hz);
      const auto samples = samplesAt(loop_hz, 10);
      std::size_t kept = 0;
      // in frames of 20
      for (std::size_t at = 0; at < samples.size(); at += 20) {
        kept += decimator.keep(std::span(samples).subspan(at, std::min<std::size_t>(20, samples.size() - at)))
                    .size();
      }
      EXPECT_NEAR(static_cast<double>(kept), 10 * wanted_hz, 1) << loop_hz << " " << wanted_hz;
    }
  }
}

TEST(Decimator, aRateAboveTheLoopsKeepsAll) {
  Decimator decimator(5000);
  EXPECT_EQ(decimator.keep(samplesAt(1000, 1)).size(), 1000u);
}

TEST(Decimator, aPauseIsNotCaughtUpByABurst) {
  Decimator decimator(10);
  EXPECT_EQ(decimator.keep(samplesAt(1000, 1, 0)).size(), 10u);
  // an hour later
  EXPECT_LE(decimator.keep(samplesAt(1000, 1, 3'600'000'000'000)).size(), 10u);
}

TEST(Decimator, aClockThatStartsAgainIsFollowed) {
  Decimator decimator(10);
  (void)decimator.keep(samplesAt(1000, 1, 1'000'000'000'000));
  EXPECT_EQ(decimator.keep(samplesAt(1000, 1, 5)).size(), 10u);
}

TEST(Decimator, hostileTimesDoNoHarm) {
  std::vector<GestureSample> samples(4);
  samples[0].time_ns = INT64_MIN;
  samples[1].time_ns = INT64_MAX;
  samples[2].time_ns = INT64_MIN;
  samples[3].time_ns = 0;
  Decimator decimator(1e6);
  EXPECT_LE(decimator.keep(samples).size(), 4u);
}

}  // namespace
}  // namespace needlelab
