/// Computes what the haptic thread remembers of cuts (CUT_MEMORY) from the samples that it gave, for the
/// recording's chunks, for viewers who come late, and for a window that lost samples: steps the engine along
/// them once more. The haptic thread knows nothing of them.
#pragma once

#include <cstdint>
#include <memory>

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

  /// Steps along the session's next sample.
  void follow(const GestureSample& sample);
  /// Returns the memory after the last sample, encoded (encodeCuts), if the tip is outside by more than the
  /// rounding of stored places: then who steps along the recording has it outside, too. Else nothing.
  [[nodiscard]] Bytes memory() const;
  /// Returns `memory` when viewers are due for it: after each exit, and once in a second of the loop. Else
  /// nothing.
  Bytes due();

 private:
  const SceneModel& model_;
  std::unique_ptr<SimState> state_;  // null: nothing to remember
  std::uint64_t tick_ = 0;           // of the last sample
  bool outside_ = false;             // clearly, at that sample
  bool left_ = false;                // an exit has not been told yet
  std::uint64_t due_tick_ = 0;
};

}  // namespace needlelab
