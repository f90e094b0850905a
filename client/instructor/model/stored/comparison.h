/// Compares two gestures: aligns their moments and computes the differences.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/stored/stored_gesture.h"
#include "common/base/result.h"

namespace needlelab {

enum class Alignment : std::uint8_t {
  kDepth,  ///< by inserted length in the deepest insertion, at the first time each gesture reached it
  kDtw,    ///< by dynamic time warping of the tip paths in the limb's frame (common/scoring/motion/dtw.h)
  kTime,   ///< by time since the first entry into tissue
};
std::string_view nameOf(Alignment alignment);

/// One point of the alignment. SI units; `a` and `b` have their own times.
struct ComparedPoint {
  double at = 0;  ///< kDepth: inserted length in m; kDtw: fraction of the alignment; kTime: s since entry
  double time_a_s = 0, time_b_s = 0;
  double force_a_N = 0, force_b_N = 0;
  double speed_a_mps = 0, speed_b_mps = 0;
  double lateral_a_m = 0, lateral_b_m = 0;  ///< of the tip from its needle's own entry line
  double planned_a_m = 0, planned_b_m = 0;  ///< of the tip from its exercise's plan; NaN outside or without a
                                            ///< plan
  double insertion_a_m = 0, insertion_b_m = 0;
  double tilt_a_rad = 0, tilt_b_rad = 0;  ///< NaN: unknown
  double apart_m = 0;                     ///< distance of the tips, each in its limb's frame
};

/// Series to draw for both gestures and for the difference b − a.
enum class ComparedSeries : std::uint8_t { kTotalForce, kSpeed, kLateral, kPlanned, kInsertion, kTilt };
inline constexpr std::size_t kComparedSeriesCount = 6;
std::string_view nameOf(ComparedSeries series);
std::string_view unitOf(ComparedSeries series);  ///< as shown: "mm"
double shownPerSi(ComparedSeries series);        ///< 1000 for mm
double valueOfA(ComparedSeries series, const ComparedPoint& point);
double valueOfB(ComparedSeries series, const ComparedPoint& point);

/// Adds the requirements on the series' quantity; none if the exercises differ.
void addLimits(Plot& plot, ComparedSeries series, const StoredGesture& a, const StoredGesture& b);

/// What a picture of both gestures shows of their plans.
struct SharedPlan {
  std::optional<PlanView> plan_W;  ///< set only if both have the same plan
  std::string omission_reason;     ///< why an existing plan is not shown, as a line for people; otherwise
                                   ///< empty
};
/// For pictures of both gestures in W.
SharedPlan sharedPlanOf(const StoredGesture& a, const StoredGesture& b);

struct GestureComparison {
  Alignment alignment = Alignment::kDepth;
  std::vector<ComparedPoint> points;   ///< `at` ascends
  double dtw_distance_m = 0;           ///< kDtw only
  std::vector<std::string> sentences;  ///< maximum and mean differences
};

/// Returns the series to plot: force, speed, distance from the own line, distance from the planned line (if
/// at least one gesture has a plan), tilt.
std::vector<ComparedSeries> plottedSeries(const GestureComparison& comparison);

/// Errors: kInvalidInput if a gesture was never in tissue or is too long for time warping.
Result<GestureComparison> compareGestures(const StoredGesture& a, const StoredGesture& b,
                                          Alignment alignment);

}  // namespace needlelab
