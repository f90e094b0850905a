/// The description of every axial model: one row per model, each made in the model's own file. The engine,
/// the checks, profiles, studies and the console's editor read what they need of a model from its row.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "common/base/range.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

class SpecChecker;

/// A number of a scene.
using SpecNumber = std::variant<double*, bool*, std::int32_t*, std::uint64_t*>;

/// A number of the model's section in a profile, or of a row of that section's table.
struct AxialField {
  std::string_view name;   ///< "stiffness_n_per_m"; "factors.mean": in a message of its own
  std::string_view label;  ///< in the editor: "Stiffness (Direct)"; empty: not shown there
  NumberRange range;       ///< the same as in profile.proto; of double and int32 only
  /// Accesses it in the scene; `i` is the number of the layer or of the row.
  SpecNumber (*of)(SceneSpec&, std::size_t i) = nullptr;
  /// The field whose value it takes if a profile does not have it; empty: it keeps the scene's default.
  std::string_view absent = {};
};

/// The section with the model's numbers.
struct AxialSection {
  std::string_view name = {};  ///< "direct"; empty: the model has no section
  std::span<const AxialField> fields = {};

  // for a section that each layer has
  bool (*isIn)(const LayerSpec&) = nullptr;  ///< null: the section is in the profile itself
  void (*addTo)(LayerSpec&) = nullptr;

  // for a section with a table
  std::string_view table = {};  ///< the name of the list of rows: "table"; empty: none
  std::span<const AxialField> row_fields = {};
  std::size_t max_rows = 0;  ///< rows are 1 to this; 0: `AxialEntry::check` checks their number
  std::size_t (*rows)(const SceneSpec&) = nullptr;
  void (*resize)(SceneSpec&, std::size_t rows) = nullptr;

  std::span<const std::string_view> may_be_synthetic = {};  ///< what its list `synthetic` may name
  std::string_view made_by = {};                            ///< a command that makes such a section

  [[nodiscard]] bool inLayers() const { return isIn != nullptr; }
};

/// An axial model; CONTRIBUTING.md explains how to add one.
struct AxialEntry {
  AxialModel model;
  std::string_view label;       ///< for people: "Okamura (Karnopp friction)"
  std::string_view short_name;  ///< head of a narrow column: "Okamura"
  /// The step functions by the set of live effects, from `stepTable` (effects/step_live.h).
  const std::array<StepFunction, kPlacedEffects + 1>* steps;

  // what it renders
  EffectMask renders;              ///< which of CUTTING and ATTRACTED
  EffectMask replaces = 0;         ///< effects that it has its own of: a scene that lists them is refused
  bool has_tracking_wall = false;  ///< the tracking wall renders it: it has a stop, and its wall cuts
  bool follows_layers = false;     ///< … with the layers' cutting forces; a layer may have a K_t of its own
  bool places_wall = false;        ///< each tick computes `wall_m` from the layers' tops
  /// Its force follows x, not x_c: it acts together with an intact membrane.
  bool passes_membranes = false;
  bool feels_speed = false;  ///< a faster insertion has another force
  /// Why it does not work in a body, after "…: "; empty: it does.
  std::string_view needs_shells = {};

  // its numbers
  AxialSection section = {};
  /// Checks conditions beyond single fields; null: none. The rest of the scene is already checked.
  void (*check)(const SceneSpec&, SpecChecker&) = nullptr;
  /// Which of CUTTING and ATTRACTED have nonzero numbers, listed or not; null: the layers decide.
  EffectMask (*effectsWithNumbers)(const SceneSpec&) = nullptr;
  /// The membrane that the model puts on the top of a layer; null: only PUNCTURE has membranes.
  MembraneSpec (*topOf)(const LayerSpec&) = nullptr;

  /// The rule of `likeForLike` (models/like_for_like.h): derives the model's numbers in `other`, a copy of
  /// `scene`, from its layers. Keeps a section that is there. Null: the model has no numbers of its own.
  void (*derive)(const SceneSpec& scene, SceneSpec& other) = nullptr;
  /// What that rule assumes, as a sentence without full stop, for readers of a result; null: nothing.
  std::string (*assumption)(const SceneSpec& scene) = nullptr;

  /// Fills the model's values for a tick. `model` is otherwise complete, `model.live` included.
  void (*compile)(const SceneSpec& spec, SceneModel& model);
};

/// All models, in the order of `AxialModel`.
std::span<const AxialEntry* const, kAxialModelCount> axialEntries();
/// For a number that is no model: a row whose check refuses the scene.
const AxialEntry& axialEntry(AxialModel model);

}  // namespace needlelab
