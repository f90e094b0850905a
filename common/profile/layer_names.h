/// The layers of a profile, and their display names: on screens, in reports, in the texts of measures and
/// events.
#pragma once

#include <string>
#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

/// The layers by the index that the engine reports: from the skin inwards, or a volume's structures in their
/// order. Valid as long as the profile is not changed.
std::vector<const pb::Layer*> profileLayers(const pb::Profile& profile);
std::vector<pb::Layer*> profileLayers(pb::Profile& profile);
/// A layer's path in the profile: "layers[2]", or "volume.structures[2].layer".
std::string layerPath(const pb::Profile& profile, std::size_t i);

/// Returns a name for each layer, in the order of profileLayers: its own name; without one its tissue, in
/// lower case, numbered if several layers of that tissue have no name ("fat 1", "fat 2"); a layer of OTHER
/// tissue without a name is named by its position: "layer 4". A structure without a name has its id. All
/// names differ in a profile that `parseProfile` accepted.
std::vector<std::string> layerNames(const pb::Profile& profile);

}  // namespace needlelab
