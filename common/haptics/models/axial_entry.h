/// The interface of the axial models: one entry per model, each made in the model's own file. The engine, the
/// validator and the compiler know the models only through it.
#pragma once

#include <array>
#include <string_view>

#include "common/haptics/effects/step_live.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {

/// To add a model: add a file here that makes an entry (see direct.cpp, the smallest), a line in
/// axial_entry.cpp, a name in axial_model.h, a section in proto/needlelab/profile.proto.
struct AxialEntry {
  const StepTable* steps;
  /// Checks the model's own section; the rest of the scene is already checked.
  void (*check)(const SceneSpec& spec, SpecChecker& check);
  /// Returns which of CUTTING and ATTRACTED have nonzero numbers under this model, listed or not.
  EffectMask (*effectsWithNumbers)(const SceneSpec& spec);
  /// Fills the model's values for a tick. `model` is otherwise complete, `model.live` included.
  void (*compile)(const SceneSpec& spec, SceneModel& model);
  /// The effects that the model replaces with its own: a scene that lists them is refused.
  EffectMask replaces = 0;
};

const AxialEntry& axialEntry(AxialModel model);

/// Returns CUTTING and ATTRACTED if the layers' own forces are not all zero.
EffectMask effectsOfLayers(const SceneSpec& spec);

/// Refuses a scene that lists an effect that its model replaces with its own. `section`: the model's section
/// for it.
void refuseReplacedEffects(const SceneSpec& spec, EffectMask replaced, std::string_view section,
                           SpecChecker& check);

extern const AxialEntry kTrackingWallEntry;  ///< ENHANCED_TRACKING_WALL
extern const AxialEntry kPlainWallEntry;     ///< TRACKING_WALL
extern const AxialEntry kDirectEntry;
extern const AxialEntry kFemEntry;
extern const AxialEntry kVoigtEntry;
extern const AxialEntry kGodObjectEntry;
extern const AxialEntry kFirstOrderEntry;
extern const AxialEntry kStatisticalEntry;
extern const AxialEntry kPrecomputedEntry;
extern const AxialEntry kOkamuraEntry;
extern const AxialEntry kDahlEntry;

}  // namespace needlelab
