/// Fixed capacities and absolute bounds of the engine, with their reasons.
#pragma once

#include <cstddef>

namespace needlelab {

inline constexpr std::size_t kMaxLayers = 32;  ///< of a profile
inline constexpr double kMinRateHz = 50;  ///< slower than this the 100 ms speed window has fewer than 5 ticks
inline constexpr double kMaxRateHz = 40'000;  ///< the fastest loop in the literature (Choi and Tan)
/// Ring of past positions for the speed over 100 ms: 4,000 ticks at 40 kHz and the one before entry.
inline constexpr std::size_t kHistoryCapacity = 4096;
static_assert(kHistoryCapacity > static_cast<std::size_t>(kMaxRateHz / 10) + 1);

/// The greatest number of stations of a needle: bounds the state and the cost of a tick.
inline constexpr std::size_t kMaxNeedleStations = 128;

/// The greatest number of cuts that CUT_MEMORY remembers: bounds the state, its hash and the cost of a tick.
inline constexpr std::size_t kMaxCutTracks = 16;

}  // namespace needlelab
