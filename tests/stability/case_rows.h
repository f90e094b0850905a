/// Runs single cases by name, for the tests of this folder.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "client/sim/stability/case.h"
#include "tests/support/reference/reference_source.h"
#include "tests/support/run_form.h"

namespace needlelab::test {

/// The case with that name in `file`. Fails the running test if there is none, or if it cannot run.
inline CaseRow rowFrom(const CaseSettings& settings, std::string_view name,
                       const ForceSourceFactory& source = engineSource(),
                       AxialModel model = AxialModel::kEnhancedTrackingWall) {
  for (const StabilityCase& one : allCases()) {
    if (one.name != name) continue;
    const auto outcome = runCase(one, settings, model, source);
    if (outcome.ok()) return outcome->row;
    ADD_FAILURE() << outcome.error().message;
    return {};
  }
  ADD_FAILURE() << "no case " << name;
  return {};
}

/// The same with the compiled-in cases.json; NEEDLELAB_LONG=1 takes the long form.
inline CaseRow rowOf(std::string_view name, AxialModel model = AxialModel::kEnhancedTrackingWall,
                     const ForceSourceFactory& source = engineSource(), const CaseControl& control = {}) {
  static const CaseFile file = CaseFile::embedded().value();
  return rowFrom({file, longForm(), control}, name, source, model);
}

/// The same with one field of the case's entry changed.
inline CaseRow rowWithField(std::string_view name, const char* field, const nlohmann::json& value,
                            const ForceSourceFactory& source = engineSource(),
                            const CaseControl& control = {}) {
  auto json = CaseFile::embedded().value().json();
  json["cases"][std::string(name)][field] = value;
  const auto file = CaseFile::parse(json.dump(), "changed").value();
  return rowFrom({file, false, control}, name, source);
}

/// Bad samples that do not pass a gate.
inline CaseControl withoutGate() {
  CaseControl control;
  control.gate = false;
  return control;
}

/// A row as text, for messages.
inline std::string rowText(const CaseRow& row) {
  return std::string(verdictText(row.verdict)) + ": " + row.quantity + " " +
         std::to_string(row.measured.value_or(-1)) + ", limit " + std::to_string(row.limit.value_or(-1)) +
         "; " + row.note;
}

inline testing::AssertionResult isStable(const CaseRow& row) {
  return (row.verdict == Verdict::kStable && row.applicable && row.finite && row.passed
              ? testing::AssertionSuccess()
              : testing::AssertionFailure())
         << row.case_name << " " << rowText(row);
}

/// Control: the reference with a planted defect, replacing the wall.
inline CaseRow rowWith(Defect planted, std::string_view name) {
  return rowOf(name, AxialModel::kEnhancedTrackingWall, referenceSource(planted));
}

}  // namespace needlelab::test
