#include "common/haptics/effects/tracking_wall.h"

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {

// every scene has their section, tracking_wall, because stops and phases also need it

extern const EffectEntry kCuttingEntry;
constinit const EffectEntry kCuttingEntry = {
    .effect = Effect::kCutting,
    .name = "CUTTING",
    .label = "Cutting: what resists the needle on its way in",
    .short_name = "cut",
    .term = "cutting",
    .colour = 0xD55E00,
    .place = 0,
    .value = [](const StepReport& report) { return report.cutting_N; },
    .checkLayer = [](const LayerSpec& layer,
                     SpecChecker& check) { check.number("cutting_force_n", layer.cutting_force_N, kForce); },
    // of a model with a tracking wall
    .lower =
        [](SceneSpec& spec, double share) {
          spec.tracking_wall.stiffness_N_per_m *= share;
          for (LayerSpec& layer : spec.layers)
            if (layer.wall_stiffness_N_per_m) *layer.wall_stiffness_N_per_m *= share;
        }};

extern const EffectEntry kAttractedEntry;
constinit const EffectEntry kAttractedEntry = {
    .effect = Effect::kAttracted,
    .name = "ATTRACTED",
    .label = "Attraction: what holds the needle on its way out",
    .short_name = "attr",
    .term = "attracted",
    .colour = 0x56B4E9,
    .place = 1,
    .value = [](const StepReport& report) { return report.attracted_N; },
    .checkLayer =
        [](const LayerSpec& layer, SpecChecker& check) {
          check.number("attracted_force_n", layer.attracted_force_N, kForce);
        }};

}  // namespace needlelab
