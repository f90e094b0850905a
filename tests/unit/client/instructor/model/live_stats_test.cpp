#include "client/instructor/model/live_stats.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

pb::LiveFrame frame(std::uint64_t seq, std::int64_t capture_unix_ns = 0) {
  pb::LiveFrame f;
  f.set_frame_seq(seq);
  f.set_capture_unix_ns(capture_unix_ns);
  return f;
}

TEST(LiveStats, aGapInTheNumbersIsALoss) {
  LiveStats stats;
  for (const std::uint64_t seq : {10, 11, 14, 15, 20}) stats.add(frame(seq), 20, 0);
  EXPECT_EQ(stats.frames(), 5u);
  EXPECT_EQ(stats.samples(), 100u);
  EXPECT_EQ(stats.dropped(), 2u + 4u);
}

TEST(LiveStats, aStationThatStartsAgainIsNoLoss) {
  LiveStats stats;
  for (const std::uint64_t seq : {1000, 0, 1}) stats.add(frame(seq), 20, 0);
  stats.streamRestarts();
  stats.add(frame(500), 20, 0);
  EXPECT_EQ(stats.dropped(), 0u);
}

TEST(LiveStats, quantilesAreThoseOfTheLatencies) {
  LiveStats stats;
  EXPECT_EQ(stats.latencyMs(0.5), 0);
  // 1 … 1000 ms in a scrambled order (347 and 1000 have no common factor)
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const auto ms = static_cast<std::int64_t>(i * 347 % 1000 + 1);
    stats.add(frame(i, 5'000'000'000), 20, 5'000'000'000 + ms * 1'000'000);
  }
  EXPECT_NEAR(stats.latencyMs(0.5), 500, 1e-3);
  EXPECT_NEAR(stats.latencyMs(0.99), 990, 1e-3);
  EXPECT_NEAR(stats.latencyMs(0), 1, 1e-3);
  EXPECT_NEAR(stats.latencyMs(1), 1000, 1e-3);
}

}  // namespace
}  // namespace needlelab
