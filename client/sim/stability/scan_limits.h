/// The largest stable stiffness of each axial model over rate and delay, found in closed loop and compared
/// with theory.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/stability/case.h"
#include "common/base/result.h"

namespace needlelab {

/// One model at one rate and delay.
struct StiffnessLimitRow {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  double rate_hz = 0;
  unsigned delay_ticks = 0;
  double stiffness_N_per_m = 0;  ///< largest stable one found, to 2 %
  bool at_cap = false;           ///< still stable at the largest stiffness of a profile: the limit is higher
  double felt_N_per_m = 0;       ///< force over depth at that stiffness, measured in the nudge
  double coupled_N_per_m = 0;    ///< (b + b_hand)/(T(½ + d)): Colgate and Schenkel, with delay and this hand
  double passive_N_per_m = 0;    ///< b/(T(½ + d)): device alone, any hand
  double sampled_N_per_m = 0;    ///< exact limit of the linear loop, with the model's own damper
  int runs = 0;                  ///< number of closed-loop runs
};

struct StiffnessLimits {
  std::vector<StiffnessLimitRow> rows;
  std::vector<std::string> notes;  ///< models that could not be scanned, and why
};

/// Called now and then with the current work and the finished share (0-1).
using StabilityProgress = std::function<void(std::string_view doing, double share)>;

/// Bisects K; scenes, plant, nudge, rates and delays come from "stiffness_limits" in cases.json. About 20 s
/// on one core. Deterministic. Errors: kInvalidInput if the entry is invalid.
Result<StiffnessLimits> findStiffnessLimits(const CaseSettings& settings, const StabilityProgress& progress);

/// The same, written into the existing `dir`: stiffness_limits.csv and .json, and a .png if gnuplot is
/// found.
Result<StiffnessLimits> drawStiffnessLimits(const std::filesystem::path& dir, const CaseSettings& settings,
                                            const StabilityProgress& progress);

}  // namespace needlelab
