/// Splits the rows of one curve, in file order, into insertion, hold and withdrawal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/curves/force_curve.h"

namespace needlelab {

/// kInvalidInput with the place and the problem.
inline Error wrongInput(const std::string& where, const std::string& why) {
  return {ErrorCode::kInvalidInput, where + ": " + why};
}

enum class CurvePhase : std::uint8_t { kInsert, kHold, kWithdraw };  ///< in this order over time
inline constexpr std::array<CurvePhase, 3> kCurvePhases = {CurvePhase::kInsert, CurvePhase::kHold,
                                                           CurvePhase::kWithdraw};
/// "insert", "hold", "withdraw", as in files.
std::string_view nameOf(CurvePhase phase);

struct CurveRows {
  ForceCurve curve;                ///< names; all rows are in `depth_m` and `force_N`
  std::vector<double> t_s;         ///< not descending; empty if unknown
  std::vector<CurvePhase> phases;  ///< per row; all kInsert if the file does not give them
  std::size_t first_line = 0;
  std::string where;                           ///< for messages
  bool has_depth = false, has_phases = false;  ///< otherwise depth is time × speed, and phases are detected
  bool digitised = false;                      ///< points of an insertion, in any order
  double insertion_s = 0;  ///< without depth and phases: the rows of so long are the insertion; 0: not said
};

/// Phases without a column are detected if depth is known: with time, rows within 0.1 mm of the greatest
/// depth are the hold, and later rows the withdrawal. A brief turning point does not count as a hold, nor a
/// few rows that go back as a withdrawal. Errors (kInvalidInput): a phase with too few rows or too short a
/// distance, a speed or time out of range; an insertion whose depth falls, is negative, or goes back more
/// than an instrument does (unless `digitised`); no depth, phase or insertion_s; a mean force that pulls the
/// needle in.
Result<ForceCurve> curveOf(CurveRows rows);

}  // namespace needlelab
