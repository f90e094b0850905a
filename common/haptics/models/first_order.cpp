/// FIRST_ORDER: the needle's force as the sum of stiffness before puncture, then cutting and friction, after
/// Okamura, Simone and O'Leary 2004, but with linear instead of quadratic stiffness, and Karnopp friction
/// without its static and viscous parts (okamura.cpp has the full model; FORCE_MODEL.md, "Axial models").
/// Each layer has a surface at its top that holds with k (x − s) up to its puncture force. While a surface
/// holds, there is no cutting or friction beyond it (x_c of FORCE_MODEL.md, "Puncture"). Cutting is constant
/// in a layer, and friction is ∫ friction ds over the length beyond the surfaces; both use dragged walls (K_t
/// and K_f): cutting on the way in only, friction in both directions. The model has no relaxation in a stop.
/// It has its own puncture and friction: a scene that lists PUNCTURE or SHAFT_FRICTION is refused.
#include <fmt/core.h>

#include <algorithm>

#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/axial_entry.h"
#include "common/haptics/models/layer_tops.h"

namespace needlelab {
namespace {

struct FirstOrder : LayerTops {
  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    // stiffness and puncture: a membrane on every top
    const TickBefore before = tickBefore(state);
    Tick own = tick;
    const double held_N = applyMembranes(model, state, own, before.x_m, before.depth_m, report);

    const double cutting_N = cutBeyondTops(model, state, own, report);

    // friction on the length beyond the surfaces
    own.insertion_m = lengthBeyondTops(own);
    return cutting_N + applyShaftFriction(model, state, own, report) + held_N;
  }
};
constexpr StepTable kFirstOrderSteps = stepTable<FirstOrder>();

void checkFirstOrder(const SceneSpec& spec, SpecChecker& check) {
  refuseReplacedEffects(spec, FirstOrder::kReplaces, "layers[].first_order", check);
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    check.enter(fmt::format("layers[{}].", i));
    const auto& own = spec.layers[i].first_order;
    check.require(own.has_value(), "first_order", "is missing, and axial_model is FIRST_ORDER");
    if (!own) return;
    check.number("first_order.stiffness_n_per_m", own->stiffness_N_per_m, kStiffness);
    check.number("first_order.puncture_force_n", own->puncture_force_N, kPositiveForce);
    check.number("first_order.cutting_force_n", own->cutting_force_N, kForce);
    check.number("first_order.friction_n_per_m", own->friction_N_per_m, kFrictionPerLength);
  }
}

void compileFirstOrder(const SceneSpec& spec, SceneModel& model) {
  double steepest_N_per_m = 0;
  bool rubs = false;
  for (std::uint32_t i = 0; i < model.layer_count; ++i) {
    const FirstOrderSpec& own = *spec.layers[i].first_order;
    CompiledLayer& layer = model.layers[i];
    layer.cut_stretch_m = own.cutting_force_N / spec.tracking_wall.stiffness_N_per_m;
    layer.friction_N_per_m = own.friction_N_per_m;
    model.membranes[i] = {layer.top_m, own.stiffness_N_per_m, 0.0, own.puncture_force_N,
                          own.stiffness_N_per_m};
    steepest_N_per_m = std::max(steepest_N_per_m, own.stiffness_N_per_m);
    rubs = rubs || own.friction_N_per_m > 0;
  }
  model.membrane_count = model.layer_count;
  model.axial_stiffness_N_per_m =
      stiffnessWithTops(spec, steepest_N_per_m, rubs ? spec.friction_stiffness_N_per_m : 0.0);
}

}  // namespace

constinit const AxialEntry kFirstOrderEntry = {&kFirstOrderSteps, checkFirstOrder,
                                               [](const SceneSpec&) { return bitOf(Effect::kCutting); },
                                               compileFirstOrder, FirstOrder::kReplaces};

}  // namespace needlelab
