#include "client/sim/stability/case.h"

#include <algorithm>
#include <array>
#include <utility>

namespace needlelab {

std::string_view verdictText(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStable:
      return "stable";
    case Verdict::kChatters:
      return "chatters";
    case Verdict::kDiverges:
      return "diverges";
    case Verdict::kNotApplicable:
      break;
  }
  return "";
}

std::vector<StabilityCase> allCases() {
  std::vector<StabilityCase> all;
  for (auto&& part : {holdCases(), motionCases(), scanCases()})
    for (const StabilityCase& one : part) all.push_back(one);
  return all;
}

Result<CaseOutcome> runCase(const StabilityCase& hard_case, const CaseSettings& settings, AxialModel model,
                            const ForceSourceFactory& source) {
  CaseOutcome outcome;
  if (hard_case.axial || model == AxialModel::kEnhancedTrackingWall) {
    auto ran = hard_case.run(settings, model, source);
    if (!ran.ok()) return ran.error();
    outcome = *std::move(ran);
  }
  outcome.row.case_name = hard_case.name;
  outcome.row.model = model;
  return outcome;
}

void judge(CaseRow& row, bool growing) {
  // two encoder counts of 5 mN are 0.01 N, whatever the last bit says
  constexpr double kRounding = 1 + 1e-9;
  row.applicable = true;
  row.passed = row.finite && !growing && row.measured && row.limit && *row.measured <= *row.limit * kRounding;
  if (row.passed)
    row.verdict = Verdict::kStable;
  else
    row.verdict = !row.finite || growing ? Verdict::kDiverges : Verdict::kChatters;
}

bool hasStop(AxialModel model) {
  constexpr std::array kWithStop = {AxialModel::kEnhancedTrackingWall, AxialModel::kTrackingWall,
                                    AxialModel::kStatistical, AxialModel::kPrecomputed};
  return std::find(kWithStop.begin(), kWithStop.end(), model) != kWithStop.end();
}

}  // namespace needlelab
