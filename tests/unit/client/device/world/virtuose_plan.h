/// Troubles in a lesson with a Virtuose: chosen by a seed, with a readable text.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/client/device/world/world_run.h"

namespace needlelab::test {

enum class VirtuoseTrouble : std::uint8_t {
  kHapticHangs,
  kLinkDown,        ///< nothing arrives, no call is answered
  kServiceStopped,  ///< and restarted
  kSlow,            ///< each call takes `amount` ms, possibly longer than its time-out
  kReleased,        ///< the dead-man sensor detects no hand
  kEmergencyStop,   ///< afterwards it is released and the power switch is pressed
  kSwitchedOff,
  kOverheated,
  kFailure,  ///< the device reports a failure
  kRefused,  ///< one function fails with one code, both chosen by `amount`
  kBadTurn,  ///< quaternions that are not rotations
  kJump,     ///< the handle moves by `amount` mm
  kButton,   ///< button 1-3 is pressed: no trouble, but must be reported
};
inline constexpr int kVirtuoseTroubles = 13;

/// Commands of the stand-in, separated by semicolons; in braces the values of a PlannedVirtuoseTrouble:
/// {amount}, {milli} (amount / 1000), {lasts_s}, {answer_s} (a call's normal duration).
struct VirtuoseTroubleRow {
  const char *name, *begins, *ends;
};
const VirtuoseTroubleRow& rowOf(VirtuoseTrouble trouble);

struct PlannedVirtuoseTrouble {
  VirtuoseTrouble what;
  std::int64_t at_ns, lasts_ns;  ///< from the beginning of the lesson
  int amount = 0;
};

/// All numbers of a run.
struct VirtuosePlan : LessonPlan {
  std::int64_t keeper_late_ns = 0;  ///< greatest lateness of the keeper's and the keep-alive's wake-ups
  std::int64_t answer_ns = 0;       ///< time that each call takes
  std::int64_t prepare_ns = 0;      ///< how long the device is open before the loop runs
  double deepest_m = 0.015;         ///< of the hand's stroke
  bool ends_in_trouble = false;     ///< the device is closed while troubles last
  std::vector<PlannedVirtuoseTrouble> troubles;
};

/// What a kRefused trouble of this amount means. Functions that are only called while the device is opened
/// are excluded.
struct RefusedCall {
  const char* function;
  int code;  ///< the vendor's
};
RefusedCall refusedCall(int amount);

/// The same seed gives the same plan on any machine.
VirtuosePlan virtuosePlanOf(std::uint64_t seed);
/// Readable text.
std::string textOf(const VirtuosePlan& plan);

}  // namespace needlelab::test
