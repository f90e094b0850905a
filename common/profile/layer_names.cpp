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

std::vector<std::string> layerNames(const pb::Profile& profile) {
  std::map<int, int> unnamed, seen;  // by tissue
  for (const pb::Layer& layer : profile.layers())
    if (!layer.has_name()) ++unnamed[layer.tissue()];
  std::vector<std::string> names;
  for (int i = 0; i < profile.layers_size(); ++i) {
    const pb::Layer& layer = profile.layers(i);
    if (layer.has_name()) {
      names.push_back(layer.name());
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
