#include "common/haptics/models/statistical.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/det_math.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/models/axial_entry.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxStatisticalRows = 256;
constexpr NumberRange kFactor{0, 10, true};
// above this share of the mean a log-normal force is meaningless; consequently sd is 0 where the mean is 0
constexpr double kMostSdShare = 10;

struct Statistical {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr bool kHasWall = true;
  static constexpr bool kRelaxes = true;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool stop_begins,
                      StepReport& report) {
    const double target_N =
        model.statistical->at(state.insertions - 1, tick.depth_m, state.score, state.table_row);
    return applyTrackingWall(model, state, tick, stop_begins,
                             {target_N / model.wall.stiffness_N_per_m, 0.0,
                              model.layers[state.layer].rejection_stretch_m, model.wall.stiffness_N_per_m},
                             report);
  }
};
constexpr StepTable kStatisticalSteps = stepTable<Statistical>();

void checkStatistical(const SceneSpec& spec, SpecChecker& check) {
  const StatisticalSpec& own = spec.statistical;
  check.enter("statistical.");
  check.require(!own.table.empty() && own.table.size() <= kMaxStatisticalRows, "table",
                fmt::format("{} rows given, allowed are 1 to {}", own.table.size(), kMaxStatisticalRows));
  for (std::size_t i = 0; i < own.table.size(); ++i) {
    const StatisticalSpec::Row& row = own.table[i];
    check.enter(fmt::format("statistical.table[{}].", i));
    check.number("depth_m", row.depth_m, kDepth);
    check.number("mean_n", row.mean_N, kForce);
    check.number("sd_n", row.sd_N, kForce);
    check.require(row.sd_N <= kMostSdShare * row.mean_N, "sd_n",
                  numberText(row.sd_N) + " is above " + numberText(kMostSdShare * row.mean_N) +
                      ", 10 times mean_n of this row");
    check.require(i == 0 || row.depth_m > own.table[i - 1].depth_m, "depth_m",
                  numberText(row.depth_m) + " is not above that of the row before");
  }
  check.enter("statistical.");
  check.number("correlation_length_m", own.correlation_length_m, kLength);
  check.number("factors.mean", own.mean_factor, kFactor);
  check.number("factors.thickness", own.thickness_factor, kFactor);
}

DepthTable tableOf(const StatisticalSpec& spec) {
  DepthTable table;
  for (const StatisticalSpec::Row& row : spec.table)
    table.add(row.depth_m * spec.thickness_factor, row.mean_N * spec.mean_factor,
              row.sd_N * spec.mean_factor);
  table.finish();
  return table;
}

}  // namespace

StatisticalTarget::StatisticalTarget(const StatisticalSpec& spec)
    : table_(tableOf(spec)), process_(spec.correlation_length_m), seed_(spec.seed) {}

double StatisticalTarget::at(std::uint64_t insertion, double depth_m, ScorePath& path,
                             std::uint32_t& row) const noexcept {
  const auto [mean_N, sd_N] = table_.at(depth_m, row);
  const double score = process_.at(scoreKey(seed_, insertion), depth_m, path);
  if (!(mean_N > 0.0)) return 0.0;
  const double share = sd_N / mean_N;
  const double spread = 1.0 + share * share;
  return mean_N / std::sqrt(spread) * detExp(std::sqrt(detLog(spread)) * score);
}

constinit const AxialEntry kStatisticalEntry = {
    &kStatisticalSteps, checkStatistical,
    [](const SceneSpec& spec) {
      const bool any = std::any_of(spec.statistical.table.begin(), spec.statistical.table.end(),
                                   [](const StatisticalSpec::Row& row) { return row.mean_N > 0; });
      return any ? bitOf(Effect::kCutting) : EffectMask{0};
    },
    [](const SceneSpec& spec, SceneModel& model) {
      model.axial_stiffness_N_per_m = spec.tracking_wall.stiffness_N_per_m;
      model.statistical = std::make_shared<const StatisticalTarget>(spec.statistical);
      model.cut_reach = [](const SceneModel& scene, SimState& state, double depth_m) noexcept {
        return scene.statistical->at(state.insertions - 1, depth_m, state.score, state.table_row) /
               scene.wall.stiffness_N_per_m;
      };
    }};

}  // namespace needlelab
