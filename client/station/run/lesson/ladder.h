/// A trainee's ladder: the courses' steps with their states, individually assigned exercises, and exercises
/// for free practice. Pure: the same curriculum, trainee and time give the same ladder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/lesson/curriculum.h"

namespace needlelab {

enum class StepState : std::uint8_t {
  kUnknown,  ///< the trainee's standing is not known
  kDone,
  kNext,    ///< the first open step of all assigned ones
  kOpen,    ///< may be begun
  kLocked,  ///< other exercises must be passed first
  kUsedUp,  ///< no attempts left
};

/// For a step that is not done.
enum class DueState : std::uint8_t { kNone, kLater, kSoon, kOver };

struct LadderStep {
  std::string exercise_id, name, description;
  int number = 0;     ///< in its course, from 1; 0: listed outside its course
  bool exam = false;  ///< belongs to an exam
  StepState state = StepState::kUnknown;
  bool may_begin = true;                       ///< by the server's rules: not locked, and attempts are left
  std::string locked_by;                       ///< "step 2", "\"Knee: recess\"", or several; empty: nothing
  std::uint32_t attempts = 0;                  ///< counted attempts
  std::optional<std::uint32_t> attempts_left;  ///< none: unlimited or unknown
  DueState due = DueState::kNone;
  std::int64_t due_unix_ns = 0;  ///< 0: never
};

struct LadderSection {
  std::string heading;
  std::vector<LadderStep> steps;
};

struct Ladder {
  /// Assigned courses, "Assigned to you", the other courses; without a standing, the courses. Omits what the
  /// trainee may not take (canStart). Lists each exercise once.
  std::vector<LadderSection> sections;
  std::string next;                ///< the step marked kNext; empty: none
  std::int64_t as_of_unix_ns = 0;  ///< when the server gave the standing; 0: unknown
};

Ladder ladderOf(const Curriculum& curriculum, const std::string& trainee, std::int64_t now_unix_ns);

/// "1 attempt left", "no attempt left".
std::string attemptsLeftText(std::uint32_t left);
/// "exam · Next · not passed, 3 attempts · due soon: 2026-11-24 12:00 · 2 attempts left"; empty if nothing is
/// known.
std::string stepText(const LadderStep& step);
/// "next", "locked", …: for JSON; "unknown" without a standing.
std::string stepStateName(StepState state);
/// The ladder as lines for a terminal: number, id, name, state. `who`: the trainee's shown name. `away`: the
/// standing comes from the cache.
std::string ladderText(const Ladder& ladder, const std::string& who, bool away);

}  // namespace needlelab
