#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include "common/haptics/axial_entry.h"
#include "common/haptics/det_math.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/effects/tracking_wall.h"
#include "common/haptics/effects/trajectory.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/tick.h"

namespace needlelab {
namespace {

// a duration in ticks: max(1, floor(duration·rate + 0.5))
double ticksOf(double duration_s, double rate_hz) {
  return std::max(1.0, std::floor(duration_s * rate_hz + 0.5));
}

// CUTTING and ATTRACTED, where the layers' own forces are not all zero
EffectMask effectsOfLayers(const SceneSpec& spec) {
  EffectMask mask = 0;
  for (const LayerSpec& layer : spec.layers) {
    if (layer.cutting_force_N > 0) mask |= bitOf(Effect::kCutting);
    if (layer.attracted_force_N > 0) mask |= bitOf(Effect::kAttracted);
  }
  return mask;
}

// an effect is live when the scene lists it and its numbers are not all zero
EffectMask liveEffects(const SceneSpec& spec) {
  const AxialEntry& axial = axialEntry(spec.axial_model);
  EffectMask with_numbers = axial.effectsWithNumbers != nullptr ? axial.effectsWithNumbers(spec)
                                                                : effectsOfLayers(spec) & axial.renders;
  for (const EffectEntry* entry : effectEntries())
    if (entry->hasNumbers != nullptr && entry->hasNumbers(spec)) with_numbers |= bitOf(entry->effect);
  return spec.effects & with_numbers;
}

// d/dz (k1 z + k2 z²) where it reaches the rupture force
double slopeAtRupture(const MembraneSpec& m) {
  return std::sqrt(m.linear_N_per_m * m.linear_N_per_m + 4 * m.quadratic_N_per_m2 * m.force_N);
}

bool isClosed(const LayerSpec& layer, const SceneModel& model) {
  const auto effects = effectEntries();
  return std::any_of(effects.begin(), effects.end(), [&](const EffectEntry* entry) {
    return entry->closes != nullptr && model.isLive(entry->effect) && entry->closes(layer);
  });
}

// computes layer boundaries and stretches (FORCE_MODEL.md, "Tracking wall")
void compileLayers(const SceneSpec& spec, SceneModel& model) {
  double top = 0;
  const LayerSpec* tissue = nullptr;
  for (const LayerSpec& layer : spec.layers) {
    // in a closed layer the tissue above continues
    if (!isClosed(layer, model)) tissue = &layer;
    assert(tissue != nullptr && "the skin is not bone");
    assert(model.layer_count < kMaxLayers);
    const LayerSpec& from = *tissue;
    CompiledLayer& to = model.layers[model.layer_count++];
    const double wall_stiffness = from.wall_stiffness_N_per_m.value_or(spec.tracking_wall.stiffness_N_per_m);
    to.wall_stiffness_N_per_m = wall_stiffness;
    to.top_m = to.min_depth_m = top;
    to.cutting_force_N = model.isLive(Effect::kCutting) ? from.cutting_force_N : 0.0;
    to.cut_stretch_m = to.cutting_force_N / wall_stiffness;
    to.attracted_stretch_m = model.isLive(Effect::kAttracted) ? from.attracted_force_N / wall_stiffness : 0.0;
    to.rejection_stretch_m = from.rejection_force_N / wall_stiffness;
    to.lateral_N_per_m2 = from.lateral_stiffness_N_per_m2;
    to.friction_N_per_m = from.friction_N_per_m;
    if (layer.membrane)
      model.membranes[model.membrane_count++] = {top, layer.membrane->linear_N_per_m,
                                                 layer.membrane->quadratic_N_per_m2, layer.membrane->force_N,
                                                 slopeAtRupture(*layer.membrane)};
    top += layer.thickness_m;
    to.bottom_m = top;
    assert(to.top_m <= to.bottom_m);
  }
  for (std::size_t i = 0; i < kMaxLayers; ++i) model.membrane_ids[i] = static_cast<std::uint8_t>(i);
  model.layers[0].min_depth_m = std::numeric_limits<double>::denorm_min();
  model.layers[model.layer_count - 1].bottom_m = std::numeric_limits<double>::infinity();
  model.beyond.wall_stiffness_N_per_m = model.layers[0].wall_stiffness_N_per_m;
}

void compileTurn(SceneModel& model) {
  model.fixture_push = model.fixture.mode == ClampingMode::kConservative ? 0.5 : 0.0;
  model.lay_again_m = std::min(kLayAgain_m, 0.25 * model.needle_length_m);
  model.inverse_needle_squared_per_m2 = 1.0 / (model.needle_length_m * model.needle_length_m);
}

// the second derivatives of U = ½ k(d) e², with d = |p − P0|, for a tip that is aside by no more than the
// cone α, or than u holds it (β), and where U is not linear yet. s = e/d and c are the sine and cosine of the
// angle between p − P0 and u
FixtureSteepness steepnessOf(const SceneModel& model) {
  if (!model.isLive(Effect::kClamping)) return {};
  FixtureSteepness steepest{model.fixture.max_stiffness_N_per_m, 0.0};
  if (model.fixture_push == 0.0) return steepest;
  LayersAlong layers;
  layStraight(model, layers);
  constexpr double kScan_m = 1e-4;
  for (double d_m = kScan_m; d_m < model.needle_length_m; d_m += kScan_m) {
    const auto [k, slope] = lateralStiffness(layers, d_m);
    if (!(k > 0.0)) continue;
    const double cone = (model.needle_length_m - d_m) / (model.needle_length_m + d_m);
    const double tangent = std::max(cone, turnTangent(model, d_m));
    const double e_m = std::min(model.fixture.max_force_N / k, d_m * tangent / std::hypot(1.0, tangent));
    const double s = e_m / d_m, c = std::sqrt(1.0 - s * s);
    const double bent = layers.stiffness_here.half_bend_N_per_m3 * e_m * e_m;  // ½ k″e²
    const double round = 0.5 * slope * e_m * s;                                // ½ k′e²/d
    const double along = bent * c * c + round * s * s;
    const double outward = k + 2.0 * slope * e_m * s + bent * s * s + round * c * c;
    const double mixed = slope * e_m * c + (bent - round) * c * s;
    const double about_u = k + round;
    steepest.along_N_per_m = std::max(steepest.along_N_per_m, along);
    steepest.across_N_per_m =
        std::max({steepest.across_N_per_m, about_u,
                  0.5 * (along + outward) + std::hypot(0.5 * (outward - along), mixed)});
  }
  return steepest;
}

// prepares the live effects and lists their stages; the cap follows the stages
void compileEffects(const SceneSpec& spec, SceneModel& model) {
  model.stage_numbers = spec.stage_numbers;
  for (const EffectEntry* entry : effectEntries()) {
    if (!model.isLive(entry->effect)) continue;
    if (entry->compile != nullptr) entry->compile(spec, model);
    if (entry->stage == nullptr) continue;
    assert(model.stage_count < kMaxStages);
    model.stages[model.stage_count++] = entry->stage;
    model.step_function = model.hold != nullptr ? stepHeld : stepWithStages;
    model.surely_below_cap_N = std::numeric_limits<double>::infinity();
  }
}

// a body without a path: no force, and no entry
void stepNowhere(const SceneModel& model, const TipSample& sample, SimState& state,
                 StepReport& report) noexcept {
  if (!isFinite(sample)) return clearReport(report, 0.0, kFlagNotStepped);
  clearReport(report, depthInLimb(model, sample.p_WT_m), 0);
  state.p_prev_W_m = sample.p_WT_m;
  state.depth_prev_m = report.depth_m;
  state.has_prev = true;
}

// what a device must hold is that of a needle through all structures, bones last
Result<SceneModel> compileBody(const SceneSpec& spec, double rate_hz) {
  SceneSpec laid = spec;
  laid.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  std::stable_partition(laid.layers.begin(), laid.layers.end(),
                        [](const LayerSpec& layer) { return !layer.is_bone; });
  auto model = compile(laid, rate_hz);
  if (!model.ok()) return model;
  model->limb = spec.limb;
  model->is_plane = model->bone_is_plane = false;
  model->hold = nullptr;
  model->step_function = stepNowhere;
  model->body_spec = std::make_shared<SceneSpec>(spec);
  return model;
}

Limb withUnitNormal(const Limb& limb) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb))
    return PlaneLimb{plane->point_m, normalized(plane->normal)};
  return limb;
}

}  // namespace

