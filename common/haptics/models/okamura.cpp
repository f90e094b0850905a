/// OKAMURA: the needle's force as the sum of three parts (Okamura, Simone and O'Leary, "Force modeling for
/// needle insertion into soft tissue", 2004): a stiffness a1 z + a2 z² up to puncture, then constant cutting,
/// and modified Karnopp friction along the shaft. DAHL: the same stiffness and cutting, and the shaft's
/// friction after Kim and Lee ("An empirical model of friction force between a needle and soft tissue",
/// 2016): Dahl's element, with limits for each direction and a viscous term. FORCE_MODEL.md, "Axial models",
/// has the rules.
///
/// Like shaft friction, both frictions are a spring K_f from the needle to a place w_f in the tissue: a
/// device measures places, and the spring supplies the force that Karnopp's law needs at rest. For any
/// limits, every move of w_f shortens the spring, so the element can only take energy. Speeds are means over
/// 100 ms; therefore the viscous part raises the limit instead of being a separate force, which would keep
/// pushing the hand for 50 ms after it reversed.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <memory>
#include <string>

#include "common/haptics/axial_entry.h"
#include "common/haptics/det_math.h"
#include "common/haptics/effects/step_live.h"
#include "common/haptics/models/layer_forces.h"
#include "common/haptics/models/layer_tops.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {

/// Friction of each layer, per inserted length.
struct ShaftLimits {
  struct Layer {
    ShaftFrictionSpec in, out;
  };
  std::array<Layer, kMaxLayers> layers;
};

namespace {

/// The limits of a tick in one direction, in N and N·s/m.
struct SideLimit {
  double kinetic_N = 0, static_N = 0, viscous_Ns_per_m = 0;
};

void add(SideLimit& limit, const ShaftFrictionSpec& side, double length_m) {
  assert(length_m > 0.0);
  limit.kinetic_N += side.kinetic_N_per_m * length_m;
  limit.static_N += side.static_N_per_m * length_m;
  limit.viscous_Ns_per_m += side.viscous_Ns_per_m2 * length_m;
}

/// The reach of the spring in a direction: at rest up to static friction, in motion kinetic plus viscous. The
/// excess of static friction when motion begins fades over the distance on which the spring gives it back, so
/// that the force does not step.
struct Karnopp {
  static void drag(const SceneModel& model, SimState& state, const Tick& tick, double slid_m,
                   const SideLimit& in, const SideLimit& out) {
    const double speed_mps = std::fabs(tick.speed_mps), rest_mps = model.wall.stop_speed_mps;
    state.slid_m = speed_mps < rest_mps ? 0.0 : state.slid_m + std::fabs(slid_m);
    const double stiffness = model.friction_stiffness_N_per_m;
    const auto reach = [&](const SideLimit& side) {
      const double above_N =
          side.static_N - side.kinetic_N - side.viscous_Ns_per_m * std::min(speed_mps, rest_mps);
      return (side.kinetic_N + side.viscous_Ns_per_m * speed_mps +
              std::max(0.0, above_N - stiffness * state.slid_m)) /
             stiffness;
    };
    state.friction_wall_m =
        std::min(std::max(state.friction_wall_m, tick.x_cut_m - reach(in)), tick.x_cut_m + reach(out));
  }
};

/// Integrates dz/dx = 1 − sign(dx)·z/reach for the spring's length z exactly, for any distance in a tick.
/// While z shortens, the reach is that of its own side.
struct Dahl {
  static void drag(const SceneModel& model, SimState& state, const Tick& tick, double slid_m,
                   const SideLimit& in, const SideLimit& out) {
    const double speed_mps = std::fabs(tick.speed_mps), stiffness = model.friction_stiffness_N_per_m;
    const double reach_in_m = (in.kinetic_N + in.viscous_Ns_per_m * speed_mps) / stiffness;
    const double reach_out_m = (out.kinetic_N + out.viscous_Ns_per_m * speed_mps) / stiffness;
    double z_m = tick.x_cut_m - slid_m - state.friction_wall_m;
    if (slid_m > 0) z_m = stretched(z_m, slid_m, reach_in_m, reach_out_m);
    if (slid_m < 0) z_m = -stretched(-z_m, -slid_m, reach_out_m, reach_in_m);
    state.friction_wall_m = tick.x_cut_m - std::min(std::max(z_m, -reach_out_m), reach_in_m);
  }

