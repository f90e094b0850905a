/// The cost of each live effect of a scene in a tick, on this machine, now.
#pragma once

#include <vector>

#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

struct EffectCost {
  Effect effect = Effect::kCutting;
  double ns =
      0;  ///< a tick with it less a tick without it, the others live; noise can make it slightly negative
};

struct EffectCosts {
  double tick_ns = 0;               ///< with all of the scene's live effects
  std::vector<EffectCost> effects;  ///< the live ones, in the order of Effect
};

/// Measures: the scene with all of its live effects and without each in turn, batch by batch side by side, so
/// that a slow moment of the machine falls on all of them; medians of the batches' differences. Takes about
/// `budget_s`. Errors: as of `compile`. Thread: any but the haptic one, before it runs.
Result<EffectCosts> calibrateEffects(const SceneSpec& scene, double rate_hz, double budget_s = 0.04);

}  // namespace needlelab
