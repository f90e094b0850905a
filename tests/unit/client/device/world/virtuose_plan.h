/// What goes wrong in a lesson with a Virtuose: chosen by a seed, readable for a person.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/client/device/world/world_run.h"

namespace needlelab::test {

enum class VirtuoseTrouble : std::uint8_t {
  kHapticHangs,
  kLinkDown,        ///< nothing arrives, no call is answered
  kServiceStopped,  ///< and is started again
  kSlow,            ///< each call takes `amount` ms, perhaps longer than its time-out
  kReleased,        ///< the dead-man sensor feels no hand
  kEmergencyStop,   ///< afterwards it is released, and the power switch is pressed
  kSwitchedOff,
  kOverheated,
  kFailure,  ///< the device reports one
  kRefused,  ///< one function fails with one code, both chosen by `amount`
  kBadTurn,  ///< quaternions that are no rotations
  kJump,     ///< the handle, by `amount` mm
  kButton,   ///< number 1-3 is pressed: no trouble, but to be reported
};
inline constexpr int kVirtuoseTroubles = 13;

/// Commands of the stand-in, separated by semicolons; in braces what a PlannedVirtuoseTrouble says: {amount},
/// {milli} (amount / 1000), {lasts_s}, {answer_s} (what a call takes otherwise).
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
  std::int64_t keeper_late_ns = 0;  ///< greatest lateness of keeper's and keep-alive's wake-ups
  std::int64_t answer_ns = 0;       ///< time that each call takes
  std::int64_t prepare_ns = 0;      ///< the device is open, and no loop runs
  double deepest_m = 0.015;         ///< of the hand's stroke
  bool ends_in_trouble = false;     ///< the device is closed as it is
  std::vector<PlannedVirtuoseTrouble> troubles;
};

/// What a kRefused trouble of this amount means. No function is one that is only called while the device is
/// opened.
struct RefusedCall {
  const char* function;
  int code;  ///< of the vendor
};
RefusedCall refusedCall(int amount);

/// The same seed, the same plan, on any machine.
VirtuosePlan virtuosePlanOf(std::uint64_t seed);
/// For a person.
std::string textOf(const VirtuosePlan& plan);

}  // namespace needlelab::test
