#include "common/scoring/score_csv.h"

#include "common/base/csv.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/measures.h"

namespace needlelab {
namespace {

void appendScoreCsvText(std::string& out, std::string_view text) {
  const bool formula =
      !text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos;
  const bool quoted = text.find_first_of(",\"\n\r") != std::string_view::npos;
  if (quoted) out += '"';
  if (formula) out += '\'';
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  if (quoted) out += '"';
}

}  // namespace

void appendScoreCsvHeader(std::string& out) {
  out +=
      "session,trainee,exercise,attempt,started_unix_ns,definition_version,measure,value,unit,better,min,max,"
      "passed\n";
}

Status appendScoreCsvRows(std::string& out, const ScoreCsvAttempt& attempt,
                          const std::string& measures_json) {
  const auto measures = parseScore(measures_json);
  if (!measures) return measures.error();
  std::string beginning;
  for (const std::string* const text : {&attempt.session, &attempt.trainee, &attempt.exercise}) {
    appendScoreCsvText(beginning, *text);
    beginning += ',';
  }
  beginning += std::to_string(attempt.attempt) + "," + std::to_string(attempt.started_unix_ns) + "," +
               std::to_string(attempt.definition_version) + ",";
  const auto number = [&](bool is_there, double value) {
    out += ',';
    if (is_there) appendNumber(out, value);
  };
  for (const Measure& row : *measures) {
    out += beginning;
    appendScoreCsvText(out, row.name);
    number(row.measured, row.value);
    out += ',';
    appendScoreCsvText(out, row.unit);
    out += ',';
    out += betterName(betterOf(row.name));
    number(row.min.has_value(), row.min.value_or(0));
    number(row.max.has_value(), row.max.value_or(0));
    out += row.passed ? (*row.passed ? ",1\n" : ",0\n") : ",\n";
  }
  return {};
}

}  // namespace needlelab
