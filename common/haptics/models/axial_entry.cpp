#include "common/haptics/models/axial_entry.h"

#include "common/haptics/axial_model.h"

namespace needlelab {

EffectMask effectsOfLayers(const SceneSpec& spec) {
  EffectMask mask = 0;
  for (const LayerSpec& layer : spec.layers) {
    if (layer.cutting_force_N > 0) mask |= bitOf(Effect::kCutting);
    if (layer.attracted_force_N > 0) mask |= bitOf(Effect::kAttracted);
  }
  return mask;
}

const AxialEntry& axialEntry(AxialModel model) {
  switch (model) {
    case AxialModel::kEnhancedTrackingWall:
      return kTrackingWallEntry;
    case AxialModel::kTrackingWall:
      return kPlainWallEntry;
    case AxialModel::kDirect:
      return kDirectEntry;
    case AxialModel::kVoigt:
      return kVoigtEntry;
    case AxialModel::kGodObject:
      return kGodObjectEntry;
    case AxialModel::kFirstOrder:
      return kFirstOrderEntry;
    case AxialModel::kStatistical:
      return kStatisticalEntry;
    case AxialModel::kPrecomputed:
      return kPrecomputedEntry;
    case AxialModel::kFem:
      return kFemEntry;
  }
  return kNotBuiltEntry;
}

}  // namespace needlelab
