#include "common/haptics/gate/handle_stiffness.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

double steepestOrientation_Nm_per_rad(const SceneSpec& spec) {
  const OrientationLimitSpec& limit = spec.orientation_limit;
  const bool is_live = (spec.effects & bitOf(Effect::kOrientationLimit)) != 0 && limit.max_torque_Nm > 0;
  return is_live ? limit.stiffness_Nm_per_rad : 0;
}

double steepestBone_N_per_m(const SceneSpec& spec) {
  const bool has_bone = std::any_of(spec.layers.begin(), spec.layers.end(),
                                    [](const LayerSpec& layer) { return layer.is_bone; });
  if (!has_bone || (spec.effects & bitOf(Effect::kBone)) == 0) return 0;
  return spec.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m];
}

// the lever's components along and across the needle, squared
struct Lever {
  double along_m2 = 0, across_m2 = 0;
};
Lever leverOf(const Pose& X_HT) {
  const double along_m = dot(X_HT.p, zAxis(normalized(X_HT.q)));
  const double along_m2 = along_m * along_m;
  return {along_m2, std::max(0.0, normSquared(X_HT.p) - along_m2)};
}

}  // namespace

// A turn θ of the handle moves the tip by θ × l. About the axis perpendicular to lever and needle, the
// movement's component along the needle is l_across and across it l_along; about the axis perpendicular to
// the lever in their common plane, all of it is across. These are the principal axes.
HandleStiffness handleStiffness(const SceneSpec& spec, double axial_N_per_m, const Pose& X_HT) {
  HandleStiffness of{fixtureSteepness(spec).across_N_per_m, steepestBone_N_per_m(spec),
                     steepestOrientation_Nm_per_rad(spec), 0};
  const Lever lever = leverOf(X_HT);
  const double across = of.across_N_per_m();
  of.handle_Nm_per_rad =
      of.orientation_Nm_per_rad + std::max(across * (lever.along_m2 + lever.across_m2),
                                           across * lever.along_m2 + axial_N_per_m * lever.across_m2);
  return of;
}

double heldStiffnessShare(const SceneSpec& spec, double axial_N_per_m, const DeviceLimits& limits,
                          const Pose& X_HT) {
  const HandleStiffness wanted = handleStiffness(spec, axial_N_per_m, X_HT);
  const Lever lever = leverOf(X_HT);
  const auto shareWithin = [](double stiffness, double most) {
    if (stiffness <= most) return 1.0;
    return std::max(0.0, most) / stiffness;
  };
  const double most = limits.max_rotational_stiffness_Nm_per_rad;
  const double turn = wanted.orientation_Nm_per_rad + wanted.across_N_per_m() * lever.along_m2;
  const double walls_Nm_per_rad = axial_N_per_m * lever.across_m2;
  // the walls alone may exceed the limit, even without fixture, bone and orientation limit
  if (walls_Nm_per_rad > most) return 0;
  return std::min({shareWithin(wanted.across_N_per_m(), limits.max_stiffness_N_per_m),
                   shareWithin(turn + wanted.across_N_per_m() * lever.across_m2, most),
                   shareWithin(turn, most - walls_Nm_per_rad)});
}

void lowerStiffness(SceneSpec& spec, double share) {
  if (share >= 1) return;
  for (LayerSpec& layer : spec.layers) layer.lateral_stiffness_N_per_m2 *= share;
  spec.virtual_fixture.max_stiffness_N_per_m *= share;
  spec.virtual_fixture.max_force_N *= share;
  spec.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] *= share;
  spec.orientation_limit.stiffness_Nm_per_rad *= share;
}

std::string stiffnessShareText(double share, bool bone_left_out) {
  std::string text =
      bone_left_out ? "Bone was left out: the needle cut it as it cuts a layer of tissue. " : "";
  if (share < 1)
    text += fmt::format(
        "{} were rendered at {:.0f} % of the profile's stiffness. ",
        bone_left_out ? "Fixture and orientation limit" : "Fixture, bone and orientation limit", 100 * share);
  return text.empty() ? text : text + "This device and tool cannot hold more.";
}

}  // namespace needlelab
