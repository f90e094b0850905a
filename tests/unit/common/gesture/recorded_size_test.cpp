/// Measures the bytes per sample over recordings of a hand (at most 8, clock columns apart).
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/unit/common/gesture/gesture_samples.h"
#include "tests/unit/common/gesture/recorded_gestures.h"

namespace needlelab {
namespace {

// chunks of one second, as the station writes them
std::size_t encodedBytes(const std::vector<GestureSample>& samples, const Resolution& resolution) {
  std::size_t bytes = 0;
  for (std::size_t at = 0; at < samples.size(); at += 1000)
    bytes += encodeChunk(resolution,
                         std::span(samples).subspan(at, std::min<std::size_t>(1000, samples.size() - at)))
                 .size();
  return bytes;
}

void addTickTimes(std::vector<GestureSample>& samples) {
  std::mt19937_64 random(1);
  for (GestureSample& s : samples) {
    s.device_ns = static_cast<std::int32_t>(8'000 + random() % 4'000);
    s.engine_ns = static_cast<std::int32_t>(30 + random() % 400);
  }
}
void addClockJitter(std::vector<GestureSample>& samples) {
  std::mt19937_64 random(2);
  for (GestureSample& s : samples)  // wake-ups about 0-20 µs late
    s.time_ns += static_cast<std::int64_t>((random() % 10'000) + (random() % 10'000));
}

// Prints and checks the gestures' sizes; `most`: bytes per sample in total.
void measureSizes(const test::Recordings& recordings, double most) {
  const auto gestures = test::recordedGestures(recordings);
  ASSERT_EQ(gestures.size(), 4u);
  double all_samples = 0, all_bytes = 0, all_times = 0, all_clock = 0, all_lossless = 0;
  std::printf("%-22s %8s %9s | bytes/sample: %6s %6s %6s %9s\n", recordings.name().c_str(), "samples",
              "in tissue", "values", "+times", "+clock", "lossless");
  for (const auto& gesture : gestures) {
    const auto count = static_cast<double>(gesture.samples.size());
    auto samples = gesture.samples;
    const auto values = static_cast<double>(encodedBytes(samples, Resolution::standard()));
    const auto lossless = static_cast<double>(encodedBytes(samples, Resolution::lossless()));
    addTickTimes(samples);
    const auto times = static_cast<double>(encodedBytes(samples, Resolution::standard()));
    addClockJitter(samples);
    const auto clock = static_cast<double>(encodedBytes(samples, Resolution::standard()));
    std::printf("%-22s %8.0f %8.1f%% | %20.3f %6.3f %6.3f %9.3f\n", gesture.name.c_str(), count,
                100 * gesture.share_in_tissue, values / count, times / count, clock / count,
                lossless / count);
    EXPECT_GT(gesture.share_in_tissue, 0.1)
        << gesture.name << " must meet the tissue, else it proves nothing";
    for (const GestureSample& s : gesture.samples)
      ASSERT_EQ(s.fault, 0) << gesture.name << ": forces must not be cut off by a fault";
    all_samples += count;
    all_bytes += values;
    all_times += times;
    all_clock += clock;
    all_lossless += lossless;
  }
  std::printf("%-22s %8.0f %9s | %20.3f %6.3f %6.3f %9.3f\n", "all", all_samples, "", all_bytes / all_samples,
              all_times / all_samples, all_clock / all_samples, all_lossless / all_samples);
  EXPECT_LE(all_bytes / all_samples, 8.0);  // the goal
  EXPECT_LE(all_bytes / all_samples, most) << recordings.name();
}

// The limits are the measured values with a margin: a change that costs more fails here.
TEST(RecordedSize, recordedHandsWithEngineForcesTakeFewBytes) {
  for (const test::Recordings& recordings : test::allRecordings())
    measureSizes(recordings, recordings.real ? 3.3 : 4.9);
}

}  // namespace
}  // namespace needlelab
