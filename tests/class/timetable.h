/// The timetable of a class over some weeks, planned before the first attempt.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

struct ClassTrainee {
  std::string name;
  double skill = 0;  ///< on the first day, [0, 1] (client/device/hand/hand_options.h)
};

/// Parses NAME=SKILL. Errors: kInvalidInput with the text and the allowed form.
Result<ClassTrainee> parseTrainee(const std::string& text);

struct TimetableOptions {
  std::size_t exercises = 6;  ///< 1-100
  std::size_t attempts = 3;   ///< of everybody at each exercise, 1-50
  double weeks = 4;           ///< how long ago the first began, above 0, to 520
  /// Effect of practice: each attempt closes this share of the gap to skill 1, [0, 0.5].
  double practice = 0.012;
  std::uint64_t seed = 1;
};

/// One planned attempt.
struct PlannedAttempt {
  std::size_t trainee = 0, exercise = 0;
  std::size_t number = 0;  ///< at this exercise, from 0
  double skill = 0;        ///< of the hand, practice so far included
  std::int64_t started_unix_ns = 0;
  std::uint64_t seed = 0;  ///< of all random choices in it
};

/// All attempts, of one trainee after the other, each in order of time: exercises in their order, at least
/// five minutes apart, the last at least an hour before `now`; on working days between 8:00 and 17:00 UTC, as
/// long as there are days enough. The same for the same arguments.
std::vector<PlannedAttempt> planClass(const std::vector<ClassTrainee>& trainees,
                                      const TimetableOptions& options, std::int64_t now_unix_ns);

}  // namespace needlelab