Result<SceneModel> compile(const SceneSpec& spec, double rate_hz, const FixtureSteepness* steepness) {
  if (Status valid = validate(spec); !valid.ok()) return valid.error();
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz))
    return Error{ErrorCode::kInvalidInput, fmt::format("rate: {:f} Hz is out of range [50, 40000]", rate_hz)};

  if (spec.axial_model == AxialModel::kFem && !spec.fem.compliance)
    return Error{ErrorCode::kInvalidInput,
                 "fem: the scene's axial_model is FEM and its mesh was not computed: this program does not "
                 "render FEM"};

  if (std::holds_alternative<BodyLimb>(spec.limb)) return compileBody(spec, rate_hz);

  SceneModel model;
  model.rate_hz = rate_hz;
  model.period_s = 1.0 / rate_hz;
  model.wall = spec.tracking_wall;
  model.fixture = spec.virtual_fixture;
  model.orientation = spec.orientation_limit;
  model.friction_stiffness_N_per_m = spec.friction_stiffness_N_per_m;
  model.needle_length_m = spec.needle_length_m;
  model.needle_length_squared_m2 = spec.needle_length_m * spec.needle_length_m;
  model.max_force_N = spec.max_force_N;
  model.surely_below_cap_N = spec.max_force_N * (1.0 - 1e-9);
  model.limb = withUnitNormal(spec.limb);
  if (const auto* plane = std::get_if<PlaneLimb>(&model.limb)) {
    model.is_plane = true;
    model.plane_point_m = plane->point_m;
    model.plane_normal = plane->normal;
  }
  model.live = liveEffects(spec);
  model.dwell_ticks = static_cast<std::uint64_t>(ticksOf(model.wall.stop_dwell_s, rate_hz));
  model.rest_ticks = static_cast<std::uint64_t>(ticksOf(kRest_s, rate_hz));
  model.stop_ticks = ticksOf(model.wall.stop_duration_s, rate_hz);
  model.speed_window = static_cast<std::uint64_t>(ticksOf(0.1, rate_hz));
  model.speed_window_s = static_cast<double>(model.speed_window) * model.period_s;
  model.history_mask = std::bit_ceil(model.speed_window + 1) - 1;
  model.arming_speed_mps = kArmingSpeeds * model.wall.stop_speed_mps;
  model.max_stop_step_m = 1.5 * model.wall.stop_speed_mps * model.period_s;
  model.drift_step_m = kDriftSpeed_mps * model.period_s;
  if (model.wall.stop_mode == StopMode::kExponential)
    model.relax_share = 1.0 - detExp(-model.period_s / model.wall.relax_time_s);
  model.max_turn_rad = 2.0 * model.period_s;
  model.aim_share = 1.0 - detExp(-model.period_s / kAimTime_s);
  compileTurn(model);
  compileLayers(spec, model);
  model.fixture_steepness = steepness != nullptr ? *steepness : steepnessOf(model);
  const AxialEntry& axial = axialEntry(spec.axial_model);
  model.axial_model = spec.axial_model;
  model.step_function = model.placed_step = (*axial.steps)[model.live & kPlacedEffects];
  assert(model.placed_step != nullptr && "validate() refuses effects that the model replaces");
  axial.compile(spec, model);
  compileEffects(spec, model);
  assert(model.layer_count == spec.layers.size() && model.membrane_count <= model.layer_count);
  assert(model.speed_window <= model.history_mask && model.history_mask < kHistoryCapacity);
  assert(std::has_single_bit(model.history_mask + 1));
  assert(model.relax_share >= 0.0 && model.relax_share <= 1.0);
  assert(!model.is_plane || isUnit(model.plane_normal));
  assert(!model.bone_is_plane || isUnit(model.bone_normal));
  assert(std::isfinite(model.fixture_steepness.across_N_per_m));
  assert(std::isfinite(model.fixture_steepness.along_N_per_m));
  assert(!(model.axial_stiffness_N_per_m < 0.0) && !(model.axial_damping_Ns_per_m < 0.0));
  return model;
}

