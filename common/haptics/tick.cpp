#include "common/haptics/tick.h"

#include <cassert>

namespace needlelab {

void step(const SceneModel& model, const TipSample& sample, SimState& state, StepReport& report) noexcept {
  assert(model.step_function != nullptr && "compile() made the model");
  model.step_function(model, sample, state, report);
  assert(report.layer >= -1 && report.layer < static_cast<std::int32_t>(model.layer_count));
  assert(report.layer < 0 || (state.inside && state.ticks_inside > 0));
  assert(!(norm(report.wrench_W.force_N) > model.max_force_N * (1 + 1e-9)));
}

void stepWithStages(const SceneModel& model, const TipSample& sample, SimState& state,
                    StepReport& report) noexcept {
  assert(model.placed_step != nullptr && model.stage_count <= kMaxStages);
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
  assert(model.hold != nullptr);
  stepWithStages(model, model.hold(model, sample, state), state, report);
}

}  // namespace needlelab
