/// The rows of one curve, in the order of the file, to insertion, hold and withdrawal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/curve_set.h"
#include "common/base/result.h"

namespace needlelab {

/// kInvalidInput: the place, and what is wrong there.
inline Error wrongInput(const std::string& where, const std::string& why) {
  return {ErrorCode::kInvalidInput, where + ": " + why};
}

enum class CurvePhase : std::uint8_t { kInsert, kHold, kWithdraw };  ///< in this order in time
inline constexpr std::array<CurvePhase, 3> kCurvePhases = {CurvePhase::kInsert, CurvePhase::kHold,
                                                           CurvePhase::kWithdraw};
/// "insert", "hold", "withdraw": as files say it.
std::string_view nameOf(CurvePhase phase);

struct CurveRows {
  ForceCurve curve;                ///< its names; all rows in `depth_m` and `force_N`
  std::vector<double> t_s;         ///< not going back; empty: not known
  std::vector<CurvePhase> phases;  ///< of each row; all kInsert where the file says none
  std::size_t first_line = 0;
  std::string where;                            ///< for messages
  bool has_depth = false, says_phases = false;  ///< else depth is time × speed; phases are recognised
  bool digitised = false;                       ///< points of an insertion in any order
};

/// Phases that no column says are recognised where depth is known: with time, what lies within 0.1 mm of the
/// greatest depth is the hold; what comes behind is the withdrawal. A moment at the turning point is no hold,
/// and a few rows that go back are no withdrawal. Errors (kInvalidInput): a phase with too few rows, too
/// short a way, a speed or a time out of range; an insertion whose depth falls, is negative, or goes back by
/// more than an instrument does (unless `digitised`); a mean force that pulls the needle in.
Result<ForceCurve> curveOf(CurveRows rows);

}  // namespace needlelab
