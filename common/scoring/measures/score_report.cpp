// Output of scores: the exercise's requirements, JSON, a table for a terminal, CSV.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/base/range.h"
#include "common/base/text/csv.h"
#include "common/base/text/strict_json.h"
#include "common/base/time/clock.h"
#include "common/haptics/scene_spec.h"
#include "common/scoring/measures/measure_groups.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

/// Width on a terminal: the number of bytes that do not continue a UTF-8 character.
std::size_t widthOf(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

/// "Peak force 3.2 N", or a plain statement of a yes or no.
std::string statement(const Measure& row, const MeasureKind& kind) {
  if (kind.form != MeasureForm::kYesNo) return row.words + " " + measureText(row.name, row.value, row.unit);
  return std::string(row.value > 0 ? kind.words : kind.yes_no.no);
}

std::string verdict(const Measure& row, const MeasureKind& kind) {
  if (kind.form == MeasureForm::kYesNo) {
    if (*row.passed) return "";
    return row.value > 0 ? ": " + std::string(kind.yes_no.unwanted) : ": it had to be";
  }
  const auto text = [&](double value) { return measureText(row.name, value, row.unit); };
  // if rounding hides the difference, state that there is one
  const auto just = [&](double limit) { return text(limit) == text(row.value) ? "just " : ""; };
  if (row.min && row.value < *row.min) {
    return std::string(": ") + just(*row.min) + "below the " + text(*row.min) + " asked for";
  }
  if (row.max && row.value > *row.max) {
    return std::string(": ") + just(*row.max) + "above the " + text(*row.max) + " allowed";
  }
  if (row.min && row.max) return ": within " + text(*row.min) + " to " + text(*row.max);
  return row.max ? ": within the " + text(*row.max) + " allowed"
                 : ": at least the " + text(*row.min) + " asked for";
}

// --- measures that are missing

bool always(const GestureFacts& /*facts*/) {
  return true;
}
bool neverIn(const GestureFacts& facts) {
  return facts.entries == 0;
}
bool noTarget(const GestureFacts& facts) {
  return !facts.target_reached;
}
bool noLandmark(const GestureFacts& facts) {
  return !facts.has_landmark;
}
bool noInjection(const GestureFacts& facts) {
  return facts.injections == 0;
}

/// Why a gesture does not have a measure with this need, if `is_so`.
struct MissingReason {
  MeasureNeed need;
  bool (*is_so)(const GestureFacts& facts);
  const char* words;
};
constexpr const char* kNeverIn = "The needle did not go into tissue.";
constexpr const char* kNoTarget = "The patient has no target.";
constexpr const char* kNoInjection = "You did not inject.";
/// The first applicable reason is used. `tests/unit/common/scoring/measures/words_test.cpp` checks one for
/// each need.
constexpr MissingReason kMissingReasons[] = {
    {MeasureNeed::kRecording, always, "Too little was recorded."},
    {MeasureNeed::kMovement, always, "The needle hardly moved."},
    {MeasureNeed::kTissue, always, kNeverIn},
    {MeasureNeed::kLayer, always, "The needle was not in layer K."},
    {MeasureNeed::kTarget, always, kNoTarget},
    {MeasureNeed::kTargetAndTissue, noTarget, kNoTarget},
    {MeasureNeed::kTargetAndTissue, always, kNeverIn},
    {MeasureNeed::kPlan, neverIn, kNeverIn},
    {MeasureNeed::kPlan, always, "The exercise has no planned line."},
    {MeasureNeed::kInjectionAtTarget, noInjection, kNoInjection},
    {MeasureNeed::kInjectionAtTarget, always, kNoTarget},
    {MeasureNeed::kInjectionInTissue, noInjection, kNoInjection},
    {MeasureNeed::kInjectionInTissue, always, "You did not inject into tissue."},
    {MeasureNeed::kReference, neverIn, kNeverIn},
    {MeasureNeed::kReference, always, "There is no reference gesture to compare with."},
    {MeasureNeed::kLandmark, noLandmark, "The patient has no landmark."},
    {MeasureNeed::kLandmark, always, "You did not press on the landmark with the cap on."},
};

std::string whyMissing(const Measure& row, const GestureFacts& facts,
                       std::span<const std::string> layer_names) {
  const MeasureKind* const kind = measureKind(row.name);
  if (kind == nullptr) return row.name + " is not a measure that this program knows";
  for (const MissingReason& reason : kMissingReasons)
    if (reason.need == kind->need && reason.is_so(facts))
      return withLayer(reason.words, row.name, layer_names);
  return {};
}

/// Narrows a row's requirement; all requirements on the same measure apply.
void require(Measure& row, std::optional<double> min, std::optional<double> max) {
  if (min) row.min = row.min ? std::max(*row.min, *min) : *min;
  if (max) row.max = row.max ? std::min(*row.max, *max) : *max;
}

void require(std::vector<Measure>& measures, const std::string& name, std::optional<double> min,
             std::optional<double> max) {
  auto row = std::find_if(measures.begin(), measures.end(), [&](const Measure& m) { return m.name == name; });
  if (row == measures.end()) {
    Measure missing;
    missing.name = name;
    if (const MeasureKind* const kind = measureKind(name); kind != nullptr) missing.unit = kind->unit;
    missing.measured = false;
    row = measures.insert(measures.end(), missing);
  }
  require(*row, min, max);
}

}  // namespace

