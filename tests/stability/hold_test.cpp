// The closed-loop cases of a hand that inserts, holds and stops; each with a control that fails.
#include <gtest/gtest.h>

#include "stability/case.h"

namespace needlelab {
namespace {

CaseRow rowOf(std::string_view name, AxialModel model, const ForceSourceFactory& source = engineSource()) {
  const auto file = CaseFile::embedded();
  if (!file.ok()) {
    ADD_FAILURE() << file.error().message;
    return {};
  }
  for (const StabilityCase& one : allCases()) {
    if (one.name != name) continue;
    const auto outcome = runCase(one, {*file, false}, model, source);
    if (outcome.ok()) return outcome->row;
    ADD_FAILURE() << outcome.error().message;
  }
  ADD_FAILURE() << "no case " << name;
  return {};
}

TEST(HoldQuantised, theForceStandsStill) {
  const CaseRow row = rowOf("hold_quantised", AxialModel::kEnhancedTrackingWall);
  EXPECT_EQ(row.verdict, Verdict::kStable) << *row.measured;
}

}  // namespace
}  // namespace needlelab
