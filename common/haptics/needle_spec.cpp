#include "common/haptics/needle_spec.h"

#include <array>
#include <cmath>

#include "common/haptics/det_math.h"

namespace needlelab {
namespace {

// ISO 9626:2016, designated metric sizes from 10G to 34G
constexpr std::array<double, kThinnestGauge - kThickestGauge + 1> kMetricSize_m = {
    3.4e-3,  3.0e-3,  2.7e-3, 2.4e-3,  2.1e-3,  1.8e-3,  1.6e-3, 1.4e-3,  1.2e-3,
    1.1e-3,  0.9e-3,  0.8e-3, 0.7e-3,  0.6e-3,  0.55e-3, 0.5e-3, 0.45e-3, 0.4e-3,
    0.36e-3, 0.33e-3, 0.3e-3, 0.25e-3, 0.23e-3, 0.2e-3,  0.18e-3};

constexpr double degrees(double angle) {
  return angle * kPi / 180;
}

}  // namespace

double gaugeDiameter_m(int gauge) {
  if (gauge < kThickestGauge || gauge > kThinnestGauge) return 0;
  return kMetricSize_m[static_cast<std::size_t>(gauge - kThickestGauge)];
}

double bevelAngle_rad(const NeedleSpec& needle) {
  if (needle.bevel_angle_rad > 0) return needle.bevel_angle_rad;
  switch (needle.tip) {
    case NeedleTip::kHypodermic:
      return degrees(11);
    case NeedleTip::kQuincke:
      return degrees(20);
    case NeedleTip::kTuohy:
      return degrees(25);
    case NeedleTip::kPencilPoint:
      return degrees(10);
    case NeedleTip::kUnknown:
      break;
  }
  return 0;
}

double bevelLength_m(const NeedleSpec& needle) {
  const double angle = bevelAngle_rad(needle);
  if (!(angle > 0) || !(needle.outer_diameter_m > 0)) return 0;
  const double length = needle.outer_diameter_m / std::tan(angle);
  return needle.tip == NeedleTip::kPencilPoint ? 0.5 * length : length;
}

double openingBehindTip_m(const NeedleSpec& needle) {
  const double length = bevelLength_m(needle);
  if (needle.tip == NeedleTip::kPencilPoint && length > 0) return length + needle.outer_diameter_m;
  return 0.5 * length;
}

}  // namespace needlelab
