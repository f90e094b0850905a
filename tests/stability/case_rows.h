/// Runs single cases by name, for the tests of this folder.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "client/sim/stability/case.h"
#include "tests/support/reference_source.h"
#include "tests/support/run_form.h"

namespace needlelab::test {

/// The case of that name with the compiled-in cases.json; NEEDLELAB_LONG=1 takes the long form. A failure of
/// the running test when there is none, or when it cannot run.
inline CaseRow rowOf(std::string_view name, AxialModel model = AxialModel::kEnhancedTrackingWall,
                     const ForceSourceFactory& source = engineSource()) {
  const auto file = CaseFile::embedded();
  if (!file.ok()) {
    ADD_FAILURE() << file.error().message;
    return {};
  }
  const CaseSettings settings{*file, longForm()};
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

/// A row as text, for messages.
inline std::string rowText(const CaseRow& row) {
  return std::string(verdictText(row.verdict)) + ": " + row.quantity + " " +
         std::to_string(row.measured.value_or(-1)) + ", limit " + std::to_string(row.limit.value_or(-1)) +
         "; " + row.note;
}

/// The control: the reference with a planted defect, in the wall's place.
inline CaseRow rowWith(Defect planted, std::string_view name) {
  return rowOf(name, AxialModel::kEnhancedTrackingWall, referenceSource(planted));
}

}  // namespace needlelab::test
