/// Measures the cost per tick of each live effect of a scene, on this machine, now.
#pragma once

#include <vector>

#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

struct EffectCost {
  Effect effect = Effect::kCutting;
  double ns = 0;  ///< cost of a tick with the effect minus one without it, other effects live; noise can make
                  ///< it slightly negative
};

struct EffectCosts {
  double tick_ns = 0;               ///< cost with all of the scene's live effects
  std::vector<EffectCost> effects;  ///< the live ones, in the order of Effect
};

/// Measures the scene with all of its live effects and without each in turn, in interleaved batches, so that
/// a slow moment of the machine affects all variants; returns medians of the batches' differences. Takes
/// about `budget_s`. Errors: as `compile`. Thread: any but the haptic one, before it runs.
Result<EffectCosts> calibrateEffects(const SceneSpec& scene, double rate_hz, double budget_s = 0.04);

}  // namespace needlelab
