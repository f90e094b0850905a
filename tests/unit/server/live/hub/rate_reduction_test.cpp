#include "server/live/hub/rate_reduction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "common/gesture/chunk.h"

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

TEST(ReducedRates, anAskedRateIsRoundedDownToOneOfSixteen) {
  EXPECT_EQ(kReducedRates_hz.size(), 16u);
  EXPECT_TRUE(std::is_sorted(kReducedRates_hz.begin(), kReducedRates_hz.end()));
  for (const double rate_hz : kReducedRates_hz) EXPECT_EQ(reducedRateOf(rate_hz), rate_hz);
  EXPECT_EQ(reducedRateOf(59.9), 30);
  EXPECT_EQ(reducedRateOf(24.999), 10);
  EXPECT_EQ(reducedRateOf(1.5), 1);
  EXPECT_EQ(reducedRateOf(1e6), 5000);
  EXPECT_EQ(reducedRateOf(1e-9), 0.1) << "the least";
}

TEST(RateReduction, givesTheRateForAnyLoopRate) {
  for (const double loop_hz : {250.0, 1000.0, 4000.0}) {
    for (const double wanted_hz : {1.0, 30.0, 60.0, 100.0}) {
      RateReducer reducer(wanted_hz);
      const auto samples = samplesAt(loop_hz, 10);
      std::size_t kept = 0;
      // in frames of 20
      for (std::size_t at = 0; at < samples.size(); at += 20) {
        kept += reducer.keep(std::span(samples).subspan(at, std::min<std::size_t>(20, samples.size() - at)))
                    .size();
      }
      EXPECT_NEAR(static_cast<double>(kept), 10 * wanted_hz, 1) << loop_hz << " " << wanted_hz;
    }
  }
}

TEST(RateReduction, aRateAboveTheLoopsKeepsAll) {
  RateReducer reducer(5000);
  EXPECT_EQ(reducer.keep(samplesAt(1000, 1)).size(), 1000u);
}

TEST(RateReduction, aPauseIsNotCaughtUpByABurst) {
  RateReducer reducer(10);
  EXPECT_EQ(reducer.keep(samplesAt(1000, 1, 0)).size(), 10u);
  // an hour later
  EXPECT_LE(reducer.keep(samplesAt(1000, 1, 3'600'000'000'000)).size(), 10u);
}

TEST(RateReduction, aClockThatStartsAgainIsFollowed) {
  RateReducer reducer(10);
  (void)reducer.keep(samplesAt(1000, 1, 1'000'000'000'000));
  EXPECT_EQ(reducer.keep(samplesAt(1000, 1, 5)).size(), 10u);
}

TEST(RateReduction, hostileTimesDoNoHarm) {
  std::vector<GestureSample> samples(4);
  samples[0].time_ns = INT64_MIN;
  samples[1].time_ns = INT64_MAX;
  samples[2].time_ns = INT64_MIN;
  samples[3].time_ns = 0;
  RateReducer reducer(1e6);
  EXPECT_LE(reducer.keep(samples).size(), 4u);
}

/// The frame with these samples.
struct Given {
  explicit Given(std::span<const GestureSample> samples, std::uint64_t number = 0)
      : data(encodeChunk(Resolution::standard(), samples)) {
    frame.data = textOf(data);
    frame.frame_seq = number;
  }
  Bytes data;
  LiveFrameView frame;
};

pb::LiveFrame sent(const Frame& frame) {
  return decodeFrame(viewOf(*frame))->live_frame();
}

TEST(ReducedFrames, areOfTheStationsNameAndNumberedWithItsGaps) {
  ReducedFrames reduced(100);
  std::vector<std::uint64_t> numbers;
  for (const std::uint64_t number : {7u, 8u, 11u}) {
    // each one second after the previous one
    const auto later = samplesAt(1000, 0.02, static_cast<std::int64_t>(number) * 1'000'000'000);
    const Given given(later, number);
    LiveSamples read(given.frame.data);
    const Frame made = reduced.next(given.frame, read, "bench-1");
    ASSERT_NE(made, nullptr);
    EXPECT_EQ(sent(made).station(), "bench-1");
    EXPECT_EQ(decodeChunk(viewOf(sent(made).data()))->size(), 2u) << "20 ms at 100 Hz";
    numbers.push_back(sent(made).frame_seq());
  }
  EXPECT_EQ(numbers, (std::vector<std::uint64_t>{0, 1, 4})) << "9 and 10 were lost";
}

TEST(ReducedFrames, aboveTheStationsRateItsBytesPassUnchanged) {
  ReducedFrames reduced(5000);
  const Given given(samplesAt(1000, 0.02), 3);
  LiveSamples read(given.frame.data);
  const Frame made = reduced.next(given.frame, read, "bench-1");
  ASSERT_NE(made, nullptr);
  EXPECT_EQ(sent(made).data(), given.frame.data);
}

TEST(ReducedFrames, memoryOfTheCutAndPathsGoOnWithAllSamplesOnly) {
  for (const double rate_hz : {5000.0, 100.0}) {
    ReducedFrames reduced(rate_hz);
    Given given(samplesAt(1000, 0.02), 3);
    given.frame.cut_memory = "cuts";
    given.frame.paths = "paths";
    LiveSamples read(given.frame.data);
    const Frame made = reduced.next(given.frame, read, "bench-1");
    ASSERT_NE(made, nullptr);
    EXPECT_EQ(sent(made).cut_memory(), rate_hz > 1000 ? "cuts" : "");
    EXPECT_EQ(sent(made).paths(), rate_hz > 1000 ? "paths" : "");
  }
}

TEST(ReducedFrames, bytesThatAreNoChunkGiveNone) {
  ReducedFrames reduced(25);
  LiveFrameView frame;
  frame.data = "no chunk at all";
  LiveSamples read(frame.data);
  EXPECT_FALSE(read.decoded()) << "no one has asked";
  EXPECT_EQ(reduced.next(frame, read, "bench-1"), nullptr);
  EXPECT_TRUE(read.decoded());
}

}  // namespace
}  // namespace needlelab
