/// Steps a scene through a prepared gesture, to measure the cost of a tick.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "common/base/time/clock.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// Returns a gesture through all of the scene's layers: in within 1 s, a hold of 0.4 s, out within 1 s, with
/// tremor and an offset of 0.2 mm from the straight line, the needle along the surface normal. Ticks at
/// `rate_hz`; only the first one is outside the tissue, so that the gesture can repeat.
std::vector<TipSample> measuringGesture(const SceneSpec& scene, double rate_hz);

/// Steps `model` through the gesture repeatedly. Thread: one.
class TickRun {
 public:
  /// Both must outlive the run; `gesture` has at least one sample.
  TickRun(const SceneModel& model, const std::vector<TipSample>& gesture);

  void tick() {
    step(model_, gesture_[next_], *state_, report_);
    keep(report_);
    if (++next_ == gesture_.size()) next_ = 0;
  }
  /// The report of the last tick.
  [[nodiscard]] const StepReport& report() const { return report_; }

 private:
  const SceneModel& model_;
  const std::vector<TipSample>& gesture_;
  std::unique_ptr<SimState> state_;
  StepReport report_;
  std::size_t next_ = 0;
};

}  // namespace needlelab
