#include "client/view/scene/label_places.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace needlelab {

std::vector<float> placeLabels(std::span<const SideLabel> labels, float from_px, float to_px) {
  std::vector<std::size_t> shown(labels.size());
  float needed_px = 0;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    shown[i] = i;
    needed_px += labels[i].height_px;
  }
  while (!shown.empty() && needed_px > to_px - from_px) {
    const auto least = std::min_element(shown.begin(), shown.end(), [&](std::size_t a, std::size_t b) {
      return std::pair(labels[a].kept, labels[a].weight) < std::pair(labels[b].kept, labels[b].weight);
    });
    needed_px -= labels[*least].height_px;
    shown.erase(least);
  }
  std::vector<float> tops_px(labels.size(), -1);
  float free_px = from_px;
  for (const std::size_t i : shown) {
    tops_px[i] = std::max(labels[i].anchor_px - 0.5F * labels[i].height_px, free_px);
    free_px = tops_px[i] + labels[i].height_px;
  }
  float limit_px = to_px;
  for (auto i = shown.rbegin(); i != shown.rend(); ++i) {
    tops_px[*i] = std::min(tops_px[*i], limit_px - labels[*i].height_px);
    limit_px = tops_px[*i];
  }
  return tops_px;
}

}  // namespace needlelab
