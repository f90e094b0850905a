#include "client/sim/accuracy/label_layout.h"

#include <algorithm>
#include <array>

namespace needlelab {
namespace {

constexpr double kPoint_px = 8;  // half the width of a point's own box

std::size_t letters(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

PixelBox around(PixelPoint centre, double width, double height) {
  return {centre.x - width / 2, centre.y - height / 2, centre.x + width / 2, centre.y + height / 2};
}

}  // namespace

std::vector<PlacedLabel> placeLabels(const std::vector<PixelPoint>& points,
                                     const std::vector<std::string>& labels, const LabelSpace& space) {
  // above right and below left first: a front goes from there to the right and downward
  static constexpr std::array<PixelPoint, 8> kSides = {
      {{1, 1}, {-1, -1}, {1, 0}, {-1, 0}, {1, -1}, {-1, 1}, {0, 1}, {0, -1}}};
  static constexpr std::array<double, 9> kGaps_px = {0, 10, 22, 36, 52, 70, 90, 115, 145};

  std::vector<PixelBox> taken;
  for (const PixelPoint& point : points) taken.push_back(around(point, 2 * kPoint_px, 2 * kPoint_px));
  const auto isFree = [&](const PixelBox& box, const std::vector<PixelBox>& among) {
    return std::none_of(among.begin(), among.end(), [&](const PixelBox& b) { return b.overlaps(box); });
  };

  std::vector<PlacedLabel> placed;
  const auto place = [&](std::size_t i, bool may_cover_lines) {
    const double width = space.letter_px * static_cast<double>(letters(labels[i])), height = space.line_px;
    for (std::size_t g = 0; g < kGaps_px.size(); ++g)
      for (const PixelPoint& side : kSides) {
        const double reach = kPoint_px + 1 + kGaps_px[g];
        const PixelBox box = around(
            {points[i].x + side.x * (reach + width / 2), points[i].y + side.y * (reach * 0.6 + height / 2)},
            width, height);
        if (!box.within(space.frame) || !isFree(box, taken)) continue;
        if (!may_cover_lines && !isFree(box, space.lines)) continue;
        taken.push_back(box);
        placed.push_back({i, box, g > 1});
        return true;
      }
    return false;
  };
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!labels[i].empty() && !place(i, false)) place(i, true);
  return placed;
}

}  // namespace needlelab
