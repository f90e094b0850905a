/// The display names of a profile's layers: on screens, in reports, in the texts of measures and events.
#pragma once

#include <string>
#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

/// Returns a name for each layer, from the skin inwards: its own name; without one its tissue, in lower case,
/// numbered if several layers of that tissue have no name ("fat 1", "fat 2"); a layer of OTHER tissue without
/// a name is named by its position: "layer 4". All names differ in a profile that `parseProfile` accepted.
std::vector<std::string> layerNames(const pb::Profile& profile);

}  // namespace needlelab
