/// Some dozens of whole insertions by simulated hands, made once, from which a thousand stations are fed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab::test {

/// One insertion: free air, in, hold, inject, out, free air. 1 kHz; `tick` counts from 0, `time_ns` is 0.
using PoolGesture = std::vector<GestureSample>;

/// All of the same scene, each by a hand of its own: speed, depth, tremor, hold and aspiration differ. They
/// begin and end at about the same place, so that they can follow each other. Read-only once made.
struct GesturePool {
  std::string profile_id, profile_json;  ///< canonical; the scene that they were done in
  std::vector<PoolGesture> gestures;
};

/// `count` gestures, the same for the same seed. Errors: those of the engine's closed loop.
Result<GesturePool> makeGesturePool(std::uint64_t seed, std::size_t count);

}  // namespace needlelab::test
