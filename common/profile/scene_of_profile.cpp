#include "common/base/range.h"
#include "common/profile/model_sections.h"
#include "common/profile/needle.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

Vec3 vectorOf(const pb::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

// the messages' effects are the engine's, one further along: 0 is kept for "unspecified"
constexpr Effect effectOf(pb::Profile::Effect effect) {
  return static_cast<Effect>(effect - 1);
}
static_assert(effectOf(pb::Profile::CUTTING) == Effect::kCutting);
static_assert(effectOf(pb::Profile::ATTRACTED) == Effect::kAttracted);
static_assert(effectOf(pb::Profile::CLAMPING) == Effect::kClamping);
static_assert(effectOf(pb::Profile::ORIENTATION_LIMIT) == Effect::kOrientationLimit);
static_assert(effectOf(pb::Profile::SHAFT_FRICTION) == Effect::kShaftFriction);
static_assert(effectOf(pb::Profile::PUNCTURE) == Effect::kPuncture);

Result<Limb> limbOf(const pb::Limb& limb) {
  switch (limb.shape_case()) {
    case pb::Limb::kPlane:
      return Limb(PlaneLimb{vectorOf(limb.plane().point_m()), vectorOf(limb.plane().normal())});
    case pb::Limb::kSphere:
      return Limb(SphereLimb{vectorOf(limb.sphere().center_m()), limb.sphere().radius_m()});
    case pb::Limb::kCapsule:
      return Limb(CapsuleLimb{vectorOf(limb.capsule().a_m()), vectorOf(limb.capsule().b_m()),
                              limb.capsule().radius_m()});
    case pb::Limb::SHAPE_NOT_SET:
      break;
  }
  return Error{ErrorCode::kInvalidInput, "limb: give exactly one of plane, sphere, capsule; found none"};
}

LayerSpec layerOf(const pb::Layer& layer) {
  LayerSpec spec;
  spec.thickness_m = layer.thickness_m();
  spec.cutting_force_N = layer.cutting_force_n();
  spec.attracted_force_N = layer.attracted_force_n();
  spec.rejection_force_N = layer.rejection_force_n();
  spec.lateral_stiffness_N_per_m2 = layer.lateral_stiffness_n_per_m2();
  spec.friction_N_per_m = layer.friction_n_per_m();
  if (layer.has_puncture()) {
    spec.membrane = MembraneSpec{layer.puncture().linear_n_per_m(), layer.puncture().quadratic_n_per_m2(),
                                 layer.puncture().force_n()};
  }
  return spec;
}

TrackingWallSpec wallOf(const pb::TrackingWall& wall) {
  TrackingWallSpec spec;
  spec.stiffness_N_per_m = wall.stiffness_n_per_m();
  spec.stop_speed_mps = wall.stop_speed_m_s();
  spec.stop_dwell_s = wall.stop_dwell_s();
  spec.stop_duration_s = wall.stop_duration_s();
  spec.stop_mode = static_cast<StopMode>(wall.stop_mode());
  if (wall.has_relax_time_s()) spec.relax_time_s = wall.relax_time_s();
  if (wall.has_relax_residual()) spec.relax_residual = wall.relax_residual();
  return spec;
}
static_assert(static_cast<StopMode>(pb::TrackingWall::RAMP) == StopMode::kRamp);
static_assert(static_cast<StopMode>(pb::TrackingWall::EXPONENTIAL) == StopMode::kExponential);

VirtualFixtureSpec fixtureOf(const pb::VirtualFixture& fixture) {
  return {fixture.max_stiffness_n_per_m(), fixture.max_force_n(), static_cast<ClampingMode>(fixture.mode())};
}
static_assert(static_cast<ClampingMode>(pb::VirtualFixture::PROPORTIONAL) == ClampingMode::kProportional);
static_assert(static_cast<ClampingMode>(pb::VirtualFixture::PASSIVE) == ClampingMode::kPassive);

/// A placement is a unit quaternion within the tolerance of files (DESIGN §5), and finite.
Result<Pose> checkedPlacement(const Pose& X_WL) {
  const double length = std::sqrt(dot(X_WL.q, X_WL.q));
  if (!isFinite(X_WL.p)) return Error{ErrorCode::kInvalidInput, "placement: its position is not finite"};
  if (!(std::abs(length - 1) <= 1e-3)) {
    return Error{ErrorCode::kInvalidInput, "placement: its quaternion has length " + numberText(length) +
                                               ", it must be 1 within 0.001"};
  }
  return Pose{X_WL.p, normalized(X_WL.q)};
}

}  // namespace

Result<SceneSpec> sceneSpecOf(const pb::Profile& profile, const Pose& X_WL) {
  const Result<Pose> placement = checkedPlacement(X_WL);
  if (!placement) return placement.error();
  const Result<Limb> limb = limbOf(profile.limb());
  if (!limb) return limb.error();

  SceneSpec spec;
  spec.needle_length_m = profile.needle().length_m();
  spec.needle_diameter_m = needleOf(profile.needle()).outer_diameter_m;
  spec.limb = placed(*limb, *placement);
  for (const pb::Layer& layer : profile.layers()) spec.layers.push_back(layerOf(layer));
  if (Status status = readModel(profile, spec); !status) return status.error();
  spec.tracking_wall = wallOf(profile.tracking_wall());
  if (profile.has_virtual_fixture()) spec.virtual_fixture = fixtureOf(profile.virtual_fixture());
  if (profile.has_orientation_limit()) {
    spec.orientation_limit = {profile.orientation_limit().stiffness_nm_per_rad(),
                              profile.orientation_limit().max_torque_nm()};
  }
  if (profile.has_shaft_friction())
    spec.friction_stiffness_N_per_m = profile.shaft_friction().stiffness_n_per_m();
  if (profile.has_max_force_n()) spec.max_force_N = profile.max_force_n();
  for (const int effect : profile.effects()) {
    if (effect < pb::Profile::CUTTING || effect > pb::Profile::PUNCTURE) {
      return Error{ErrorCode::kInvalidInput, "effects: " + std::to_string(effect) + " is no known effect"};
    }
    spec.effects |= bitOf(effectOf(static_cast<pb::Profile::Effect>(effect)));
  }
  if (const Status status = validate(spec); !status) return status.error();
  return spec;
}

}  // namespace needlelab
