/// From a recording to the path that is compared with reference gestures.
#pragma once

#include <span>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/dtw.h"

namespace needlelab {

/// The tip's path of a recording (dtw.h), from the smoothed track; empty when it was never in tissue.
/// Stretches between long gaps follow each other. `rate_hz`, `X_WL`: as for `scoreGesture`. Thread: any.
TipPath tipPathOf(std::span<const GestureSample> samples, double rate_hz, const Pose& X_WL);

}  // namespace needlelab
