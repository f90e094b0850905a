#include "client/device/recording/needle_direction.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/base/units.h"
#include "common/haptics/surface.h"

namespace needlelab {

std::optional<std::string> needleDirectionWarning(const Limb& limb, std::size_t rows,
                                                  const std::function<TipSample(std::size_t)>& tip,
                                                  QuaternionOrder order) {
  constexpr double kStraight_deg = 1, kLeastTilt_deg = 5, kMostTilt_deg = 85;
  bool was_outside = false;
  for (std::size_t i = 0; i < rows; ++i) {
    const TipSample now = tip(i);
    const bool outside = signedDepth(limb, now.p_WT_m) < 0;
    const bool enters = was_outside && !outside;
    was_outside = outside;
    if (!enters) continue;
    const auto tiltOf_deg = [&](Quat q) {
      const Vec3 axis = zAxis(q);
      const double cosine = -dot(axis, normalized(surfaceNormal(limb, now.p_WT_m, axis)));
      return degreesOf(std::acos(std::clamp(cosine, -1.0, 1.0)));
    };
    const Quat q = now.q_WT;
    const double tilt_deg = tiltOf_deg(q);
    if (tilt_deg > 90)
      return fmt::format(
          "row {}: the needle's axis points out of the skin where it enters, {:.0f}° from straight in: is the "
          "quaternion in the order w, x, y, z (the columns are qx, qy, qz, qw), or the frame left-handed? The "
          "needle points along its z",
          i + 1, tilt_deg);
    const double other_deg = tiltOf_deg({q.y, q.z, q.w, q.x});
    if (order == QuaternionOrder::kUnsure && tilt_deg < kStraight_deg && other_deg > kLeastTilt_deg &&
        other_deg < kMostTilt_deg)
      return fmt::format(
          "row {}: the needle enters straight in; if the quaternion is in the order w, x, y, z (the columns are "
          "qx, qy, qz, qw), it is tilted by {:.0f}°: which is it?",
          i + 1, other_deg);
  }
  return std::nullopt;
}

void warnOfDirection(const std::string& path, const Limb& limb, const PoseTrack& track, const Pose& X_HT) {
  const auto tip = [&](std::size_t i) {
    const Pose X_WT = track.X_WH[i] * X_HT;
    return TipSample{X_WT.p, X_WT.q};
  };
  if (const auto warning = needleDirectionWarning(limb, track.X_WH.size(), tip, QuaternionOrder::kUnsure))
    std::fprintf(stderr, "warning: %s: %s\n", path.c_str(), warning->c_str());
}

}  // namespace needlelab
