/// A station's tile in the lab. Thread: the surface's.
#pragma once

#include <imgui/imgui.h>

#include "client/instructor/model/lab_state.h"

namespace needlelab {

/// The least size of a tile on which everything can be read, at the current size of letters.
ImVec2 leastTile_px();

/// Result of a click on a tile.
enum class TileClick { kNone, kOpen, kChoose };

/// Draws the tile at the cursor: who practises what and how it goes, the needle among the tissues, and in
/// colour that it calls for help. A click with Ctrl, or on the mark in the corner, chooses it.
TileClick stationTile(const LabState& lab, const StationTile& tile, ImVec2 size_px);

}  // namespace needlelab
