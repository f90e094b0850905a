#include "common/scoring/attempts/result_table.h"

#include <algorithm>
#include <optional>

#include "common/base/time/clock.h"
#include "common/base/units.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

constexpr std::string_view kColumns[] = {"Person",        "Full name",    "Groups",
                                         "Exercise",      "Verdict",      "Attempts",
                                         "Attempts left", "Best attempt", "Date of best attempt (UTC)"};

const char* verdictOf(const pb::ResultCell& cell) {
  if (cell.attempts() == 0) return cell.excused() > 0 ? "excused" : "not tried";
  return verdictName(cell.has_passed() ? std::optional(cell.passed()) : std::nullopt);
}

}  // namespace

ShownUnit columnUnitOf(std::string_view name) {
  const MeasureKind* const kind = measureKind(name);
  if (kind == nullptr) return {};
  if (kind->form == MeasureForm::kShare) return {100, "%"};
  return shownUnitOf(kind->unit);
}

void ResultTable::begin(std::string& out, const pb::Results& first) {
  measures_.assign(first.required_measures().begin(), first.required_measures().end());
  for (int i = 0; i < first.exercise_ids_size(); ++i)
    exercise_names_[first.exercise_ids(i)] = first.exercise_names(i);
  out += kUtf8Mark;
  for (const std::string_view column : kColumns) {
    if (column != kColumns[0]) out += style_.separator;
    appendCsvText(out, column, style_.separator);
  }
  for (const std::string& name : measures_) {
    const std::string_view unit = columnUnitOf(name).name;
    std::string title = measureWords(name);
    if (!unit.empty()) title.append(" [").append(unit).append("]");
    out += style_.separator;
    appendCsvText(out, title, style_.separator);
  }
  out += "\r\n";
}

Status ResultTable::add(std::string& out, const pb::ResultRow& person, const pb::ResultCell& cell) const {
  std::vector<Measure> measures;
  if (!cell.best().score_json().empty()) {
    ASSIGN_OR_RETURN(measures, parseScore(cell.best().score_json()));
  }
  std::string groups;
  for (const std::string& group : person.groups()) groups += (groups.empty() ? "" : "; ") + group;
  const auto name = exercise_names_.find(cell.exercise_id());

  appendCsvText(out, person.trainee(), style_.separator);
  const auto text = [&](std::string_view value) {
    out += style_.separator;
    appendCsvText(out, value, style_.separator);
  };
  const auto number = [&](std::optional<double> value) {
    out += style_.separator;
    if (value) appendCsvNumber(out, *value, style_.decimal_sign);
  };
  text(person.full_name());
  text(groups);
  text(name == exercise_names_.end() ? cell.exercise_id() : name->second);
  text(verdictOf(cell));
  number(cell.attempts());
  number(cell.has_attempts_left() ? std::optional<double>(cell.attempts_left()) : std::nullopt);
  number(cell.has_best() ? std::optional<double>(cell.best().number()) : std::nullopt);
  text(cell.has_best() ? spreadsheetTime(cell.best().started_unix_ns()) : std::string());
  for (const std::string& wanted : measures_) {
    const auto found = std::find_if(measures.begin(), measures.end(),
                                    [&](const Measure& row) { return row.name == wanted; });
    const bool has_value = found != measures.end() && found->measured;
    number(has_value ? std::optional(found->value * columnUnitOf(wanted).per_si) : std::nullopt);
  }
  out += "\r\n";
  return {};
}

}  // namespace needlelab
