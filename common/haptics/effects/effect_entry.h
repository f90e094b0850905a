/// The description of every effect: one row per effect, each made in the effect's own file. Code that lists
/// effects (profiles, plots, tables, studies, the console's editor) iterates over these rows.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/range.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

class SpecChecker;

/// A number of the effect's section in a profile.
struct EffectField {
  std::string_view name;                ///< "max_stiffness_n_per_m"
  std::string_view label;               ///< in the editor: "Greatest stiffness"
  NumberRange range;                    ///< the same as in profile.proto
  double begins_with = 0;               ///< value in a new section of the editor
  double& (*of)(SceneSpec&) = nullptr;  ///< accesses it in the scene
};

/// A choice in that section. Option i stands for the enumerator i of the message.
struct EffectChoice {
  struct Option {
    std::string_view name;   ///< "CONSERVATIVE"
    std::string_view label;  ///< "Conservative: returns only the energy it took"
  };
  std::string_view name;  ///< "mode"; empty: the section has no choice
  std::string_view label;
  std::span<const Option> options;  ///< in the editor's order; identified by `name`
  std::string_view begins_with;
  void (*set)(SceneSpec&, int number) = nullptr;
};

/// An effect; CONTRIBUTING.md explains how to add one. An effect that only adds a force is a stage, and
/// `stage` is all of its code. An effect that changes other effects is placed in step_live.h.
struct EffectEntry {
  Effect effect;
  std::string_view name;        ///< in profiles and on command lines: "SHAFT_FRICTION"
  std::string_view label;       ///< for people: "Shaft friction"
  std::string_view short_name;  ///< head of a narrow column: "frict"

  // its term in the report; an effect that only changes other effects' terms has none, and `value` is null
  std::string_view term;        ///< in legends, and with "_n" in CSV: "friction"
  std::string_view unit = "N";  ///< "N", or "N·m" for a torque
  bool along_u = true;          ///< true: signed, cutting is negative; false: a magnitude
  std::uint32_t colour = 0;     ///< 0xRRGGBB, in every plot
  int place = 0;                ///< in legends and columns; forces are summed in this order
  double (*value)(const StepReport&) = nullptr;

  // its numbers
  std::string_view section =
      {};  ///< section of a profile: "shaft_friction"; empty: the numbers are in the layers or the model
  std::span<const EffectField> fields = {};
  EffectChoice choice = {};
  /// Checks the effect's number in a layer; null if it has no such number.
  void (*checkLayer)(const LayerSpec&, SpecChecker&) = nullptr;
  /// Checks conditions beyond single fields and layers; null: none.
  void (*check)(const SceneSpec&, SpecChecker&) = nullptr;
  /// Whether any of its numbers is not zero; null: the axial model decides (CUTTING and ATTRACTED).
  bool (*hasNumbers)(const SceneSpec&) = nullptr;
  /// The greatest stiffness that the effect adds along the trajectory; null: none.
  double (*stiffness_N_per_m)(const SceneModel&) = nullptr;

  // for stages only
  StageFunction stage = nullptr;
  /// Prepares the stage's numbers for the tick: `model.stage_numbers[stageOf(effect)]` holds the author's
  /// numbers. Null: no preparation needed.
  void (*compileStage)(SceneModel&) = nullptr;
};

/// All effects, in the order of `Effect`.
std::span<const EffectEntry* const, kEffectCount> effectEntries();
/// The effects with a term, in the order of `place`, in which they are summed and displayed.
std::span<const EffectEntry* const> effectsAsShown();
const EffectEntry& effectEntry(Effect effect);

/// Sets the scene's numbers to the initial values of a new section of this effect.
void useUsualNumbers(const EffectEntry& entry, SceneSpec& spec);

inline std::string_view effectName(Effect effect) {
  return effectEntry(effect).name;
}
/// The names of a set of effects, in the order of `Effect`.
std::vector<std::string> effectNames(EffectMask effects);
/// The name as words, e.g. "orientation limit"; with '_' as `between`, as in CSV columns.
std::string effectWords(const EffectEntry& entry, char between = ' ');

}  // namespace needlelab
