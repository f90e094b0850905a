/// The cost per tick of sets of live effects (`needlelab-sim effects`).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/clock.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A scene of the study.
struct EffectsScene {
  std::string name;
  SceneSpec spec;
};

/// One set of live effects in a scene.
struct EffectSetCost {
  std::string scene;
  EffectMask effects = 0;
  Timing timing;
  std::optional<double> instructions;  ///< per tick; empty if not counted
};

/// What an effect adds to a tick, over the pairs of a scene's sets that differ only in it.
struct MarginalCost {
  std::string scene;
  Effect effect = Effect::kCutting;
  double mean_ns = 0, min_ns = 0, max_ns = 0;         ///< of the pairs' medians
  std::optional<double> instructions;                 ///< mean; empty if not counted
  double min_instructions = 0, max_instructions = 0;  ///< over the pairs, if counted
};

/// The study's scenes: the profile's, or by default the paper's six layers with shaft friction, three
/// membranes and the usual numbers for every stage, so that all effects are live, and a body
/// (shoulder-median). Errors: kInvalidInput naming file and field.
Result<std::vector<EffectsScene>> effectsScenes(const std::filesystem::path& profile);

/// Of the scene's live effects none, each alone, all but each, and all, ordered by mask; PALPATION, which has
/// ticks of its own, only alone: there the cap is on. Errors: as of `compile`.
Result<std::vector<EffectMask>> effectSets(const SceneSpec& scene, double rate_hz);

/// Times each set as the station steps it (TickRun) over the same gesture, in turns, so that a slow moment
/// affects all sets of a scene. Reports the completed share to `progress`. Errors: as of `compile`.
Result<std::vector<EffectSetCost>> timeEffectSets(const std::vector<EffectsScene>& scenes, double rate_hz,
                                                  const std::function<void(double)>& progress);

/// Counts each set's instructions per tick: runs `command` (this program, calling `runSetsForCounting` with
/// the same scenes) under callgrind. Errors: as of `countInstructions`.
Status countEffectSets(const std::vector<std::string>& command, std::size_t ticks,
                       std::vector<EffectSetCost>& sets);
/// Steps each set once through the gesture and marks its end.
Status runSetsForCounting(const std::vector<EffectsScene>& scenes, double rate_hz);
/// Ticks of that gesture.
std::size_t ticksOfGesture(const SceneSpec& scene, double rate_hz);

std::vector<MarginalCost> marginalCosts(const std::vector<EffectSetCost>& sets);

/// For a terminal: the sets of each scene from the cheapest up, then what each effect adds.
std::string effectsTable(const std::vector<EffectSetCost>& sets);
/// Writes effects.csv, effects_marginal.csv and effects.png into the existing `folder`. The picture shows
/// what each effect adds in each scene, in instructions, which repeat exactly; in nanoseconds only if those
/// were not counted. Errors: of the file system and of gnuplot.
Status drawEffects(const std::vector<EffectSetCost>& sets, const std::filesystem::path& folder);

}  // namespace needlelab
