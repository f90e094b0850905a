#include "client/sim/tools/needle_direction.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "common/haptics/surface.h"

namespace needlelab {

std::optional<std::string> needleDirectionWarning(const Limb& limb, std::size_t rows,
                                                  const std::function<TipSample(std::size_t)>& tip) {
  bool was_outside = false;
  for (std::size_t i = 0; i < rows; ++i) {
    const TipSample now = tip(i);
    const bool outside = signedDepth(limb, now.p_WT_m) < 0;
    const bool enters = was_outside && !outside;
    was_outside = outside;
    if (!enters) continue;
    const Vec3 axis = zAxis(now.q_WT);
    const double cosine = -dot(axis, normalized(surfaceNormal(limb, now.p_WT_m, axis)));
    if (cosine >= 0) continue;
    return fmt::format(
        "row {}: the needle's axis points out of the skin where it enters, {:.0f}° from straight in: is the "
        "quaternion in the order w, x, y, z (the columns are qx, qy, qz, qw), or the frame left-handed? The "
        "needle points along its z",
        i + 1, std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi);
  }
  return std::nullopt;
}

void warnOfDirection(const char* command, const Limb& limb, std::size_t rows,
                     const std::function<TipSample(std::size_t)>& tip) {
  if (const auto warning = needleDirectionWarning(limb, rows, tip))
    std::fprintf(stderr, "needlelab-sim %s: warning: %s\n", command, warning->c_str());
}

TipSample tipOf(const GestureSample& sample) {
  return {{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]},
          {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}};
}

}  // namespace needlelab
