/// The largest stable stiffness of every axial model over rate and delay, found in closed loop, beside the
/// theory.
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
  double stiffness_N_per_m = 0;  ///< the largest that was found stable, to 2 %
  bool at_cap = false;           ///< stable still at the largest stiffness of a profile: the limit lies above
  double felt_N_per_m = 0;       ///< force over depth at that stiffness, measured in the nudge
  double coupled_N_per_m = 0;    ///< (b + b_hand)/(T(½ + d)): Colgate and Schenkel, with delay and this hand
  double passive_N_per_m = 0;    ///< b/(T(½ + d)): of the device alone, whatever the hand
  double sampled_N_per_m = 0;    ///< the exact limit of the linear loop, with the model's own damper
  int runs = 0;                  ///< closed-loop runs that it took
};

/// One dry friction at one encoder step: the largest stiffness at which the wall comes to a full rest.
struct RestLimitRow {
  double encoder_step_m = 0;
  double dry_friction_N = 0;
  double stiffness_N_per_m = 0;
  bool at_cap = false;
  double theory_N_per_m = 0;  ///< min(2b/T, 2f_c/Δ)
  double bound_N_per_m = 0;   ///< 2b/T
};

/// The response to a nudge of one model beyond its largest stable stiffness.
struct BeyondRow {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  double rate_hz = 0;
  unsigned delay_ticks = 0;
  double stiffness_N_per_m = 0;  ///< the largest that was found stable, times the factor of cases.json
  double swing_N = 0;            ///< force peak-to-peak near the end
  double max_force_N = 0;        ///< of the whole run
  bool held = false;             ///< only the cap of the sum or the gate held it
  CaseTrace trace;               ///< from the nudge on, t = 0 at its end
};

struct StiffnessLimits {
  std::vector<StiffnessLimitRow> rows;
  std::vector<BeyondRow> beyond;
  std::vector<RestLimitRow> rest;
  std::vector<std::string> notes;  ///< models that could not be scanned, and why
};

/// Called now and then with the current work and the share that is done (0-1).
using StabilityProgress = std::function<void(std::string_view doing, double share)>;

/// By bisection on K; scenes, plant, nudge, rates and delays are those of "stiffness_limits" and
/// "stiffness_beyond" in cases.json. About 20 s on one core.
/// Deterministic. Errors: kInvalidInput when the entry does not fit.
Result<StiffnessLimits> findStiffnessLimits(const CaseSettings& settings, const StabilityProgress& progress);

/// The same, written into `dir`, which must exist: stiffness_limits.csv, stiffness_rest.csv,
/// stiffness_beyond.csv, all of it in stiffness_limits.json, and where gnuplot is found a .png of each.
Result<StiffnessLimits> drawStiffnessLimits(const std::filesystem::path& dir, const CaseSettings& settings,
                                            const StabilityProgress& progress);

}  // namespace needlelab
