/// DIRECT: a spring from the surface to the tip, as the simplest simulators render a needle:
/// f = −K·max(0, x), limited by `step_at_layers` to the cutting force of the tip's layer (FORCE_MODEL.md,
/// "Axial models"). The force steps when the tip enters another layer; the model exists to show that.
#include <algorithm>
#include <array>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/layer_forces.h"
#include "common/haptics/spec_checker.h"

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

constexpr std::array<AxialField, 2> kDirectFields = {
    {{"stiffness_n_per_m", "Stiffness (Direct)", kStiffness,
      [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.direct.stiffness_N_per_m; }},
     {"step_at_layers", "", {}, [](SceneSpec& spec, std::size_t) -> SpecNumber {
        return &spec.direct.step_at_layers;
      }}}};

}  // namespace

extern const AxialEntry kDirectEntry;
constinit const AxialEntry kDirectEntry = {
    .model = AxialModel::kDirect,
    .label = "Direct",
    .short_name = "direct",
    .steps = &kDirectSteps,
    .renders = Direct::kRenders,
    .passes_membranes = true,
    .section = {.name = "direct", .fields = kDirectFields},
    .effectsWithNumbers =
        [](const SceneSpec& spec) {
          const bool cuts = !spec.direct.step_at_layers ||
                            std::any_of(spec.layers.begin(), spec.layers.end(),
                                        [](const LayerSpec& layer) { return layer.cutting_force_N > 0; });
          return cuts ? bitOf(Effect::kCutting) : EffectMask{0};
        },
    // the wall's stiffness, with a step at layers
    .derive = [](const SceneSpec& scene, SceneSpec& other) { deriveStiffness(scene, other.direct); },
    .compile =
        [](const SceneSpec& spec, SceneModel& model) {
          model.axial_stiffness_N_per_m = spec.direct.stiffness_N_per_m;
          model.step_at_layers = spec.direct.step_at_layers;
        }};

}  // namespace needlelab
