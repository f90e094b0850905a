/// What the stations and viewers of one run share.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "client/net/client.h"
#include "common/base/uuid.h"
#include "tests/load/gesture_pool.h"

namespace needlelab::test {

/// How one station is called and when its tick 0 is due.
struct StationPlan {
  std::string name, key;
  Uuid session{};
  /// This machine's steady clock; 0: not known yet. Set once, before the station's first frame.
  std::atomic<std::int64_t> start_ns{0};
};

/// Read-only while the run lasts, but for the atomics. Thread: any.
struct LoadShared {
  const GesturePool* pool = nullptr;
  std::uint64_t seed = 1;
  std::uint64_t ticks = 0;  ///< of each station
  ClientConfig client;      ///< without log-in
  std::vector<StationPlan> stations;
  /// Samples of a live frame, and of a chunk.
  static constexpr std::uint64_t kFrameTicks = 20, kChunkTicks = 1000;
};

}  // namespace needlelab::test
