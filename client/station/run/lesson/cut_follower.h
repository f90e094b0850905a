/// Computes the haptic thread's memory of cuts (CUT_MEMORY) from its samples, by stepping the engine along
/// them again: for the recording's chunks, for viewers who join late, and for a window that lost samples. The
/// haptic thread is not involved.
#pragma once

#include <cstdint>
#include <memory>

#include "common/base/bytes.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// Thread: one. Does nothing in a scene without CUT_MEMORY. Costs one engine tick per sample. Samples that
/// the ring to the spool dropped, because the disk stalled for longer than its 16 s, are missing here as in
/// the recording.
class CutFollower {
 public:
  /// `model`: the session's scene; must outlive this object.
  explicit CutFollower(const SceneModel& model);

  /// Steps along the session's next sample.
  void follow(const GestureSample& sample);
  /// Returns the encoded memory (encodeCuts) after the last sample if the tip is outside by more than the
  /// rounding of stored positions, so that a replay of the recording also has it outside. Otherwise nothing.
  [[nodiscard]] Bytes memory() const;
  /// Returns `memory` when viewers need it: after each exit, and once per second of the loop. Otherwise
  /// nothing.
  Bytes due();

 private:
  const SceneModel& model_;
  std::unique_ptr<SimState> state_;  // null: nothing to remember
  std::uint64_t tick_ = 0;           // of the last sample
  bool outside_ = false;             // by a clear margin, at that sample
  bool left_ = false;                // an exit was not reported yet
  std::uint64_t due_tick_ = 0;
};

}  // namespace needlelab
