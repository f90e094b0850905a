/// One station in the overview.
#pragma once

#include <imgui/imgui.h>

#include "client/instructor/model/lab_overview.h"

namespace needlelab {

/// The height that a tile wants, in pixels.
float tileHeight_px();
/// True when it was clicked: look over that station.
bool stationTile(const StationTile& tile, float width_px);

}  // namespace needlelab
