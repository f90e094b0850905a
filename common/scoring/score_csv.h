/// Scores as a table for other programs: one row for each attempt and measure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// What stands beside the measures of one score.
struct ScoreCsvAttempt {
  std::string session, trainee, exercise;  ///< ids; the session's as text
  std::uint32_t attempt = 0;               ///< number at that exercise, from 1
  std::int64_t started_unix_ns = 0;
  std::uint32_t definition_version = 0;
};

/// `session,trainee,exercise,attempt,started_unix_ns,definition_version,measure,value,unit,better,min,max,passed`
/// and a line feed. Stable: columns are only added at the end.
void appendScoreCsvHeader(std::string& out);

/// A row a measure, in the score's order: values with 17 significant digits, empty where nothing was
/// measured; min, max and passed (1 or 0) empty where nothing was required. Texts that begin like a formula
/// of a spreadsheet (= + - @) get a ' in front; those with commas, quotes or line feeds stand in quotes.
/// Errors: kCorrupt, `measures_json` is no score; nothing was appended.
Status appendScoreCsvRows(std::string& out, const ScoreCsvAttempt& attempt, const std::string& measures_json);

}  // namespace needlelab
