/// The station's own evaluation of a recorded lesson: a curve with few points for plots, and score and
/// syringe events if no server provides them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/net/spool/spool.h"
#include "client/station/run/lesson/lesson.h"
#include "client/view/model/gesture_replica.h"
#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/planned_line.h"
#include "common/scoring/targets/miss.h"

namespace needlelab {

/// One point for several consecutive ticks: the values of the tick with the greatest force, so that no peak
/// is lost, and the ticks' greatest distances from the lines, so that none beyond a limit is lost.
struct CurvePoint {
  float time_s = 0;           ///< since the first sample
  float depth_m = 0;          ///< along the needle; negative outside; NaN with the cap on
  float force_N = 0;          ///< |force| on the hand
  float lateral_error_m = 0;  ///< from the line of the needle's own entry; greatest of the ticks in tissue
  float planned_error_m = std::numeric_limits<float>::quiet_NaN();  ///< from the plan; greatest of the ticks
                                                                    ///< in tissue; NaN: outside, or no plan
  int layer = -1;
};
using GestureCurve = std::vector<CurvePoint>;
inline constexpr std::size_t kCurvePoints = 4000;

/// Returns at most `max_points` (at least 1), spread evenly over the samples. Skips samples that are not
/// finite. `limb_W`: a plane's normal is a unit vector. `plan_W`: the exercise's, if it has one.
GestureCurve gestureCurve(std::span<const GestureSample> samples, const Limb& limb_W,
                          std::size_t max_points = kCurvePoints,
                          const std::optional<PlannedLine>& plan_W = {});

/// Finds the needle's line where it went deepest in a recording.
class DeepestLine {
 public:
  /// The next samples, and the list of their paths (pathListOf).
  void take(std::span<const GestureSample> samples, ByteView paths);
  [[nodiscard]] const std::optional<NeedleLine>& line() const { return line_; }  ///< none: never in tissue

 private:
  std::optional<NeedleLine> line_;
  double insertion_m_ = 0;
  std::optional<Vec3> entry_W_m_;
  std::shared_ptr<const PathLayers> path_;  // in use; null: not known
};

struct LocalScore {
  std::string score_json;    ///< rows as in scoreJson
  std::string events_json;   ///< rows as in eventsJson
  GestureCurve curve;        ///< for plots
  std::optional<Miss> miss;  ///< as missOf
  std::optional<NeedleLine> deepest;
};

/// Reads the session's chunks again, as the server would, and scores them. Errors: kInvalidInput if the
/// session is too long for scoring here (the server can score it), and the spool's errors.
Result<LocalScore> localScore(const SpoolSession& session, const StationLesson& lesson, const Pose& X_WL);

struct TickSpan {
  std::uint64_t begin = 0, end = 0;
};
/// The injections of LocalScore::events_json that began in tissue, in order of time; none in an empty text.
std::vector<TickSpan> injectionsIn(const std::string& events_json);

}  // namespace needlelab
