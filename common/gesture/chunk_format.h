/// Constants of FORMAT.md for the encoder and the decoder of chunks. Internal to common/gesture.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "common/gesture/chunk.h"

namespace needlelab::chunk_format {

inline constexpr std::array<std::uint8_t, 4> kMagic{'N', 'L', 'G', 'C'};
inline constexpr std::uint8_t kVersion = 1;           ///< without a cut memory
inline constexpr std::uint8_t kVersionWithCuts = 2;   ///< with one, after the steps
inline constexpr std::uint8_t kVersionWithPaths = 3;  ///< with a cut memory, which may be empty, and paths
inline constexpr std::size_t kFixedHeaderBytes = 44;  ///< up to and including the mask of raw columns
inline constexpr std::size_t kCrcBytes = 4;
inline constexpr std::size_t kCutsHeadBytes = 2;   ///< the cut memory's length field
inline constexpr std::size_t kPathsHeadBytes = 2;  ///< the paths' length field
inline constexpr std::size_t kBlock = 32;          ///< rows per block

/// The coding of the resolution in the header. Append-only.
enum ResolutionCode : std::uint8_t {
  kResolutionListed = 0,
  kResolutionStandard = 1,
  kResolutionLossless = 2
};

/// Columns in the order of the bytes; also bits of a block's mask and of the mask of raw columns.
/// Append-only.
enum Column : std::uint8_t {
  kTick = 0,
  kTime = 1,
  kFirstReal = 2,  ///< the doubles: p 2-4, q 5-8, speed 9, force 10-12, torque 13-15, wall 16-18, insertion,
                   ///< lateral, plunger
  kWall = 16,
  kLastReal = 21,
  kDeviceTime = 22,
  kEngineTime = 23,
  kFlagsLow = 24,
  kFlagsHigh = 25,
  kButtons = 26,
  kLayer = 27,
  kPhase = 28,
  kFault = 29,
  kWallPresence = 30,
  kColumnCount = 31,
};
inline constexpr std::size_t kRealCount = 20;
inline constexpr std::uint32_t kRealMask = ((1u << kRealCount) - 1) << kFirstReal;
/// Columns that always have 64 bits: the two clocks.
inline constexpr std::uint32_t kClockMask = (1u << kTick) | (1u << kTime);

/// The step of every real column, in column order.
inline std::array<double, kRealCount> realSteps(const Resolution& r) {
  const double m = r.length_m, q = r.quaternion, f = r.force_N, t = r.torque_Nm;
  return {m, m, m, q, q, q, q, r.speed_mps, f, f, f, t, t, t, m, m, m, m, m, q};
}

/// Offsets of the real columns in a sample: the code reads and writes column by column, with the sample's
/// size as stride.
inline constexpr std::array<std::size_t, kRealCount> kRealOffset = [] {
  std::array<std::size_t, kRealCount> offsets{};
  std::size_t c = 0;
  const auto add = [&](std::size_t offset, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) offsets[c++] = offset + k * sizeof(double);
  };
  add(offsetof(GestureSample, p_WT_m), 3);
  add(offsetof(GestureSample, q_WT), 4);
  add(offsetof(GestureSample, speed_mps), 1);
  add(offsetof(GestureSample, force_W_N), 3);
  add(offsetof(GestureSample, torque_W_Nm), 3);
  add(offsetof(GestureSample, wall_W_m), 3);
  add(offsetof(GestureSample, insertion_m), 1);
  add(offsetof(GestureSample, lateral_error_m), 1);
  add(offsetof(GestureSample, plunger), 1);
  return offsets;
}();

/// Raw bits of a double as an integer that sorts like the double, so that neighbours differ by little. The
/// mapping is its own inverse: it flips the low 63 bits when the sign is set.
inline std::uint64_t flipOrder(std::uint64_t bits) {
  return bits ^ (static_cast<std::uint64_t>(static_cast<std::int64_t>(bits) >> 63) >> 1);
}
inline std::uint64_t orderedBits(double value) {
  return flipOrder(std::bit_cast<std::uint64_t>(value));
}
inline double fromOrderedBits(std::uint64_t ordered) {
  return std::bit_cast<double>(flipOrder(ordered));
}

/// Steps of the tick's device and engine time, in whole nanoseconds.
inline std::int64_t timeStepNs(const Resolution& r) {
  const double ns = r.time_s * 1e9;
  return ns < 1.5 ? 1 : static_cast<std::int64_t>(ns + 0.5);
}

/// Mask of the columns that the resolution makes raw.
inline std::uint32_t declaredRaw(const Resolution& resolution) {
  const auto steps = realSteps(resolution);
  std::uint32_t mask = 0;
  for (std::size_t c = 0; c < kRealCount; ++c)
    if (steps[c] == 0) mask |= 1u << (kFirstReal + c);
  return mask;
}

}  // namespace needlelab::chunk_format
