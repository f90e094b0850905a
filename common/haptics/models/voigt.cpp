/// VOIGT: a spring and a damper side by side from the surface to the tip, the Kelvin-Voigt element that many
/// simulators use for soft tissue (e.g. Fung 1993, §2.11): f = min(0, −K x − B ẋ), which never pulls
/// (FORCE_MODEL.md, "Axial models"). ẋ is the difference over one tick, with x = 0 at the tick before entry:
/// a quantised position causes force steps of B·quantum/T, which the model exists to show, too. With
/// `velocity_noise_m`, ẋ comes from an adaptive window (Janabi-Sharifi, Hayward and Chen 2000), as a careful
/// programmer would do it.
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/layer_forces.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr NumberRange kNoise{0, 1e-3};

// Movement per tick over the longest window of at most 16 ticks in which the line between the end points is
// within the noise of every position: long while the needle rests, short while it accelerates.
double adaptiveMove_m(const SceneModel& model, const SimState& state) {
  constexpr std::uint64_t kMostTicks = 16;
  const auto back_m = [&](std::uint64_t ticks) {
    return state.x_history_m[(state.ticks_inside - ticks) & state.history_mask];
  };
  const std::uint64_t most = std::min({kMostTicks, state.history_mask, state.ticks_inside});
  const double now_m = back_m(0);
  double moved_m = now_m - back_m(1);
  for (std::uint64_t n = 2; n <= most; ++n) {
    const double slope_m = (now_m - back_m(n)) / static_cast<double>(n);
    for (std::uint64_t j = 1; j < n; ++j)
      if (std::fabs(now_m - static_cast<double>(j) * slope_m - back_m(j)) > model.velocity_noise_m)
        return moved_m;
    moved_m = slope_m;
  }
  return moved_m;
}

struct Voigt {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr bool kHasWall = false;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    // uses stored positions, so that a turn of u does not count as motion; the zero before the entry tick is
    // stored, too
    assert(state.ticks_inside > 0 && model.period_s > 0.0);
    double moved_m = state.x_history_m[state.ticks_inside & state.history_mask] -
                     state.x_history_m[(state.ticks_inside - 1) & state.history_mask];
    if (model.velocity_noise_m > 0) moved_m = adaptiveMove_m(model, state);
    const double pressed_N =
        model.axial_stiffness_N_per_m * tick.x_m + model.axial_damping_Ns_per_m * (moved_m / model.period_s);
    return report.cutting_N = -std::max(0.0, pressed_N);
  }
};
constexpr StepTable kVoigtSteps = stepTable<Voigt>();

constexpr std::array<AxialField, 2> kVoigtFields = {
    {{"stiffness_n_per_m", "Stiffness (Voigt)", kStiffness,
      [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.voigt.stiffness_N_per_m; }},
     {"damping_ns_per_m", "Damping (Voigt)", {0, 1000}, [](SceneSpec& spec, std::size_t) -> SpecNumber {
        return &spec.voigt.damping_Ns_per_m;
      }}}};

}  // namespace

extern const AxialEntry kVoigtEntry;
constinit const AxialEntry kVoigtEntry = {
    .model = AxialModel::kVoigt,
    .label = "Voigt",
    .short_name = "Voigt",
    .steps = &kVoigtSteps,
    .renders = Voigt::kRenders,
    .passes_membranes = true,
    .feels_speed = true,
    .section = {.name = "voigt", .fields = kVoigtFields},
    .check =
        [](const SceneSpec& spec, SpecChecker& check) {
          check.enter("voigt.");
          check.number("velocity_noise_m", spec.voigt.velocity_noise_m, kNoise);
        },
    .effectsWithNumbers = [](const SceneSpec&) { return bitOf(Effect::kCutting); },
    // the wall's stiffness
    .derive = [](const SceneSpec& scene, SceneSpec& other) { deriveStiffness(scene, other.voigt); },
    .compile =
        [](const SceneSpec& spec, SceneModel& model) {
          model.axial_stiffness_N_per_m = spec.voigt.stiffness_N_per_m;
          model.axial_damping_Ns_per_m = spec.voigt.damping_Ns_per_m;
          model.velocity_noise_m = spec.voigt.velocity_noise_m;
        }};

}  // namespace needlelab
