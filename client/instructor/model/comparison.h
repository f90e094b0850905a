/// Compares two gestures: which moment of one belongs to which of the other, and the differences there.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/instructor/model/stored_gesture.h"
#include "common/base/result.h"

namespace needlelab {

enum class Alignment : std::uint8_t {
  kDepth,  ///< of the insertion that goes deepest: where each first came to that inserted length
  kDtw,    ///< by dynamic time warping of the tips' paths in the limb's frame (scoring/dtw.h)
  kTime,   ///< since the first entry into tissue
};
std::string_view nameOf(Alignment alignment);

/// One place of the alignment. Values in SI; of `a` and `b` at their own times.
struct ComparedPoint {
  double at = 0;  ///< kDepth: inserted length, m; kDtw: share of the alignment, 0-1; kTime: s since the entry
  double time_a_s = 0, time_b_s = 0;
  double force_a_N = 0, force_b_N = 0;
  double speed_a_mps = 0, speed_b_mps = 0;
  double lateral_a_m = 0, lateral_b_m = 0;
  double insertion_a_m = 0, insertion_b_m = 0;
  double tilt_a_rad = 0, tilt_b_rad = 0;  ///< NaN where it is not known
  double apart_m = 0;                     ///< distance of the tips, each in its limb's frame
};

/// The series that can be drawn of both and of their difference b − a.
enum class ComparedSeries : std::uint8_t { kTotalForce, kSpeed, kLateral, kInsertion, kTilt };
inline constexpr std::size_t kComparedSeriesCount = 5;
std::string_view nameOf(ComparedSeries series);
double valueOfA(ComparedSeries series, const ComparedPoint& point);
double valueOfB(ComparedSeries series, const ComparedPoint& point);

struct GestureComparison {
  Alignment alignment = Alignment::kDepth;
  std::vector<ComparedPoint> points;   ///< `at` ascends
  double dtw_distance_m = 0;           ///< kDtw only
  std::vector<std::string> sentences;  ///< greatest and mean differences
};

/// Errors: kInvalidInput: one of them was never in tissue, or is too long to be warped.
Result<GestureComparison> compareGestures(const StoredGesture& a, const StoredGesture& b,
                                          Alignment alignment);

}  // namespace needlelab