  /// z after a distance > 0 towards positive z.
  static double stretched(double z_m, double way_m, double ahead_m, double behind_m) {
    assert(way_m > 0.0 && !(ahead_m < 0.0) && !(behind_m < 0.0));
    if (z_m < 0) {
      const double left_m = wayToZero(z_m, behind_m);
      if (way_m <= left_m) return behind_m - (behind_m - z_m) * detExp(-way_m / behind_m);
      z_m = 0;
      way_m -= left_m;
    }
    return ahead_m > 0 ? ahead_m - (ahead_m - z_m) * detExp(-way_m / ahead_m) : 0.0;
  }
  static double wayToZero(double z_m, double behind_m) {
    return behind_m > 0 ? behind_m * detLog(1 - z_m / behind_m) : 0.0;
  }
};

template <class Friction>
struct ThreeForces : LayerTops {
  static double apply(const SceneModel& model, SimState& state, const Tick& tick, bool /*stop_begins*/,
                      StepReport& report) {
    assert(model.shaft_limits != nullptr);
    const TickBefore before = tickBefore(state);
    const double x_cut_before_m = cuttingPosition(state, before.x_m), wall_before_m = state.wall_m;
    Tick own = tick;
    const double held_N = applyMembranes(model, state, own, before.x_m, before.depth_m, report);
    // a rupture moves walls and x_c together, so nothing slides
    const double slid_m = own.x_cut_m - (state.wall_m - wall_before_m) - x_cut_before_m;
    const double cutting_N = cutBeyondTops(model, state, own, report);

    const double length_m = lengthBeyondTops(own);
    SideLimit in, out;
    for (std::uint32_t i = 0; i < state.along.count; ++i) {
      const LayerSpan& span = state.along.spans[i];
      const double part_m = std::min(span.end_m, length_m) - std::max(span.begin_m, 0.0);
      if (!(part_m > 0.0) || span.layer < 0) break;
      assert(span.layer < static_cast<std::int64_t>(model.layer_count));
      const ShaftLimits::Layer& layer = model.shaft_limits->layers[static_cast<std::size_t>(span.layer)];
      add(in, layer.in, part_m);
      add(out, layer.out, part_m);
    }
    Friction::drag(model, state, own, slid_m, in, out);
    report.friction_N = -model.friction_stiffness_N_per_m * (own.x_cut_m - state.friction_wall_m);
    return cutting_N + report.friction_N + held_N;
  }
};
constexpr StepTable kOkamuraSteps = stepTable<ThreeForces<Karnopp>>();
constexpr StepTable kDahlSteps = stepTable<ThreeForces<Dahl>>();

constexpr NumberRange kViscous{0, 1e5};

constexpr std::array<AxialField, 10> kOkamuraFields = {
    {{"linear_n_per_m",
      "Stiffness (Okamura)",
      {0, 10'000},
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.layers[i].okamura->linear_N_per_m; }},
     {"quadratic_n_per_m2",
      "Stiffening (Okamura)",
      {0, 1e9},
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].okamura->quadratic_N_per_m2;
      }},
     {"puncture_force_n", "Puncture force (Okamura)", kPositiveForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.layers[i].okamura->puncture_force_N; }},
     {"cutting_force_n", "Cutting force (Okamura)", kForce,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.layers[i].okamura->cutting_force_N; }},
     {"kinetic_in_n_per_m", "Kinetic friction in", kFrictionPerLength,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].okamura->in.kinetic_N_per_m;
      }},
     {"kinetic_out_n_per_m", "Kinetic friction out", kFrictionPerLength,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].okamura->out.kinetic_N_per_m;
      }},
     {"static_in_n_per_m", "Static friction in", kFrictionPerLength,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber { return &spec.layers[i].okamura->in.static_N_per_m; },
      "kinetic_in_n_per_m"},
     {"static_out_n_per_m", "Static friction out", kFrictionPerLength,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].okamura->out.static_N_per_m;
      },
      "kinetic_out_n_per_m"},
     {"viscous_in_ns_per_m2", "Viscous friction in", kViscous,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].okamura->in.viscous_Ns_per_m2;
      }},
     {"viscous_out_ns_per_m2", "Viscous friction out", kViscous,
      [](SceneSpec& spec, std::size_t i) -> SpecNumber {
        return &spec.layers[i].okamura->out.viscous_Ns_per_m2;
      }}}};