const char* verdictName(std::optional<bool> passed) {
  if (!passed) return "no verdict";
  return *passed ? "passed" : "not passed";
}

std::string scoreJson(std::span<const Measure> measures) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Measure& measure : measures) {
    nlohmann::ordered_json row;
    row["measure"] = measure.name;
    row["value"] = measure.measured ? nlohmann::ordered_json(measure.value) : nlohmann::ordered_json(nullptr);
    row["unit"] = measure.unit;
    if (measure.min) row["min"] = *measure.min;
    if (measure.max) row["max"] = *measure.max;
    if (measure.passed) row["passed"] = *measure.passed;
    if (measure.incomplete) row["incomplete"] = true;
    row["words"] = measure.words;
    rows.push_back(std::move(row));
  }
  return rows.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

Result<std::vector<Measure>> parseScore(const std::string& json) {
  const auto rows = readShallowJson<nlohmann::json>(json);
  const Error wrong{ErrorCode::kCorrupt, "a stored score is not a list of measures"};
  if (!rows.is_array()) return wrong;
  std::vector<Measure> measures;
  const auto limit = [](const nlohmann::json& row, const char* key) {
    const auto found = row.find(key);
    return found != row.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
  };
  for (const auto& row : rows) {
    if (!row.is_object() || !row.contains("measure") || !row["measure"].is_string() || !row.contains("value"))
      return wrong;
    Measure measure;
    measure.name = row["measure"].get<std::string>();
    measure.measured = row["value"].is_number();
    if (measure.measured) measure.value = row["value"].get<double>();
    if (row.contains("unit") && row["unit"].is_string()) measure.unit = row["unit"].get<std::string>();
    if (row.contains("words") && row["words"].is_string()) measure.words = row["words"].get<std::string>();
    measure.min = limit(row, "min");
    measure.max = limit(row, "max");
    if (row.contains("passed") && row["passed"].is_boolean()) measure.passed = row["passed"].get<bool>();
    if (const auto found = row.find("incomplete"); found != row.end()) measure.incomplete = *found == true;
    measures.push_back(std::move(measure));
  }
  return measures;
}

std::string scoreText(std::span<const Measure> measures) {
  // required measures first, then the others
  std::vector<const Measure*> order;
  for (const Measure& measure : measures) {
    if (measure.passed) order.push_back(&measure);
  }
  const std::size_t required = order.size();
  for (const Measure& measure : measures) {
    if (!measure.passed) order.push_back(&measure);
  }

  std::size_t name_width = 0, value_width = 0;
  const auto valueOf = [](const Measure& m) {
    if (!m.measured) return std::string("-");
    return fmt::format("{:.6g}{}{}", m.value, m.unit.empty() ? "" : " ", m.unit);
  };
  for (const Measure* measure : order) {
    name_width = std::max(name_width, measure->name.size());
    value_width = std::max(value_width, widthOf(valueOf(*measure)));
  }

  std::string text;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Measure& measure = *order[i];
    if (i == required && required > 0) text += "\n";
    const std::string value = valueOf(measure);
    text += fmt::format("{:<12}", measure.passed ? verdictName(measure.passed) : "") + measure.name +
            std::string(name_width - measure.name.size() + 2, ' ') +
            std::string(value_width - widthOf(value), ' ') + value + "  " + measure.words + "\n";
  }
  return text;
}

