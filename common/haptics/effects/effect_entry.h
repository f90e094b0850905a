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
class StateHash;

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

/// What an effect asks of a device besides stiffness along the needle (gate/handle_stiffness.h). All null:
/// nothing.
struct OnDevice {
  std::string_view words = {};  ///< in messages: "fixture"
  /// The greatest stiffness across the needle, at the tip, in a scene that lists the effect; null: none.
  double (*across_N_per_m)(const SceneSpec&) = nullptr;
  /// The greatest stiffness of its torque; null: it has none. A device needs torque and orientation for it.
  double (*turning_Nm_per_rad)(const SceneSpec&) = nullptr;
  /// What the needle does, and did, without it: a device that cannot hold it renders the scene without it.
  /// Empty: then the lesson is refused.
  std::string_view without = {}, was_without = {};
};

/// What of the tissue an effect's stiffness along the needle acts together with. An intact membrane holds x_c
/// (FORCE_MODEL.md, "Puncture"), so it and the springs K_t and K_f do not stretch at once.
enum class ActsWith : std::uint8_t {
  kTissue,      ///< with K_t, K_f, and the others of this kind
  kHeldTissue,  ///< with tissue whose springs keep their lengths: a membrane
  kBoth,        ///< with the tissue's springs or with a membrane
  kCutTissue,   ///< with the tissue's springs, once membranes and fixture are behind the tip
  kNothing      ///< instead of the others, which do not stretch on bone or under the cap
};

/// An effect; CONTRIBUTING.md explains how to add one. A new effect is a stage, and `stage` is all that a
/// tick executes of it; step_live.h has the places of the older ones.
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
  /// The effect's own greatest stiffness along the trajectory, and what that acts together with; null: none.
  double (*stiffness_N_per_m)(const SceneModel&) = nullptr;
  ActsWith acts_with = ActsWith::kTissue;
  /// How much its force may change with the tip's place besides that, in a scene that lists it; null:
  /// nothing.
  double (*slope_N_per_m)(const SceneSpec&) = nullptr;
  /// What the author of a scene that lists it should know, to follow "… is listed, "; empty or null: nothing.
  std::string (*remark)(const SceneSpec&) = nullptr;
  OnDevice on_device = {};
  /// Lowers its stiffnesses to a share, not the forces that it cuts, rubs or gives way at; null: it has none.
  /// Tool and device bound what is across the needle or turns it (on_device), a late loop all that act at
  /// once.
  void (*lower)(SceneSpec&, double share) = nullptr;

  // for scenes in which it is live
  StageFunction stage = nullptr;  ///< null: it has a place in the tick, or ticks of its own
  /// Whether no needle enters this layer, so that the tissue above it continues; null: none is closed.
  bool (*closes)(const LayerSpec&) = nullptr;
  /// Prepares its numbers for the tick, after layers and axial model: `model.stage_numbers[stageOf(effect)]`
  /// holds the author's. Null: no preparation needed.
  void (*compile)(const SceneSpec&, SceneModel&) = nullptr;

  // its own state, if it has more than SimState::stage; null: none
  void (*hashLasting)(const SimState&, StateHash&) = nullptr;  ///< what outlives an insertion
  void (*hash)(const SimState&, StateHash&) = nullptr;         ///< what belongs to one
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
