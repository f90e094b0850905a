/// What the stiffnesses at the needle's tip are about the handle, at the end of the tool's lever, and how
/// much of them a device holds (FORCE_MODEL.md, "Device limits").
#pragma once

#include <string>

#include "common/haptics/force_gate.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The steepest that a scene can be; 0 where the effect is not live.
struct HandleStiffness {
  double fixture_N_per_m = 0;         ///< across the needle, at the tip
  double bone_N_per_m = 0;            ///< in every direction, where the needle sticks on it
  double orientation_Nm_per_rad = 0;  ///< of the orientation limit
  double handle_Nm_per_rad = 0;       ///< about the handle, about the worst axis: of all together
  /// Across the needle, at the tip: a needle that sticks on bone is held by it aside, and by the fixture.
  [[nodiscard]] double across_N_per_m() const { return fixture_N_per_m + bone_N_per_m; }
};

/// The stiffness k across the needle is k·lever² about the handle; that of wall or bone along the needle acts
/// about the handle by the part of the lever across the needle; the orientation limit adds its own.
/// `spec` is the scene and `axial_N_per_m` its stiffness along the needle (axialStiffness_N_per_m).
HandleStiffness handleStiffness(const SceneSpec& spec, double axial_N_per_m, const Pose& X_HT);

/// Below this share of a profile's stiffness a lesson is another lesson, and is refused.
inline constexpr double kLeastStiffnessShare = 0.5;

/// The share of fixture, bone and orientation limit, in [0, 1], with which a device of `limits` holds the
/// scene: fixture and bone at the tip, all of it about the handle. 1: nothing is to be lowered. 0: the walls
/// alone are too stiff for a tool so far off its axis. The stiffness along the needle is not judged here.
double heldStiffnessShare(const SceneSpec& spec, double axial_N_per_m, const DeviceLimits& limits,
                          const Pose& X_HT);

/// Lowers the fixture with all its numbers, and the stiffnesses of bone and orientation limit, to `share` of
/// (0, 1].
void lowerStiffness(SceneSpec& spec, double share);

/// For a person, beside a score; empty where `share` is 1 and bone was not left out.
std::string stiffnessShareText(double share, bool bone_left_out);

}  // namespace needlelab
