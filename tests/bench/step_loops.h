/// Gestures for the benchmarks of the tick: an approach, and a loop that repeats in the tissue.
#pragma once

#include <memory>
#include <string>

#include "common/base/result.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {

/// Conditions on the ticks of a loop; without them the figure is of something else.
struct StepLoop {
  SceneSpec scene;
  double rate_hz = 1000;
  Motion way_in;
  Motion loop;                ///< ends where it begins
  std::uint32_t all_of = 0;   ///< StepFlag bits that every tick of the loop sets
  std::uint32_t none_of = 0;  ///< … and that none does
};

/// From 6 mm deep through the layers and back, with a hold, tremor of 20 µm, 0.5 mm beside the line: torque
/// and turn idle.
StepLoop layersLoop(const SceneSpec& scene, double rate_hz = 1000);
/// The needle tilted beyond the cone at every tick.
StepLoop torqueLoop();
/// The tip moves in a circle: the trajectory turns at every tick.
StepLoop turnLoop();
/// As above, further out: the cone limits every turn, which takes a bisection.
StepLoop heldTurnLoop();
/// A resting hand presses at the cone's limit: the cone allows no turn, or a small one with the tremor.
StepLoop pressedLoop();

/// A running loop, after the approach.
class LoopRun {
 public:
  /// Errors: as of `compile`; kFailed when a tick of the loop violates `all_of` or `none_of`.
  static Result<std::unique_ptr<LoopRun>> start(const StepLoop& loop);

  void tick() {
    step(model_, loop_[next_], *state_, report_);
    if (++next_ == loop_.size()) next_ = 0;
  }
  [[nodiscard]] const TipSample& sample() const { return loop_[next_]; }
  [[nodiscard]] const SceneModel& model() const { return model_; }
  [[nodiscard]] const StepReport& report() const { return report_; }
  [[nodiscard]] std::size_t ticks() const { return loop_.size(); }
  /// Flushes model, state, sample and report from all caches.
  void flush() const;

 private:
  LoopRun(SceneModel model, const Motion& loop);
  SceneModel model_;
  Motion loop_;
  std::unique_ptr<SimState> state_;
  StepReport report_;
  std::size_t next_ = 0;
};

}  // namespace needlelab::test
