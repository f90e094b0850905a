/// FEM: the reaction of linear elastic tissue to a needle that sticks to it, slips and cuts it
/// (FORCE_MODEL.md, "Axial models"), with the mesh's compliance instead of the mesh (fem_needle.h). Rendered
/// directly, without a wall. On the way in, the needle tents the tissue until the cutting force is reached;
/// on the way out, the shaft's friction pulls. Nothing relaxes in a stop, because the tissue is elastic.
/// `cutting_N` is the tip's force, `friction_N` the shaft's.
#include <fmt/core.h>

#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/axial_entry.h"
#include "common/haptics/models/fem_needle.h"

namespace needlelab {
namespace {

struct Fem {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr EffectMask kReplaces = bitOf(Effect::kShaftFriction);
  static constexpr bool kHasWall = false;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
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

void checkFem(const SceneSpec& spec, SpecChecker& check) {
  check.enter("");
  check.require((spec.effects & bitOf(Effect::kShaftFriction)) == 0, "effects",
                "lists SHAFT_FRICTION, which axial_model FEM has its own of (fem.layers): take it out");
  check.enter("fem.");
  check.number("nodes", spec.fem.nodes, {100, 200'000});
  check.require(spec.fem.layers.size() == spec.layers.size(), "layers",
                fmt::format("{} given, the scene has {} layers: give one for each, from the skin inward",
                            spec.fem.layers.size(), spec.layers.size()));
  for (std::size_t i = 0; i < spec.fem.layers.size(); ++i) {
    const FemLayerSpec& layer = spec.fem.layers[i];
    check.enter(fmt::format("fem.layers[{}].", i));
    check.number("young_pa", layer.young_Pa, {100, 1e9});
    check.number("poisson", layer.poisson, {0, 0.49});
    check.number("friction_n_per_m", layer.friction_N_per_m, kFrictionPerLength);
    check.number("cutting_n", layer.cutting_N, kForce);
  }
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

constinit const AxialEntry kFemEntry = {&kFemSteps, checkFem, effectsOfFem, compileFem, Fem::kReplaces};

}  // namespace needlelab