void checkSide(const ShaftFrictionSpec& side, const std::string& name, SpecChecker& check) {
  check.require(side.static_N_per_m >= side.kinetic_N_per_m, "okamura.static_" + name + "_n_per_m",
                numberText(side.static_N_per_m) + " is below " + numberText(side.kinetic_N_per_m) +
                    ", kinetic_" + name + "_n_per_m: static friction is at least as strong as kinetic");
}

void checkThreeForces(const SceneSpec& spec, SpecChecker& check) {
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    check.enter(fmt::format("layers[{}].", i));
    const auto& own = spec.layers[i].okamura;
    if (!own) return;
    check.require(own->linear_N_per_m > 0 || own->quadratic_N_per_m2 > 0, "okamura",
                  "linear_n_per_m and quadratic_n_per_m2 are both 0: this top would never be punctured");
    checkSide(own->in, "in", check);
    checkSide(own->out, "out", check);
  }
}

// Ratios to kinetic friction: assumptions, quoted from memory as those of bovine liver (Okamura, Simone and
// O'Leary 2004: 18.57 and 11.96 N/m, 293 N·s/m² on the way in; 18.45, 10.57, 212 out), without access to the
// paper.
constexpr double kStaticIn = 1.55, kStaticOut = 1.75, kViscousIn_s_per_m = 24.5, kViscousOut_s_per_m = 20.1;

// Cutting, puncture force and kinetic friction as FIRST_ORDER; linear and quadratic stiffness of the
// membrane, or K_t and 0; static and viscous friction as the assumed multiples of kinetic. For a scene that
// lists neither SHAFT_FRICTION nor PUNCTURE, both models give the forces of FIRST_ORDER.
void deriveThreeForces(const SceneSpec&, SceneSpec& other) {
  deriveTops(other, [&](LayerSpec& layer, double cutting_N, double puncture_N) {
    if (layer.okamura) return;
    const double friction_N_per_m = listedFriction_N_per_m(other, layer);
    OkamuraSpec& own = layer.okamura.emplace();
    own.cutting_force_N = cutting_N;
    own.in = {friction_N_per_m, std::min(1e4, kStaticIn * friction_N_per_m),
              std::min(1e5, kViscousIn_s_per_m * friction_N_per_m)};
    own.out = {friction_N_per_m, std::min(1e4, kStaticOut * friction_N_per_m),
               std::min(1e5, kViscousOut_s_per_m * friction_N_per_m)};
    if (const MembraneSpec* const membrane = listedMembrane(other, layer)) {
      own.puncture_force_N = membrane->force_N;
      own.linear_N_per_m = std::min(1e4, membrane->linear_N_per_m);
      own.quadratic_N_per_m2 = membrane->quadratic_N_per_m2;
    } else {
      own.puncture_force_N = puncture_N;
      own.linear_N_per_m = wallStiffness_N_per_m(other, layer);
    }
  });
}

std::string assumedRatios(const SceneSpec& scene, bool uses_static) {
  bool derived = false, rubs = false;
  for (const LayerSpec& layer : scene.layers) {
    derived = derived || !layer.okamura;
    rubs = rubs || (!layer.okamura && listedFriction_N_per_m(scene, layer) > 0);
  }
  if (!derived) return {};
  if (!rubs)
    return "The scene has no friction: what tells this model's from FIRST_ORDER's is not in this row";
  std::string ratios = fmt::format("viscous friction of {:g} (in) and {:g} s/m (out) times kinetic",
                                   kViscousIn_s_per_m, kViscousOut_s_per_m);
  if (uses_static)
    ratios =
        fmt::format("static friction of {:g} (in) and {:g} (out) times kinetic, ", kStaticIn, kStaticOut) +
        ratios;
  return "Assumptions, remembered of bovine liver (Okamura, Simone and O'Leary 2004) and not compared with "
         "the paper: " +
         ratios;
}

