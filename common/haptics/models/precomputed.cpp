/// PRECOMPUTED: a table of force over depth, made in advance (by FEM, by a fit, by hand), for both
/// directions, linear between its rows, rendered by the enhanced tracking wall: Δ_cut = cutting(δ)/K_t, Δ_att
/// = attracted(δ)/K_t (FORCE_MODEL.md, "Axial models"; the paper names precomputed tables as future work). A
/// stop leaves the layer's rejection force, as with the wall.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/models/depth_table.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxTableRows = 1024;

struct Precomputed {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  static constexpr bool kHasWall = true;
  static constexpr bool kRelaxes = true;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool stop_begins,
                      StepReport& report) {
    assert(model.depth_table != nullptr);
    const auto [cut_m, attracted_m] = model.depth_table->at(tick.depth_m, state.table_row);
    return applyTrackingWall(
        model, state, tick, stop_begins,
        {cut_m, attracted_m, model.layers[state.layer].rejection_stretch_m, model.wall.stiffness_N_per_m},
        report);
  }
};
constexpr StepTable kPrecomputedSteps = stepTable<Precomputed>();

constexpr std::array<AxialField, 3> kPrecomputedRow = {
    {{"depth_m", "", kDepth,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.precomputed.table[i].depth_m; }},
     {"cutting_n", "", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.precomputed.table[i].cutting_N; }},
     {"attracted_n", "", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.precomputed.table[i].attracted_N; }}}};

void checkPrecomputed(const SceneSpec& spec, SpecChecker& check) {
  const auto& table = spec.precomputed.table;
  for (std::size_t i = 1; i < table.size(); ++i) {
    check.enter(fmt::format("precomputed.table[{}].", i));
    check.require(table[i].depth_m > table[i - 1].depth_m, "depth_m",
                  numberText(table[i].depth_m) + " is not above that of the row before");
  }
}

EffectMask effectsWithNumbers(const SceneSpec& spec) {
  EffectMask mask = 0;
  for (const PrecomputedSpec::Row& row : spec.precomputed.table) {
    if (row.cutting_N > 0) mask |= bitOf(Effect::kCutting);
    if (row.attracted_N > 0) mask |= bitOf(Effect::kAttracted);
  }
  return mask;
}

void compileTable(const SceneSpec& spec, SceneModel& model) {
  const double stiffness = spec.tracking_wall.stiffness_N_per_m;
  model.axial_stiffness_N_per_m = stiffness;
  auto table = std::make_shared<DepthTable>();
  for (const PrecomputedSpec::Row& row : spec.precomputed.table)
    table->add(row.depth_m, model.isLive(Effect::kCutting) ? row.cutting_N / stiffness : 0.0,
               model.isLive(Effect::kAttracted) ? row.attracted_N / stiffness : 0.0);
  table->finish();
  model.depth_table = std::move(table);
  model.cut_reach = [](const SceneModel& scene, SimState& state, double depth_m) noexcept {
    return scene.depth_table->at(depth_m, state.table_row).a;
  };
}

}  // namespace

extern const AxialEntry kPrecomputedEntry;
constinit const AxialEntry kPrecomputedEntry = {
    .model = AxialModel::kPrecomputed,
    .label = "Precomputed",
    .short_name = "table",
    .steps = &kPrecomputedSteps,
    .renders = Precomputed::kRenders,
    .has_tracking_wall = true,
    .needs_shells = "its table is over the depth below the skin",
    .section = {.name = "precomputed",
                .table = "table",
                .row_fields = kPrecomputedRow,
                .max_rows = kMaxTableRows,
                .rows = [](const SceneSpec& spec) { return spec.precomputed.table.size(); },
                .resize = [](SceneSpec& spec, std::size_t rows) { spec.precomputed.table.resize(rows); },
                .made_by = "needlelab-sim precompute --profile P.json --mesh N --out Q.json"},
    .check = checkPrecomputed,
    .effectsWithNumbers = effectsWithNumbers,
    .derive =
        [](const SceneSpec& scene, SceneSpec& other) {
          if (other.precomputed.table.empty()) other.precomputed.table = forceTableOfLayers(scene);
        },
    .compile = compileTable};

}  // namespace needlelab
