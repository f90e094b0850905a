/// Computes what the haptic thread's engine remembers from its samples, by stepping the engine along them
/// again: the cuts (CUT_MEMORY), and in a body the paths. For the recording's chunks, for viewers who join
/// late, and for a window that lost samples. The haptic thread is not involved.
#pragma once

#include <cstdint>
#include <memory>

#include "common/base/bytes.h"
#include "common/gesture/sample.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// Thread: one. Does nothing in a scene that has neither CUT_MEMORY nor a body. Costs one engine tick per
/// sample; in a body also the paths, which it makes in place. Samples that the ring to the spool dropped,
/// because the disk stalled for longer than its 16 s, are missing here as in the recording.
class MemoryFollower {
 public:
  /// `model`: the session's scene; must outlive this object.
  explicit MemoryFollower(const SceneModel& model);

  /// Steps along the session's next sample.
  void follow(const GestureSample& sample);

  /// Returns the encoded memory of cuts (encodeCuts) after the last sample if the tip is outside by more than
  /// the rounding of stored positions, so that a replay of the recording also has it outside. Otherwise
  /// nothing.
  [[nodiscard]] Bytes cuts() const;
  /// Returns `cuts` when viewers need them: after each exit, and once per second of the loop. Otherwise
  /// nothing.
  Bytes cutsDue();

  /// Returns the path (a list of one, appendPath) with which the last sample was stepped, if it began an
  /// insertion or, within one, is the first with that path; also if `anyway` and there is a path: a reader
  /// may begin at this sample. Otherwise nothing. Also nothing once the engine here has decided otherwise
  /// than the station's, because samples are missing: its paths are then not the station's.
  [[nodiscard]] Bytes path(bool anyway) const;
  /// Returns the paths of the samples since the last call (a list) for viewers, with the one in use once per
  /// second of the loop.
  Bytes pathsDue();

 private:
  [[nodiscard]] bool remembersCuts() const { return engine_ && model_.isLive(Effect::kCutMemory); }
  void judgePath(const GestureSample& sample, const StepReport& report);

  const SceneModel& model_;
  std::unique_ptr<SceneEngine> engine_;  // null: nothing to remember
  std::uint64_t tick_ = 0;               // of the last sample
  // the cuts
  bool outside_ = false;  // by a clear margin, at that sample
  bool left_ = false;     // an exit was not reported yet
  std::uint64_t due_tick_ = 0;
  // the paths
  bool in_fault_ = false;      // at that sample
  bool path_begins_ = false;   // at that sample, a path that readers need
  bool path_differs_ = false;  // from the station's, from some sample on
  Bytes paths_;                // since the last pathsDue()
  std::uint64_t path_due_tick_ = 0;
};

}  // namespace needlelab
