/// The scene that a profile describes, and its parts.
#pragma once

#include <string>

#include "common/base/result.h"
#include "common/haptics/needle_spec.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

struct AxialEntry;
struct EffectEntry;

/// The skin's surface in the profile's frame; a plane's normal gets length 1. Compiles a volume. Errors:
/// kInvalidInput without a shape, or those of a volume.
Result<Limb> unitLimbOf(const pb::Profile& profile);

/// A profile's needle as numbers: `outer_diameter_m` as given, else from the gauge; 0 if neither is given.
NeedleSpec needleOf(const pb::Needle& needle);

inline Vec3 vectorOf(const pb::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

/// The numbers of a layer that is of `tissue`; without thickness_m (a volume's structure) its thickness is 0.
LayerSpec layerOf(const pb::Layer& layer, pb::Layer::Tissue tissue);

/// The scene for the engine, with the limb placed in W by `X_WL` (L: the frame of the profile's coordinates).
/// A volume becomes a body, and its structures the layers, in their order and with a thickness that means
/// nothing. Errors: kInvalidInput, when the profile (one that did not come from `parseProfile`) or the
/// placement is not valid.
Result<SceneSpec> sceneSpecOf(const pb::Profile& profile, const Pose& X_WL = {});

/// Replaces the profile's axial model by the named one, as given on the command line. If the profile has no
/// section for that model, it gets one with the defaults of FORCE_MODEL.md, "Axial models", provided each
/// field has a default. Errors: kInvalidInput for an unknown name and for a missing section; the profile may
/// then be modified.
Status chooseModel(pb::Profile& profile, const std::string& name);

/// Writes the scene's axial model, that model's section and the list of effects into a profile with the same
/// layers (`sceneSpecOf` reads the same values back; a seed keeps its lowest 32 bits).
void putModel(const SceneSpec& spec, pb::Profile& profile);

/// Checks that the chosen model has its section, and that `synthetic` names existing parameters.
Status checkModelSection(const pb::Profile& profile);

/// The row of the profile's axial model.
const AxialEntry& axialEntryOf(const pb::Profile& profile);

/// The effect of the same name in messages. Its number is append-only; the engine's order is not.
pb::Profile::Effect numberOfEffect(Effect effect);

/// Returns the section with the effect's numbers; null if the profile or the effect has none.
const google::protobuf::Message* sectionOf(const EffectEntry& effect, const pb::Profile& profile);

}  // namespace needlelab
