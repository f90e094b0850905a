/// The cost of a tick: steps a scene through a prepared gesture, and counts instructions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "client/effect_cost/found_paths.h"
#include "common/base/result.h"
#include "common/base/time/clock.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Returns a gesture through all of the scene's layers, in a body to its first bone: in within 1 s, a hold of
/// 0.4 s, out within 1 s, with tremor and an offset of 0.2 mm from the straight line, the needle along the
/// surface normal. Ticks at `rate_hz`; only the first one is outside the tissue, so that the gesture can
/// repeat.
std::vector<TipSample> measuringGesture(const SceneSpec& scene, double rate_hz);

/// Steps `model` through the gesture repeatedly, as the station steps it. In a body the paths are made
/// before: finding them is another thread's work; each gesture begins with a new engine. Thread: one.
class TickRun {
 public:
  /// Both must outlive the run; `gesture` has at least one sample. `capped`: with the cap on, in a scene with
  /// PALPATION.
  TickRun(const SceneModel& model, const std::vector<TipSample>& gesture, bool capped = false);
  ~TickRun();
  TickRun(const TickRun&) = delete;
  TickRun& operator=(const TickRun&) = delete;

  void tick() {
    engine_->step(gesture_[next_], report_);
    keep(report_);
    if (++next_ == gesture_.size()) beginAgain();
  }
  /// The report of the last tick.
  [[nodiscard]] const StepReport& report() const { return report_; }

 private:
  void begin();
  void beginAgain();

  const SceneModel& model_;
  const std::vector<TipSample>& gesture_;
  bool capped_;
  std::unique_ptr<FoundPaths> paths_;  // null where there is no body
  std::unique_ptr<SceneEngine> engine_;
  StepReport report_;
  std::size_t next_ = 0;
};

// --- instructions, counted by valgrind's callgrind: the same on every run of the same binary, unlike time

/// Returns whether `valgrind` is on the PATH.
bool hasValgrind();

/// Marks the end of a part in the counted program: the count restarts at zero. Does nothing else.
void endCountedPart();

/// Runs `command` (program and arguments) under callgrind and returns the number of instructions in calls of
/// `needlelab::step` (including callees) between one `endCountedPart` and the next: one number per part.
/// Discards its output. Errors: kUnavailable without valgrind; kFailed with valgrind's message when the
/// program failed or did not make exactly `parts` parts.
Result<std::vector<std::uint64_t>> countStepInstructions(const std::vector<std::string>& command,
                                                         std::size_t parts);

/// As countStepInstructions, of another function: its name with its parameters, in which `*` is any text.
Result<std::vector<std::uint64_t>> countInstructions(const std::vector<std::string>& command,
                                                     std::size_t parts, const std::string& function);

/// Returns this program's own path, to run it again.
std::string ownProgram();

}  // namespace needlelab
