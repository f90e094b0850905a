/// How tiles of one size fill a screen. Pure.
#pragma once

#include <algorithm>

namespace needlelab {

struct TileGrid {
  int columns = 1, rows = 1;  ///< rows: of all tiles; more than fit where `scrolls`
  float width_px = 0, height_px = 0;
  bool scrolls = false;
};

/// The largest tiles that all fit; where those would be smaller than `least_width_px` × `least_height_px`,
/// tiles of that height, as many beside one another as fit. `count`: at least 1.
inline TileGrid tileGrid(int count, float width_px, float height_px, float gap_px, float least_width_px,
                         float least_height_px) {
  constexpr float kWideness = 1.7F;  // of a tile that is neither too wide nor too narrow
  const auto part = [&](float whole_px, int parts) {
    return (whole_px - gap_px * static_cast<float>(parts - 1)) / static_cast<float>(parts);
  };
  TileGrid best;
  float best_size = -1;
  for (int columns = 1; columns <= count; ++columns) {
    const int rows = (count + columns - 1) / columns;
    const TileGrid grid{columns, rows, part(width_px, columns), part(height_px, rows), false};
    const float size = std::min(grid.width_px / kWideness, grid.height_px);
    if (grid.width_px < least_width_px || grid.height_px < least_height_px || size <= best_size) continue;
    best = grid;
    best_size = size;
  }
  if (best_size > 0) return best;
  const int columns = std::clamp(static_cast<int>((width_px + gap_px) / (least_width_px + gap_px)), 1, count);
  return {columns, (count + columns - 1) / columns, part(width_px, columns), least_height_px, true};
}

}  // namespace needlelab
