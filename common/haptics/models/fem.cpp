/// FEM: the reaction of linear elastic tissue to a needle that sticks to it, slips and cuts it
/// (FORCE_MODEL.md, "Axial models"), with the mesh's compliance instead of the mesh (fem_needle.h). Rendered
/// directly, without a wall. On the way in, the needle tents the tissue until the cutting force is reached;
/// on the way out, the shaft's friction pulls. Nothing relaxes in a stop, because the tissue is elastic.
/// `cutting_N` is the tip's force, `friction_N` the shaft's.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/models/layer_forces.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

struct Fem {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr EffectMask kReplaces = bitOf(Effect::kShaftFriction);
  static constexpr bool kHasWall = false;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    assert(model.fem != nullptr);
    if (state.ticks_inside == 1) state.needle = NeedleState{};
    // `wall_m` is the start of the path: turns and ruptures move it, and with it the needle's whole state
    const NeedleForce force =
        stepNeedle(*model.fem, {tick.x_cut_m - state.wall_m, tick.insertion_m, state.slant}, state.needle);
    if (force.releases) report.flags |= kFlagLayerChange;
    report.cutting_N = force.cutting_N;
    report.friction_N = force.friction_N;
    return force.cutting_N + force.friction_N;
  }
};
constexpr StepTable kFemSteps = stepTable<Fem>();

constexpr std::array<AxialField, 1> kFemFields = {
    {{"nodes", "", {100, 200'000}, [](SceneSpec& spec, std::size_t) -> SpecNumber {
        return &spec.fem.nodes;
      }}}};
constexpr std::array<AxialField, 4> kFemRow = {
    {{"young_pa",
      "",
      {100, 1e9},
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.fem.layers[i].young_Pa; }},
     {"poisson",
      "",
      {0, 0.49},
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.fem.layers[i].poisson; }},
     {"friction_n_per_m", "", kFrictionPerLength,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.fem.layers[i].friction_N_per_m; }},
     {"cutting_n", "", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.fem.layers[i].cutting_N; }}}};

void checkFem(const SceneSpec& spec, SpecChecker& check) {
  check.enter("fem.");
  check.require(spec.fem.layers.size() == spec.layers.size(), "layers",
                fmt::format("{} given, the scene has {} layers: give one for each, from the skin inward",
                            spec.fem.layers.size(), spec.layers.size()));
}

// E from the lateral stiffness per length k' of a rigid needle, k' = 8πG (1 − ν)/((3 − 4ν) ln(R/r)), the
// leading term of a rigid disc moved in plane strain (Baguelin, Frank and Said 1977) with R/r = 100; soft
// tissue where k' is 0. Cutting and friction as for FIRST_ORDER.
void deriveFem(const SceneSpec&, SceneSpec& other) {
  constexpr double kPoisson = 0.45, kSoft_Pa = 10e3;
  // 2(1 + ν)(3 − 4ν) ln 100/(8π(1 − ν))
  constexpr double kYoungPerLateral = 1.16;
  if (other.fem.layers.empty()) {
    other.fem.nodes = kDefaultFemNodes;
    for (const LayerSpec& layer : other.layers) {
      FemLayerSpec own;
      own.poisson = kPoisson;
      const double young_Pa = kYoungPerLateral * layer.lateral_stiffness_N_per_m2;
      own.young_Pa = young_Pa > 0 ? std::clamp(young_Pa, 100.0, 1e9) : kSoft_Pa;
      own.friction_N_per_m = listedFriction_N_per_m(other, layer);
      own.cutting_N = listedCutting_N(other, layer);
      other.fem.layers.push_back(own);
    }
  }
  other.effects |= bitOf(Effect::kCutting);
}

EffectMask effectsOfFem(const SceneSpec& spec) {
  for (const FemLayerSpec& layer : spec.fem.layers)
    if (layer.cutting_N > 0 || layer.friction_N_per_m > 0) return bitOf(Effect::kCutting);
  return 0;
}

void compileFem(const SceneSpec& spec, SceneModel& model) {
  auto needle = std::make_shared<FemNeedle>(compileNeedle(spec));
  model.axial_stiffness_N_per_m = needle->stiffness_N_per_m;
  model.fem = std::move(needle);
}

}  // namespace

extern const AxialEntry kFemEntry;
constinit const AxialEntry kFemEntry = {
    .model = AxialModel::kFem,
    .label = "Finite elements",
    .short_name = "FEM",
    .steps = &kFemSteps,
    .renders = Fem::kRenders,
    .replaces = Fem::kReplaces,
    .needs_shells = "its mesh has layers at fixed depths",
    .section = {.name = "fem",
                .fields = kFemFields,
                .table = "layers",
                .row_fields = kFemRow,
                .rows = [](const SceneSpec& spec) { return spec.fem.layers.size(); },
                .resize = [](SceneSpec& spec, std::size_t rows) { spec.fem.layers.resize(rows); }},
    .check = checkFem,
    .effectsWithNumbers = effectsOfFem,
    .derive = deriveFem,
    .compile = compileFem};

}  // namespace needlelab
