/// Samples for the tests of common/gesture: made from a seed, equal on every machine.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "common/gesture/sample.h"

namespace needlelab::test {

inline double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
}

/// A plausible gesture at 1 kHz: smooth path, rests, wall contact for part of it.
inline std::vector<GestureSample> smoothGesture(std::size_t count, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::vector<GestureSample> samples(count);
  double phase = 0;
  for (std::size_t i = 0; i < count; ++i) {
    GestureSample& s = samples[i];
    const double t = static_cast<double>(i) * 1e-3;
    if (std::fmod(t, 0.5) < 0.3) phase += 0.003;  // moves for 0.3 s, rests for 0.2 s
    s.tick = 1000 + i;
    s.time_ns = 123'456'789'000 + static_cast<std::int64_t>(i) * 1'000'000 +
                static_cast<std::int64_t>(random() % 40'000);
    s.p_WT_m[0] = 0.5 + 0.05 * std::sin(phase);
    s.p_WT_m[1] = -0.1 + 0.03 * std::cos(1.7 * phase);
    s.p_WT_m[2] = 0.2 - 0.04 * std::sin(0.6 * phase);
    const double half = 0.5 * (0.4 + 0.2 * std::sin(phase));
    s.q_WT[0] = std::sin(half) * 0.6;
    s.q_WT[1] = std::sin(half) * -0.8;
    s.q_WT[2] = 0;
    s.q_WT[3] = std::cos(half);
    if (std::sin(phase) > 0) {
      s.layer = static_cast<std::int8_t>(std::sin(phase) * 5);
      s.phase = 1;
      s.speed_mps = 0.02 * std::cos(phase);
      for (int k = 0; k < 3; ++k) {
        s.wall_W_m[k] = s.p_WT_m[k] + 0.002;
        s.force_W_N[k] = 2.5 * std::sin(phase + k);
        s.torque_W_Nm[k] = 0.05 * std::cos(phase + k);
      }
      s.insertion_m = 0.03 * std::sin(phase);
      s.lateral_error_m = 0.001 * std::fabs(std::cos(phase));
    }
    s.plunger = phase > 2 ? 1 : phase / 2;
    s.device_ns = 20'000 + static_cast<std::int32_t>(random() % 5'000);
    s.engine_ns = 40;
    s.buttons = phase > 2 ? 1 : 0;
    s.flags = s.layer == 3 ? 1u << 17 : 0;
  }
  return samples;
}

/// Random bits in every field, including NaN, infinities and denormals.
inline std::vector<GestureSample> anySamples(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<GestureSample> samples(count);
  for (GestureSample& s : samples) {
    std::uint64_t words[sizeof(GestureSample) / 8];
    for (auto& word : words) word = random();
    std::memcpy(&s, words, sizeof s);
  }
  return samples;
}

/// |stored − given| ≤ half a step; `slack`: allowance for the rounding of doubles, as a share of a step.
inline bool within(double stored, double given, double step) {
  if (std::isnan(given)) return std::isnan(stored);
  return std::fabs(stored - given) <= 0.5 * step * (1 + 1e-6);
}

inline bool sameBits(double a, double b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// The chunk with a checksum that matches its current bytes.
inline Bytes withGoodCrc(Bytes chunk) {
  const std::uint32_t crc = crc32c(ByteView(chunk).first(chunk.size() - 4));
  std::memcpy(chunk.data() + chunk.size() - 4, &crc, 4);
  return chunk;
}

}  // namespace needlelab::test
