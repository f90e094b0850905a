/// VOIGT: a spring and a damper side by side from the surface to the tip, the Kelvin-Voigt element that many
/// simulators use for soft tissue (e.g. Fung 1993, §2.11): f = min(0, −K x − B ẋ), it never pulls
/// (FORCE_MODEL.md, "Axial models"). ẋ is the difference over one tick, x = 0 at the tick before entry: a
/// quantised position causes force steps of B·quantum/T there; the model is here to show that, too.
#include <algorithm>

#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/axial_entry.h"

namespace needlelab {
namespace {

constexpr NumberRange kDamping{0, 1000};

struct Voigt {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr bool kHasWall = false;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    // uses stored positions, so that a turn of u does not count as motion; the zero before the entry tick is
    // one of them
    const double moved_m = state.x_history_m[state.ticks_inside & state.history_mask] -
                           state.x_history_m[(state.ticks_inside - 1) & state.history_mask];
    const double pressed_N =
        model.axial_stiffness_N_per_m * tick.x_m + model.axial_damping_Ns_per_m * (moved_m / model.period_s);
    return report.cutting_N = -std::max(0.0, pressed_N);
  }
};
constexpr StepTable kVoigtSteps = stepTable<Voigt>();

}  // namespace

constinit const AxialEntry kVoigtEntry = {
    &kVoigtSteps,
    [](const SceneSpec& spec, SpecChecker& check) {
      check.enter("voigt.");
      check.number("stiffness_n_per_m", spec.voigt.stiffness_N_per_m, kStiffness);
      check.number("damping_ns_per_m", spec.voigt.damping_Ns_per_m, kDamping);
    },
    [](const SceneSpec&) { return bitOf(Effect::kCutting); },
    [](const SceneSpec& spec, SceneModel& model) {
      model.axial_stiffness_N_per_m = spec.voigt.stiffness_N_per_m;
      model.axial_damping_Ns_per_m = spec.voigt.damping_Ns_per_m;
    }};

}  // namespace needlelab