void applyRequirements(const pb::Exercise* exercise, const GestureFacts& facts,
                       std::span<const std::string> layer_names, std::vector<Measure>& measures) {
  if (exercise != nullptr) {
    if (exercise->has_time_limit_s())
      require(measures, std::string(measureOf(MeasureRole::kTime).name), {}, exercise->time_limit_s());
    for (const auto& r : exercise->requirements()) {
      require(measures, r.measure(), r.has_min() ? std::optional(r.min()) : std::nullopt,
              r.has_max() ? std::optional(r.max()) : std::nullopt);
    }
  }
  for (Measure& row : measures) {
    const bool is_required = row.min || row.max;
    if (!row.measured) {
      row.passed = false;
      row.words = whyMissing(row, facts, layer_names);
      continue;
    }
    const MeasureKind& kind = *measureKind(row.name);
    row.incomplete = facts.incomplete && !kind.over_holes;
    row.words = statement(row, kind);
    if (!is_required) {
      if (row.incomplete) row.words += " (incomplete)";
      continue;
    }
    row.passed = (!row.min || row.value >= *row.min) && (!row.max || row.value <= *row.max);
    if (row.incomplete && *row.passed) {
      row.passed = false;
      row.words +=
          ": not judged, because " + valueText(facts.missing_s, "s") + " of the recording are missing";
      continue;
    }
    row.words += verdict(row, kind);
  }
  // layers that the tip was never in, or was in without any force
  std::erase_if(measures, isOfTissueNotMet);
}

bool isMeasureName(std::string_view name) {
  return measureKind(name) != nullptr;
}

Status checkRequirements(const pb::Exercise& exercise) {
  for (int i = 0; i < exercise.requirements_size(); ++i) {
    const std::string& name = exercise.requirements(i).measure();
    if (const MeasureKind* const kind = measureKind(name); kind != nullptr) {
      if (kind->need != MeasureNeed::kPlan || exercise.has_plan()) continue;
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format("requirements[{}].measure: {} needs a plan, and the exercise has none: give it a "
                      "plan, or take the requirement away",
                      i, name)};
    }
    std::string known;
    for (const MeasureKind& kind : measureKinds())
      known += (known.empty() ? "" : ", ") + std::string(kind.name);
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("requirements[{}].measure: \"{}\" is not one of {} (K: a layer, 1 to {})", i,
                             name, known, kMaxLayers)};
  }
  return {};
}

void appendScoreCsvHeader(std::string& out) {
  out +=
      "session,trainee,exercise,attempt,started,definition_version,measure,value,unit,better,min,max,"
      "passed\n";
}

Status appendScoreCsvRows(std::string& out, const ScoreCsvAttempt& attempt,
                          const std::string& measures_json) {
  ASSIGN_OR_RETURN(const auto measures, parseScore(measures_json));
  std::string beginning;
  for (const std::string* const text : {&attempt.session, &attempt.trainee, &attempt.exercise}) {
    appendCsvText(beginning, *text);
    beginning += ',';
  }
  beginning += fmt::format("{},{},{},", attempt.attempt, isoTimeMs(attempt.started_unix_ns),
                           attempt.definition_version);
  const auto number = [&](bool is_there, double value) {
    out += ',';
    if (is_there) appendNumber(out, value);
  };
  for (const Measure& row : measures) {
    out += beginning;
    appendCsvText(out, row.name);
    number(row.measured, row.value);
    out += ',';
    appendCsvText(out, row.unit);
    out += ',';
    out += betterName(betterOf(row.name));
    number(row.min.has_value(), row.min.value_or(0));
    number(row.max.has_value(), row.max.value_or(0));
    out += row.passed ? (*row.passed ? ",1\n" : ",0\n") : ",\n";
  }
  return {};
}

}  // namespace needlelab
