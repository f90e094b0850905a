#include "common/haptics/effects/puncture.h"

#include <algorithm>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

void checkMembrane(const LayerSpec& layer, SpecChecker& check) {
  if (!layer.membrane) return;
  check.number("puncture.linear_n_per_m", layer.membrane->linear_N_per_m, {0, 1e5});
  check.number("puncture.quadratic_n_per_m2", layer.membrane->quadratic_N_per_m2, {0, 1e9});
  check.require(layer.membrane->linear_N_per_m > 0 || layer.membrane->quadratic_N_per_m2 > 0, "puncture",
                "linear_n_per_m and quadratic_n_per_m2 are both 0: such a membrane would never rupture");
  check.number("puncture.force_n", layer.membrane->force_N, kPositiveForce);
}

// membranes are met one by one, but a short one behind a long one can act together with it: use the steepest
double steepestMembrane(const SceneModel& model) {
  double steepest = 0;
  for (std::uint32_t i = 0; i < model.membrane_count; ++i)
    steepest = std::max(steepest, model.membranes[i].slope_at_rupture_N_per_m);
  return steepest;
}

}  // namespace

extern const EffectEntry kPunctureEntry;
constinit const EffectEntry kPunctureEntry = {
    .effect = Effect::kPuncture,
    .name = "PUNCTURE",
    .label = "Puncture: membranes that give way",
    .short_name = "punct",
    .term = "puncture",
    .colour = 0xF0E442,
    .place = 3,
    .value = [](const StepReport& report) { return report.puncture_N; },
    .checkLayer = checkMembrane,
    .hasNumbers =
        [](const SceneSpec& spec) {
          return std::any_of(spec.layers.begin(), spec.layers.end(),
                             [](const LayerSpec& layer) { return layer.membrane.has_value(); });
        },
    .stiffness_N_per_m = steepestMembrane,
    .acts_with = ActsWith::kHeldTissue,
    // k1·z + k2·z²: the same force at z/share
    .lower =
        [](SceneSpec& spec, double share) {
          for (LayerSpec& layer : spec.layers) {
            if (!layer.membrane) continue;
            layer.membrane->linear_N_per_m *= share;
            layer.membrane->quadratic_N_per_m2 *= share * share;
          }
        }};

}  // namespace needlelab