FixtureSteepness fixtureSteepness(const SceneSpec& spec) {
  SceneModel model;
  model.fixture = spec.virtual_fixture;
  model.needle_length_m = spec.needle_length_m;
  model.live = liveEffects(spec);
  compileTurn(model);
  compileLayers(spec, model);
  return steepnessOf(model);
}

double AlongStiffness::atOnce() const {
  return std::max({std::max(tissue_N_per_m, membrane_N_per_m) + fixture_N_per_m, hub_N_per_m, alone_N_per_m});
}

AlongStiffness alongStiffness(const SceneModel& model) {
  const bool cuts = model.isLive(Effect::kCutting) || model.isLive(Effect::kAttracted);
  const double axial_N_per_m = cuts ? model.axial_stiffness_N_per_m : 0.0;
  AlongStiffness along{.tissue_N_per_m = axial_N_per_m};
  for (const EffectEntry* entry : effectEntries()) {
    if (entry->stiffness_N_per_m == nullptr || !model.isLive(entry->effect)) continue;
    const double own_N_per_m = entry->stiffness_N_per_m(model);
    switch (entry->acts_with) {
      case ActsWith::kTissue:
        along.tissue_N_per_m += own_N_per_m;
        break;
      case ActsWith::kHeldTissue:
        along.membrane_N_per_m += own_N_per_m;
        break;
      case ActsWith::kBoth:
        along.fixture_N_per_m += own_N_per_m;
        break;
      case ActsWith::kCutTissue:
        along.hub_N_per_m += own_N_per_m;
        break;
      case ActsWith::kNothing:
        along.alone_N_per_m = std::max(along.alone_N_per_m, own_N_per_m);
        break;
    }
  }
  if (along.membrane_N_per_m > 0 && axialEntry(model.axial_model).passes_membranes)
    along.membrane_N_per_m += axial_N_per_m;
  if (along.hub_N_per_m > 0) along.hub_N_per_m += along.tissue_N_per_m;
  return along;
}

