#include "client/view/model/letters.h"

#include <algorithm>
#include <cmath>

#include "common/base/units.h"

namespace needlelab {
namespace {

constexpr double kArcmin_rad = radOf(1.0 / 60);
constexpr double kDeskHeight_px = 720;

}  // namespace

double arcminPerPixel(const Viewing& viewing, int width_px, int height_px) {
  const double pixel_m = viewing.diagonal_m / std::hypot(width_px, height_px);
  return std::atan(pixel_m / viewing.distance_m) / kArcmin_rad;
}

LetterSizes letterSizes(const Viewing& viewing, int width_px, int height_px, double scale) {
  const double arcmin_per_px = arcminPerPixel(viewing, width_px, height_px);
  const auto size = [&](double arcmin, double desk_px) {
    const double by_angle_px = arcmin / arcmin_per_px / kCapitalHeight;
    return std::ceil(scale * std::max(by_angle_px, desk_px * height_px / kDeskHeight_px));
  };
  const LetterSizes desk;
  return {size(kBodyArcmin, desk.body_px), size(kSmallArcmin, desk.small_px),
          size(kHeadingArcmin, desk.heading_px), size(kFigureArcmin, desk.figure_px)};
}

double headingShare(const Viewing& viewing) {
  constexpr int kWide = 1920, kHigh = 1080;
  return kHeadingArcmin / arcminPerPixel(viewing, kWide, kHigh) / kCapitalHeight / kHigh;
}

}  // namespace needlelab
