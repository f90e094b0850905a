/// The score of a session by the station itself, from the spool, for when no server gives one; and what was
/// done with the syringe.
#pragma once

#include <string>

#include "base/result.h"
#include "haptics/geometry.h"
#include "net/spool.h"
#include "station/gesture_curve.h"
#include "station/lesson.h"

namespace needlelab {

struct LocalScore {
  std::string score_json;   ///< rows as of scoreJson
  std::string events_json;  ///< rows as of eventsJson
  GestureCurve curve;       ///< for plots
};

/// Reads the session's chunks again, as the server would. Errors: kInvalidInput for a session too long to be
/// scored here (the server will), those of the spool.
Result<LocalScore> localScore(const SpoolSession& session, const StationLesson& lesson, const Pose& X_WL);

}  // namespace needlelab
