#include "common/haptics/effects/shaft_friction.h"

#include <algorithm>
#include <array>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr std::array<EffectField, 1> kFrictionFields = {
    {{"stiffness_n_per_m", "Friction stiffness", kStiffness, 140,
      [](SceneSpec& spec) -> double& { return spec.friction_stiffness_N_per_m; }}}};

}  // namespace

extern const EffectEntry kShaftFrictionEntry;
constinit const EffectEntry kShaftFrictionEntry = {
    .effect = Effect::kShaftFriction,
    .name = "SHAFT_FRICTION",
    .label = "Shaft friction",
    .short_name = "frict",
    .term = "friction",
    .colour = 0xE69F00,
    .place = 2,
    .value = [](const StepReport& report) { return report.friction_N; },
    .section = "shaft_friction",
    .fields = kFrictionFields,
    .checkLayer =
        [](const LayerSpec& layer, SpecChecker& check) {
          check.number("friction_n_per_m", layer.friction_N_per_m, kFrictionPerLength);
        },
    .hasNumbers =
        [](const SceneSpec& spec) {
          return std::any_of(spec.layers.begin(), spec.layers.end(),
                             [](const LayerSpec& layer) { return layer.friction_N_per_m > 0; });
        },
    .stiffness_N_per_m = [](const SceneModel& model) { return model.friction_stiffness_N_per_m; },
    .lower = [](SceneSpec& spec, double share) { spec.friction_stiffness_N_per_m *= share; }};

}  // namespace needlelab
