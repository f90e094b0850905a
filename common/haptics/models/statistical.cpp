#include "common/haptics/models/statistical.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "common/haptics/axial_entry.h"
#include "common/haptics/det_math.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxStatisticalRows = 256;
constexpr NumberRange kFactor{0, 10, true};
// above this share of the mean a log-normal force is meaningless; consequently sd is 0 where the mean is 0
constexpr double kMaxSdShare = 10;

struct Statistical {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr bool kHasWall = true;
  static constexpr bool kRelaxes = true;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool stop_begins,
                      StepReport& report) {
    assert(model.statistical != nullptr);
    const double target_N =
        model.statistical->at(state.insertions - 1, tick.depth_m, state.score, state.table_row);
    return applyTrackingWall(model, state, tick, stop_begins,
                             {target_N / model.wall.stiffness_N_per_m, 0.0,
                              model.layers[state.layer].rejection_stretch_m, model.wall.stiffness_N_per_m},
                             report);
  }
};
constexpr StepTable kStatisticalSteps = stepTable<Statistical>();

constexpr std::array<AxialField, 4> kStatisticalFields = {
    {{"correlation_length_m", "", kLength,
      [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.statistical.correlation_length_m; }},
     {"seed", "", {}, [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.statistical.seed; }},
     {"factors.mean", "", kFactor,
      [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.statistical.mean_factor; }},
     {"factors.thickness", "", kFactor,
      [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.statistical.thickness_factor; }}}};
constexpr std::array<AxialField, 3> kStatisticalRow = {
    {{"depth_m", "", kDepth,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.statistical.table[i].depth_m; }},
     {"mean_n", "", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.statistical.table[i].mean_N; }},
     {"sd_n", "", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.statistical.table[i].sd_N; }}}};
constexpr std::array<std::string_view, 4> kMayBeSynthetic = {"mean_n", "sd_n", "correlation_length_m",
                                                             "factors"};

void checkStatistical(const SceneSpec& spec, SpecChecker& check) {
  const auto& table = spec.statistical.table;
  for (std::size_t i = 0; i < table.size(); ++i) {
    check.enter(fmt::format("statistical.table[{}].", i));
    check.require(table[i].sd_N <= kMaxSdShare * table[i].mean_N, "sd_n",
                  numberText(table[i].sd_N) + " is above " + numberText(kMaxSdShare * table[i].mean_N) +
                      ", 10 times mean_n of this row");
    check.require(i == 0 || table[i].depth_m > table[i - 1].depth_m, "depth_m",
                  numberText(table[i].depth_m) + " is not above that of the row before");
  }
}

// mean as the cutting force of PRECOMPUTED; the spread is synthetic, not measured
void deriveStatistical(const SceneSpec& scene, SceneSpec& other) {
  constexpr double kSdShare = 0.1;
  if (!other.statistical.table.empty()) return;
  for (const PrecomputedSpec::Row& row : forceTableOfLayers(scene))
    other.statistical.table.push_back({row.depth_m, row.cutting_N, kSdShare * row.cutting_N});
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

extern const AxialEntry kStatisticalEntry;
constinit const AxialEntry kStatisticalEntry = {
    .model = AxialModel::kStatistical,
    .label = "Statistical",
    .short_name = "statistical",
    .steps = &kStatisticalSteps,
    .renders = Statistical::kRenders,
    .has_tracking_wall = true,
    .needs_shells = "its factors are over the depth below the skin",
    .section = {.name = "statistical",
                .fields = kStatisticalFields,
                .table = "table",
                .row_fields = kStatisticalRow,
                .max_rows = kMaxStatisticalRows,
                .rows = [](const SceneSpec& spec) { return spec.statistical.table.size(); },
                .resize = [](SceneSpec& spec, std::size_t rows) { spec.statistical.table.resize(rows); },
                .may_be_synthetic = kMayBeSynthetic},
    .check = checkStatistical,
    .effectsWithNumbers =
        [](const SceneSpec& spec) {
          const bool any = std::any_of(spec.statistical.table.begin(), spec.statistical.table.end(),
                                       [](const StatisticalSpec::Row& row) { return row.mean_N > 0; });
          return any ? bitOf(Effect::kCutting) : EffectMask{0};
        },
    .derive = deriveStatistical,
    .compile =
        [](const SceneSpec& spec, SceneModel& model) {
          model.axial_stiffness_N_per_m = spec.tracking_wall.stiffness_N_per_m;
          model.statistical = std::make_shared<const StatisticalTarget>(spec.statistical);
          model.cut_reach = [](const SceneModel& scene, SimState& state, double depth_m) noexcept {
            return scene.statistical->at(state.insertions - 1, depth_m, state.score, state.table_row) /
                   scene.wall.stiffness_N_per_m;
          };
        }};

}  // namespace needlelab
