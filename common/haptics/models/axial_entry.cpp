#include "common/haptics/models/axial_entry.h"

#include <string>

#include "common/haptics/axial_model.h"
#include "common/haptics/effects/effect_entry.h"

namespace needlelab {

EffectMask effectsOfLayers(const SceneSpec& spec) {
  EffectMask mask = 0;
  for (const LayerSpec& layer : spec.layers) {
    if (layer.cutting_force_N > 0) mask |= bitOf(Effect::kCutting);
    if (layer.attracted_force_N > 0) mask |= bitOf(Effect::kAttracted);
  }
  return mask;
}

void refuseReplacedEffects(const SceneSpec& spec, EffectMask replaced, std::string_view section,
                           SpecChecker& check) {
  check.enter("");
  for (const EffectEntry* entry : effectEntries())
    check.require((spec.effects & replaced & bitOf(entry->effect)) == 0, "effects",
                  "lists " + std::string(entry->name) + ", which axial_model " +
                      std::string(axialModelName(spec.axial_model)) + " has its own of (" +
                      std::string(section) + "): take it out");
}

namespace {

// stands for a model that is not in this build: `validate` refuses such a scene by name, so that no other
// model renders it silently
constinit const AxialEntry kNotBuiltEntry = {
    nullptr,
    [](const SceneSpec& spec, SpecChecker& check) {
      const auto index = static_cast<std::size_t>(spec.axial_model);
      check.enter("");
      check.require(false, "axial_model",
                    (index < kAxialModelCount ? std::string(kAxialModelNames[index])
                                              : "number " + std::to_string(index)) +
                        " is not built into this version");
    },
    [](const SceneSpec&) { return EffectMask{0}; }, [](const SceneSpec&, SceneModel&) {}};

}  // namespace

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
    case AxialModel::kOkamura:
      return kOkamuraEntry;
    case AxialModel::kDahl:
      return kDahlEntry;
  }
  return kNotBuiltEntry;
}

}  // namespace needlelab
