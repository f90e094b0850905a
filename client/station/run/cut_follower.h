/// Computes what the haptic thread remembers of cuts (CUT_MEMORY) from the samples that it gave, for viewers
/// who come late: steps the engine along them once more. The haptic thread knows nothing of viewers.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "common/base/bytes.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// Thread: one. In a scene without CUT_MEMORY it does nothing. Costs a tick of the engine for each sample.
/// Samples that the ring to the spool dropped, because the disk stood still for longer than its 16 s, are
/// missing here as they are in the recording.
class CutFollower {
 public:
  /// `model`: the session's scene; must outlive this object.
  explicit CutFollower(const SceneModel& model);

  /// Steps along the session's next samples. Returns the memory after the last of them, encoded (encodeCuts),
  /// if the tip is outside: after each exit, and once in a second of the loop. Else nothing.
  Bytes follow(std::span<const GestureSample> samples);

 private:
  const SceneModel& model_;
  std::unique_ptr<SimState> state_;  // null: nothing to remember
  std::uint64_t due_tick_ = 0;
};

}  // namespace needlelab
