#include "common/haptics/engine.h"

namespace needlelab {

void step(const SceneModel& model, const TipSample& sample, SimState& state, StepReport& report) noexcept {
  model.step_function(model, sample, state, report);
}

}  // namespace needlelab
