/// FIRST_ORDER: the needle's force as the sum of stiffness before puncture, then cutting and friction, after
/// Okamura, Simone and O'Leary 2004, but with linear instead of quadratic stiffness, and Karnopp friction
/// without its static and viscous parts (okamura.cpp has the full model; FORCE_MODEL.md, "Axial models").
/// Each layer has a surface at its top that holds with k (x − s) up to its puncture force. While a surface
/// holds, there is no cutting or friction beyond it (x_c of FORCE_MODEL.md, "Puncture"). Cutting is constant
/// in a layer, and friction is ∫ friction ds over the length beyond the surfaces; both use dragged walls (K_t
/// and K_f): cutting on the way in only, friction in both directions. The model has no relaxation in a stop.
/// It has its own puncture and friction: a scene that lists PUNCTURE or SHAFT_FRICTION is refused.
#include <algorithm>
#include <array>
#include <cmath>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/layer_forces.h"
#include "common/haptics/models/layer_tops.h"
#include "common/haptics/spec_checker.h"

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

constexpr std::array<AxialField, 4> kFirstOrderFields = {
    {{"stiffness_n_per_m", "Stiffness (first order)", kStiffness,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].first_order->stiffness_N_per_m;
      }},
     {"puncture_force_n", "Puncture force (first order)", kPositiveForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].first_order->puncture_force_N;
      }},
     {"cutting_force_n", "Cutting force (first order)", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].first_order->cutting_force_N;
      }},
     {"friction_n_per_m", "Friction (first order)", kFrictionPerLength,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].first_order->friction_N_per_m;
      }}}};

// a membrane's force over the depth at which it ruptures
double secantStiffness(const MembraneSpec& m) {
  return (m.linear_N_per_m +
          std::sqrt(m.linear_N_per_m * m.linear_N_per_m + 4 * m.quadratic_N_per_m2 * m.force_N)) /
         2;
}

// Cutting and friction of the layer; puncture force and secant stiffness of its membrane. Without one, the
// puncture force is the rise of the cutting force, with stiffness K_t.
void deriveFirstOrder(const SceneSpec&, SceneSpec& other) {
  deriveTops(other, [&](LayerSpec& layer, double cutting_N, double puncture_N) {
    if (layer.first_order) return;
    FirstOrderSpec& own = layer.first_order.emplace();
    own.cutting_force_N = cutting_N;
    own.friction_N_per_m = listedFriction_N_per_m(other, layer);
    if (const MembraneSpec* const membrane = listedMembrane(other, layer)) {
      own.puncture_force_N = membrane->force_N;
      own.stiffness_N_per_m = std::clamp(secantStiffness(*membrane), 1e-6, 1e4);
    } else {
      own.puncture_force_N = puncture_N;
      own.stiffness_N_per_m = wallStiffness_N_per_m(other, layer);
    }
  });
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

extern const AxialEntry kFirstOrderEntry;
constinit const AxialEntry kFirstOrderEntry = {
    .model = AxialModel::kFirstOrder,
    .label = "First order",
    .short_name = "first order",
    .steps = &kFirstOrderSteps,
    .renders = FirstOrder::kRenders,
    .replaces = FirstOrder::kReplaces,
    .section = {.name = "first_order",
                .fields = kFirstOrderFields,
                .isIn = [](const LayerSpec& layer) { return layer.first_order.has_value(); },
                .addTo = [](LayerSpec& layer) { layer.first_order.emplace(); }},
    .effectsWithNumbers = [](const SceneSpec&) { return bitOf(Effect::kCutting); },
    .topOf =
        [](const LayerSpec& layer) {
          return MembraneSpec{layer.first_order->stiffness_N_per_m, 0, layer.first_order->puncture_force_N};
        },
    .derive = deriveFirstOrder,
    .compile = compileFirstOrder};

}  // namespace needlelab
