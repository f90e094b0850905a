#include "common/haptics/effects/clamping.h"

#include <algorithm>
#include <array>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr std::array<EffectField, 2> kFixtureFields = {
    {{"max_stiffness_n_per_m", "Greatest stiffness", kStiffness, 400,
      [](SceneSpec& spec) -> double& { return spec.virtual_fixture.max_stiffness_N_per_m; }},
     {"max_force_n", "Greatest clamping force", kForce, 4,
      [](SceneSpec& spec) -> double& { return spec.virtual_fixture.max_force_N; }}}};
constexpr std::array<EffectChoice::Option, 2> kModes = {
    {{"CONSERVATIVE", "Conservative: returns only the energy it took"},
     {"PROPORTIONAL", "Proportional: as in the paper"}}};

}  // namespace

extern const EffectEntry kClampingEntry;
constinit const EffectEntry kClampingEntry = {
    .effect = Effect::kClamping,
    .name = "CLAMPING",
    .label = "Clamping: what keeps the needle on its line",
    .short_name = "clamp",
    .term = "clamping",
    .along_u = false,
    .colour = 0xCC79A7,
    .place = 4,
    .value = [](const StepReport& report) { return report.clamping_N; },
    .section = "virtual_fixture",
    .fields = kFixtureFields,
    .choice = {"mode", "Mode", kModes, "CONSERVATIVE",
               [](SceneSpec& spec, int number) {
                 spec.virtual_fixture.mode = static_cast<ClampingMode>(number);
               }},
    .checkLayer =
        [](const LayerSpec& layer, SpecChecker& check) {
          check.number("lateral_stiffness_n_per_m2", layer.lateral_stiffness_N_per_m2, {0, 1e7});
        },
    .check =
        [](const SceneSpec& spec, SpecChecker& check) {
          const ClampingMode mode = spec.virtual_fixture.mode;
          check.require(mode == ClampingMode::kProportional || mode == ClampingMode::kConservative, "mode",
                        "is neither PROPORTIONAL nor CONSERVATIVE");
        },
    .hasNumbers =
        [](const SceneSpec& spec) {
          return std::any_of(spec.layers.begin(), spec.layers.end(),
                             [](const LayerSpec& layer) { return layer.lateral_stiffness_N_per_m2 > 0; });
        },
    .stiffness_N_per_m = [](const SceneModel& model) { return model.fixture_steepness.along_N_per_m; },
    .acts_with = ActsWith::kBoth,
    .on_device = {.words = "fixture",
                  .across_N_per_m =
                      [](const SceneSpec& spec) { return fixtureSteepness(spec).across_N_per_m; }},
    .lower =
        [](SceneSpec& spec, double share) {
          for (LayerSpec& layer : spec.layers) layer.lateral_stiffness_N_per_m2 *= share;
          spec.virtual_fixture.max_stiffness_N_per_m *= share;
          spec.virtual_fixture.max_force_N *= share;
        }};

}  // namespace needlelab
