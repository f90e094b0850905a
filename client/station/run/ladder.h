/// A trainee's ladder: the courses' steps with their states, what is assigned one by one, and what may be
/// practised freely. Pure: the same curriculum, trainee and time give the same ladder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/curriculum.h"

namespace needlelab {

enum class StepState : std::uint8_t {
  kUnknown,  ///< the trainee's standing is not known
  kDone,
  kNext,    ///< the first open one of all that is assigned
  kOpen,    ///< may be begun
  kLocked,  ///< others have to be passed first
  kUsedUp,  ///< no attempt is left
};

/// Of a step that is not done.
enum class DueState : std::uint8_t { kNone, kLater, kSoon, kOver };

struct LadderStep {
  std::string exercise_id, name, description;
  int number = 0;  ///< in its course, from 1; 0: it stands outside its course
  StepState state = StepState::kUnknown;
  bool may_begin = true;                       ///< by the server's rules: not locked, and an attempt is left
  std::string locked_by;                       ///< "step 2", "\"Knee: recess\"", or several; empty: nothing
  std::uint32_t attempts = 0;                  ///< that count
  std::optional<std::uint32_t> attempts_left;  ///< none: unlimited, or not known
  DueState due = DueState::kNone;
  std::int64_t due_unix_ns = 0;  ///< 0: never
};

struct LadderSection {
  std::string heading;
  std::vector<LadderStep> steps;
};

struct Ladder {
  /// Assigned courses, "Assigned to you", the other courses. Without a standing: the courses. Without what
  /// the trainee may not take (mayTake). No exercise occurs twice.
  std::vector<LadderSection> sections;
  std::string next;                ///< the step marked kNext; empty: none
  std::int64_t as_of_unix_ns = 0;  ///< when the server gave the standing; 0: it is not known
};

Ladder ladderOf(const Curriculum& curriculum, const std::string& trainee, std::int64_t now_unix_ns);

/// "Next · not passed, 3 attempts · due soon: 2026-11-24 12:00 · 2 attempts left"; empty if nothing is known.
std::string stepText(const LadderStep& step);
/// "next", "locked", …: for JSON; "unknown" without a standing.
std::string stepStateName(StepState state);
/// The ladder as lines for a terminal: number, id, name, state. `who`: the trainee as shown. `away`: the
/// standing is of the cache.
std::string ladderText(const Ladder& ladder, const std::string& who, bool away);

}  // namespace needlelab
