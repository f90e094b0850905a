#include "common/haptics/tick.h"

namespace needlelab {

void step(const SceneModel& model, const TipSample& sample, SimState& state, StepReport& report) noexcept {
  model.step_function(model, sample, state, report);
}

void stepWithStages(const SceneModel& model, const TipSample& sample, SimState& state,
                    StepReport& report) noexcept {
  model.placed_step(model, sample, state, report);
  // outside, not finite, or started inside: no force
  report.stage_N.fill(0.0);
  if (report.layer < 0) return;
  if ((report.flags & kFlagEntry) != 0)
    for (StageNumbers& memory : state.stage) memory.fill(0.0);
  Vec3 force = report.wrench_W.force_N;
  for (std::uint32_t i = 0; i < model.stage_count; ++i)
    force = force + model.stages[i](model, sample, state, report);
  capForce(model, force, report);
  report.wrench_W.force_N = force;
}

void stepHeld(const SceneModel& model, const TipSample& sample, SimState& state,
              StepReport& report) noexcept {
  stepWithStages(model, model.hold(model, sample, state), state, report);
}

}  // namespace needlelab
