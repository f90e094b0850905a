/// The score of a session by the station itself, from the spool, for when no server gives one; and what was
/// done with the syringe.
#pragma once

#include <string>

#include "client/net/spool.h"
#include "client/station/run/gesture_curve.h"
#include "client/station/run/lesson.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

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
