/// Places the names at a side of a picture, or beside a ladder of tissues. Pure.
#pragma once

#include <span>
#include <vector>

namespace needlelab {

struct SideLabel {
  float anchor_px = 0;  ///< middle of what it names
  float height_px = 0;
  float weight = 0;   ///< how much it matters, in any unit: the height of what it names
  bool kept = false;  ///< it stays even if there is no room for all
};

/// Returns the upper edges of the labels: in the order of their anchors, without overlap, within
/// [from_px, to_px], each as near to its anchor as that allows; −1: omitted. If there is no room for all, the
/// labels of the least weight are omitted, those that are kept last. `labels` by ascending anchor.
std::vector<float> placeLabels(std::span<const SideLabel> labels, float from_px, float to_px);

}  // namespace needlelab
