/// DIRECT: a spring from the surface to the tip, as the simplest simulators render a needle:
/// f = −K·max(0, x), limited by `step_at_layers` to the cutting force of the tip's layer (FORCE_MODEL.md,
/// "Axial models"). The force steps when the tip enters another layer; the model exists to show that.
#include <algorithm>

#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/axial_entry.h"

namespace needlelab {
namespace {

struct Direct {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr bool kHasWall = false;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    double pressed_N = model.axial_stiffness_N_per_m * std::max(0.0, tick.x_m);
    if (model.step_at_layers) pressed_N = std::min(pressed_N, model.layers[state.layer].cutting_force_N);
    return report.cutting_N = -pressed_N;
  }
};
constexpr StepTable kDirectSteps = stepTable<Direct>();

}  // namespace

constinit const AxialEntry kDirectEntry = {
    &kDirectSteps,
    [](const SceneSpec& spec, SpecChecker& check) {
      check.enter("direct.");
      check.number("stiffness_n_per_m", spec.direct.stiffness_N_per_m, kStiffness);
    },
    [](const SceneSpec& spec) {
      return spec.direct.step_at_layers ? effectsOfLayers(spec) & bitOf(Effect::kCutting)
                                        : bitOf(Effect::kCutting);
    },
    [](const SceneSpec& spec, SceneModel& model) {
      model.axial_stiffness_N_per_m = spec.direct.stiffness_N_per_m;
      model.step_at_layers = spec.direct.step_at_layers;
    }};

}  // namespace needlelab
