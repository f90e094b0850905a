/// A lesson's score as the End screen tells it: passed or not, and why.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/lesson_audience.h"

namespace needlelab {

struct VerdictRow {
  std::string words;           ///< the measure and its requirement as a sentence
  std::optional<bool> passed;  ///< none: nothing is required of it
};

struct LessonVerdict {
  enum class Kind : std::uint8_t { kPassed, kNotYet, kNoRequirements, kNoScore };
  Kind kind = Kind::kNoScore;
  std::string title;                 ///< "Passed", "Not yet: 2 of 8 requirements are missing"
  std::vector<VerdictRow> required;  ///< what was not met first
  std::vector<VerdictRow> others;    ///< all other measures
  std::string ended;                 ///< how the lesson ended: "time is over", "stopped by ines: wrong side"
  std::string kept;       ///< where the recording is: "with the server", "in this station's spool", …
  bool kept_well = true;  ///< false: something of it is lost or refused
  std::string by;         ///< who scored it: "by the server"; empty without a score
};

/// Pure.
LessonVerdict verdictOf(const LessonOutcome& outcome);

}  // namespace needlelab
