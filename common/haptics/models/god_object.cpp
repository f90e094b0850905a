/// GOD_OBJECT: the proxy of surface rendering (Zilles and Salisbury 1995: a point that stays on the surface
/// while the tip goes through it), applied to the tops of layers (FORCE_MODEL.md, "Axial models"). It lies on
/// the top of the layer that the tip meets and pulls the tip back with f = −K (x − x_proxy); when K (x −
/// x_proxy) exceeds that layer's cutting force, the proxy passes this top for the rest of the insertion and
/// moves with the tip to the next top. Between tops the force is zero, and it drops to zero where the proxy
/// passes; the model exists to show that. It never pulls inward. A top's place along u is determined like a
/// membrane's (FORCE_MODEL.md, "Puncture"): the x interpolated by δ between the previous tick and this tick.
#include <algorithm>
#include <array>
#include <cassert>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/layer_forces.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

struct GodObject {
  static constexpr EffectMask kRenders = bitOf(Effect::kCutting);
  static constexpr bool kHasWall = true;

  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    meetTops(model, state, tick);
    double pressed_N = 0.0;
    for (;;) {
      // a proxy that moves with the tip stops at the next top that the tip has crossed
      if (!state.proxy_held) {
        if (state.proxy_layer + 1 >= state.tops_met) break;
        ++state.proxy_layer;
        state.proxy_held = true;
      }
      assert(state.proxy_layer < state.tops_met && "the proxy lies on a top that was met");
      const double place_m = state.top_place_m[state.proxy_layer] + state.x_shift_m;
      pressed_N = model.axial_stiffness_N_per_m * std::max(0.0, tick.x_m - place_m);
      state.wall_m = place_m;
      if (pressed_N <= model.layers[state.proxy_layer].cutting_force_N) break;
      state.proxy_held = false;
      pressed_N = 0.0;
      report.flags |= kFlagRupture;
    }
    if (!state.proxy_held) state.wall_m = tick.x_m;
    assert(!(pressed_N < 0.0));
    return report.cutting_N = -pressed_N;
  }

  // stores where the tip first crosses the top of each layer
  static void meetTops(const SceneModel& model, SimState& state, const Tick& tick) {
    if (state.tops_met >= model.layer_count || tick.depth_m < model.layers[state.tops_met].top_m) return;
    const TickBefore before = tickBefore(state);
    do {
      const double share =
          (model.layers[state.tops_met].top_m - before.depth_m) / (tick.depth_m - before.depth_m);
      assert(share >= 0.0 && share <= 1.0);
      state.top_place_m[state.tops_met++] = before.x_m + (tick.x_m - before.x_m) * share - state.x_shift_m;
    } while (state.tops_met < model.layer_count && tick.depth_m >= model.layers[state.tops_met].top_m);
  }
};
constexpr StepTable kGodObjectSteps = stepTable<GodObject>();

constexpr std::array<AxialField, 1> kGodObjectFields = {
    {{"stiffness_n_per_m", "Stiffness (God object)", kStiffness,
      [](SceneSpec& spec, std::size_t) -> SpecNumber { return &spec.god_object.stiffness_N_per_m; }}}};

}  // namespace

extern const AxialEntry kGodObjectEntry;
constinit const AxialEntry kGodObjectEntry = {
    .model = AxialModel::kGodObject,
    .label = "God object",
    .short_name = "god object",
    .steps = &kGodObjectSteps,
    .renders = GodObject::kRenders,
    .places_wall = true,
    .passes_membranes = true,
    .section = {.name = "god_object", .fields = kGodObjectFields},
    // the wall's stiffness
    .derive = [](const SceneSpec& scene, SceneSpec& other) { deriveStiffness(scene, other.god_object); },
    .compile = [](const SceneSpec& spec,
                  SceneModel& model) { model.axial_stiffness_N_per_m = spec.god_object.stiffness_N_per_m; }};

}  // namespace needlelab