/// `steepest_friction`: the steepest slope of friction over x, as a multiple of K_f.
void compileThreeForces(const SceneSpec& spec, SceneModel& model, double steepest_friction) {
  auto limits = std::make_shared<ShaftLimits>();
  double steepest_N_per_m = 0;
  bool rubs = false;
  for (std::uint32_t i = 0; i < model.layer_count; ++i) {
    const OkamuraSpec& own = *spec.layers[i].okamura;
    CompiledLayer& layer = model.layers[i];
    layer.cut_stretch_m = own.cutting_force_N / spec.tracking_wall.stiffness_N_per_m;
    limits->layers[i] = {own.in, own.out};
    // d/dz (a1 z + a2 z²) where it reaches the puncture force
    const double slope_N_per_m = std::sqrt(own.linear_N_per_m * own.linear_N_per_m +
                                           4 * own.quadratic_N_per_m2 * own.puncture_force_N);
    model.membranes[i] = {layer.top_m, own.linear_N_per_m, own.quadratic_N_per_m2, own.puncture_force_N,
                          slope_N_per_m};
    steepest_N_per_m = std::max(steepest_N_per_m, slope_N_per_m);
    for (const ShaftFrictionSpec* side : {&own.in, &own.out})
      rubs = rubs || side->static_N_per_m > 0 || side->viscous_Ns_per_m2 > 0;
  }
  model.membrane_count = model.layer_count;
  model.shaft_limits = std::move(limits);
  model.axial_stiffness_N_per_m = stiffnessWithTops(
      spec, steepest_N_per_m, rubs ? steepest_friction * spec.friction_stiffness_N_per_m : 0.0);
}

EffectMask alwaysCutting(const SceneSpec&) {
  return bitOf(Effect::kCutting);
}

constexpr AxialSection kOkamuraSection = {
    .name = "okamura",
    .fields = kOkamuraFields,
    .isIn = [](const LayerSpec& layer) { return layer.okamura.has_value(); },
    .addTo = [](LayerSpec& layer) { layer.okamura.emplace(); }};

MembraneSpec topOf(const LayerSpec& layer) {
  return {layer.okamura->linear_N_per_m, layer.okamura->quadratic_N_per_m2, layer.okamura->puncture_force_N};
}

}  // namespace

extern const AxialEntry kOkamuraEntry, kDahlEntry;
constinit const AxialEntry kOkamuraEntry = {
    .model = AxialModel::kOkamura,
    .label = "Okamura (Karnopp friction)",
    .short_name = "Okamura",
    .steps = &kOkamuraSteps,
    .renders = LayerTops::kRenders,
    .replaces = LayerTops::kReplaces,
    .feels_speed = true,
    .section = kOkamuraSection,
    .check = checkThreeForces,
    .effectsWithNumbers = alwaysCutting,
    .topOf = topOf,
    .derive = deriveThreeForces,
    .assumption = [](const SceneSpec& scene) { return assumedRatios(scene, true); },
    .compile = [](const SceneSpec& spec, SceneModel& model) { compileThreeForces(spec, model, 1); }};

constinit const AxialEntry kDahlEntry = {
    .model = AxialModel::kDahl,
    .label = "Dahl (Kim and Lee)",
    .short_name = "Dahl",
    .steps = &kDahlSteps,
    .renders = LayerTops::kRenders,
    .replaces = LayerTops::kReplaces,
    .feels_speed = true,
    .section = kOkamuraSection,
    .check = checkThreeForces,
    .effectsWithNumbers = alwaysCutting,
    .topOf = topOf,
    .derive = deriveThreeForces,
    .assumption = [](const SceneSpec& scene) { return assumedRatios(scene, false); },
    // when reversed at its limit, Dahl's spring yields twice as fast as K_f
    .compile = [](const SceneSpec& spec, SceneModel& model) { compileThreeForces(spec, model, 2); }};

}  // namespace needlelab
