/// Some dozens of whole insertions by simulated hands, generated once; they feed a thousand stations.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/device/hand/hand.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"

namespace needlelab::test {

/// One insertion: free air, in, hold, inject, out, free air. 1 kHz; `tick` counts from 0, `time_ns` is 0.
using PoolGesture = std::vector<GestureSample>;

/// All gestures use the same scene, each with its own hand: speed, depth, tremor, hold and aspiration differ.
/// They begin and end at about the same place, so that they can follow each other. Read-only after
/// construction.
struct GesturePool {
  std::string profile_id, profile_json;  ///< canonical; the gestures' scene
  std::vector<PoolGesture> gestures;
};

/// Generates `count` gestures, the same for the same seed. Errors: those of the engine's closed loop.
Result<GesturePool> makeGesturePool(std::uint64_t seed, std::size_t count);

// The samples of one load station: reproducible, and different from every other station's.

inline constexpr std::int64_t kTick_ns = 1'000'000;
/// Offset between the clocks of two stations. Every run is shorter (2.7 h), so a time identifies its station.
inline constexpr std::int64_t kStationClock_ns = 10'000'000'000'000;

/// A seeded mix of the pool's gestures, with a displacement and times unique to this station. Depends only on
/// (pool, seed, station, tick). Thread: one (the mix grows on demand).
class StationStream {
 public:
  /// `pool` must outlive it and contain a gesture.
  StationStream(const GesturePool& pool, std::uint64_t seed, std::size_t station);

  /// Writes the samples of the ticks first, first + 1, … into `out`.
  void fill(std::uint64_t first_tick, std::span<GestureSample> out);

  /// The station's clock at the due time of that tick.
  [[nodiscard]] std::int64_t timeOf(std::uint64_t tick) const {
    return clock_ns_ + static_cast<std::int64_t>(tick) * kTick_ns;
  }
  /// The limb's placement: the displacement.
  [[nodiscard]] Vec3 placement_m() const { return placement_m_; }

 private:
  struct Part {
    const PoolGesture* gesture = nullptr;
    std::uint64_t end_tick = 0;  // the first tick after it
    std::size_t skip = 0;        // samples skipped at the gesture's beginning
  };
  std::size_t partOf(std::uint64_t tick);

  const GesturePool& pool_;
  HandRandom random_;
  std::uint64_t noise_seed_;
  std::int64_t clock_ns_;
  Vec3 placement_m_;
  std::vector<Part> parts_;
};

}  // namespace needlelab::test