double SceneModel::axialStiffness_N_per_m() const {
  return alongStiffness(*this).atOnce();
}

double heldEnergy_J(const SceneModel& model, const SimState& state, const StepReport& report) noexcept {
  const auto spring_J = [](double force, double stiffness) {
    return stiffness > 0 ? 0.5 * force * force / stiffness : 0.0;
  };
  const double tissue_N = report.cutting_N + report.attracted_N;
  double held_J = spring_J(tissue_N, model.axial_stiffness_N_per_m);
  for (const EffectEntry* entry : effectEntries()) {
    if (entry->stiffness_N_per_m == nullptr || entry->effect == Effect::kClamping ||
        entry->effect == Effect::kPuncture || entry->effect == Effect::kPalpation)
      continue;
    if (model.isLive(entry->effect))
      held_J += spring_J(entry->value(report), entry->stiffness_N_per_m(model));
  }
  held_J += state.palpation.held_J;
  if (state.inside) {
    const double felt_m = dot(state.u_W, state.p_prev_W_m - state.p_entry_W_m) - state.bone.held_m;
    const double membrane_m = std::max(0.0, felt_m - cuttingPosition(state, felt_m));
    held_J += std::fabs(tissue_N + report.friction_N) * (membrane_m + state.bone.held_m) +
              std::fabs(report.puncture_N) * (0.5 * membrane_m + state.bone.held_m);
  }
  // f·e − f²/(2k), also where f is at its greatest
  const double fixture_J = report.clamping_N * report.lateral_error_m -
                           spring_J(report.clamping_N, report.clamping_stiffness_N_per_m);
  const double torque_Nm = norm(report.wrench_W.torque_Nm);
  const bool is_greatest = torque_Nm > 0.999 * model.orientation.max_torque_Nm;
  return held_J + std::max(0.0, fixture_J) +
         (is_greatest ? torque_Nm * kPi / 2 : spring_J(torque_Nm, model.orientation.stiffness_Nm_per_rad));
}

}  // namespace needlelab
