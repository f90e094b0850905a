#include "common/profile/layer_names.h"

#include <fmt/core.h>

#include <map>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

/// Empty for OTHER, which means nothing to a person, and for tissues unknown to this version.
std::string tissueWord(pb::Layer::Tissue tissue) {
  if (tissue == pb::Layer::OTHER || tissue == pb::Layer::TISSUE_UNSPECIFIED) return {};
  return lowerCase(pb::Layer::Tissue_Name(tissue));
}

}  // namespace

std::vector<const pb::Layer*> profileLayers(const pb::Profile& profile) {
  std::vector<const pb::Layer*> layers;
  for (const auto& structure : profile.volume().structures()) layers.push_back(&structure.layer());
  for (const pb::Layer& layer : profile.layers()) layers.push_back(&layer);
  return layers;
}

std::vector<pb::Layer*> profileLayers(pb::Profile& profile) {
  std::vector<pb::Layer*> layers;
  if (profile.has_volume())
    for (auto& structure : *profile.mutable_volume()->mutable_structures())
      layers.push_back(structure.mutable_layer());
  for (pb::Layer& layer : *profile.mutable_layers()) layers.push_back(&layer);
  return layers;
}

std::string layerPath(const pb::Profile& profile, std::size_t i) {
  return profile.has_volume() ? fmt::format("volume.structures[{}].layer", i) : fmt::format("layers[{}]", i);
}

std::vector<std::string> layerNames(const pb::Profile& profile) {
  const std::vector<const pb::Layer*> layers = profileLayers(profile);
  std::map<int, int> unnamed, seen;  // by tissue
  for (const pb::Layer* layer : layers)
    if (!layer->has_name()) ++unnamed[layer->tissue()];
  std::vector<std::string> names;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const pb::Layer& layer = *layers[i];
    if (layer.has_name()) {
      names.push_back(layer.name());
      continue;
    }
    if (profile.has_volume()) {
      names.push_back(profile.volume().structures(static_cast<int>(i)).id());
      continue;
    }
    std::string name = tissueWord(layer.tissue());
    if (name.empty())
      name = fmt::format("layer {}", i + 1);
    else if (unnamed[layer.tissue()] > 1)
      name += fmt::format(" {}", ++seen[layer.tissue()]);
    names.push_back(std::move(name));
  }
  return names;
}

}  // namespace needlelab
