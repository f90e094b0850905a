/// The station's own evaluation of a recorded lesson: a curve with few points for plots, and score and
/// syringe events if no server provides them.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "client/net/spool.h"
#include "client/station/run/lesson.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// One point for several consecutive ticks: the tick with the greatest force, so that no peak is lost.
struct CurvePoint {
  float time_s = 0;   ///< since the first sample
  float depth_m = 0;  ///< δ, negative outside
  float insertion_m = 0;
  float force_N = 0;  ///< |force| on the hand
  float lateral_error_m = 0;
  float speed_mps = 0;
};
using GestureCurve = std::vector<CurvePoint>;

/// Returns at most `most_points` (at least 1), spread evenly over the samples. Skips samples that are not
/// finite. `limb_W`: a plane's normal is a unit vector.
GestureCurve gestureCurve(std::span<const GestureSample> samples, const Limb& limb_W,
                          std::size_t most_points = 4000);

struct LocalScore {
  std::string score_json;   ///< rows as in scoreJson
  std::string events_json;  ///< rows as in eventsJson
  GestureCurve curve;       ///< for plots
};

/// Reads the session's chunks again, as the server would, and scores them. Errors: kInvalidInput if the
/// session is too long for scoring here (the server can score it), and the spool's errors.
Result<LocalScore> localScore(const SpoolSession& session, const StationLesson& lesson, const Pose& X_WL);

}  // namespace needlelab
