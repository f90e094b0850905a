/// The station's own evaluation of a recorded lesson: a curve on few points for the plots, and score and
/// syringe events for when no server gives them.
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

/// Stands for some ticks in a row: the one with the greatest force, so that no peak is lost.
struct CurvePoint {
  float time_s = 0;   ///< since the first sample
  float depth_m = 0;  ///< δ, negative outside
  float insertion_m = 0;
  float force_N = 0;  ///< |force| on the hand
  float lateral_error_m = 0;
  float speed_mps = 0;
};
using GestureCurve = std::vector<CurvePoint>;

/// At most `most_points` (at least 1), evenly over the samples; those that are not finite are left out.
/// `limb_W`: a plane's normal is a unit vector.
GestureCurve gestureCurve(std::span<const GestureSample> samples, const Limb& limb_W,
                          std::size_t most_points = 4000);

struct LocalScore {
  std::string score_json;   ///< rows as of scoreJson
  std::string events_json;  ///< rows as of eventsJson
  GestureCurve curve;       ///< for plots
};

/// Reads the session's chunks again, as the server would. Errors: kInvalidInput for a session too long to be
/// scored here (the server will), those of the spool.
Result<LocalScore> localScore(const SpoolSession& session, const StationLesson& lesson, const Pose& X_WL);

}  // namespace needlelab
