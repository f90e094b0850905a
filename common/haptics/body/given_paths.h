/// The station's paths for an engine that steps along its samples: each before the sample of its tick.
#pragma once

#include <cstdint>
#include <deque>

#include "common/base/bytes.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/body/path_snapshot.h"

namespace needlelab {

/// Thread: one at a time. Not for the haptic thread.
class GivenPaths {
 public:
  /// Takes a path before the sample of its tick is stepped. One whose tick does not ascend (a jump back in a
  /// replay) replaces all before.
  void take(const PathSnapshot& snapshot);
  /// Takes each path of a list (pathsIn). Safe for any bytes.
  void take(ByteView list);
  /// Whether no path waits for this tick or a later one.
  [[nodiscard]] bool noneFrom(std::uint64_t tick) const {
    return waiting_.empty() || waiting_.back().tick < tick;
  }
  /// Gives the engine the path of this tick, if there is one. Call before `stored` is stepped. The paths that
  /// count are that of an entry, and each new one in an insertion; another one, for readers that begin there,
  /// is of use only outside.
  void giveFor(std::uint64_t tick, const StoredTick& stored, SceneEngine& engine);
  /// Whether this insertion has a path of the station that was not taken. True before the first entry.
  [[nodiscard]] bool unknown() const { return unknown_; }
  /// Forgets everything but the paths for samples to come.
  void restart() { unknown_ = true; }

 private:
  std::deque<PathSnapshot> waiting_;  // ascending
  bool unknown_ = true;
};

}  // namespace needlelab
