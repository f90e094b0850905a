/// Converts the stiffnesses at the needle's tip to the handle, at the end of the tool's lever, and computes
/// how much of a scene's stiffness a device can hold with it, and behind its delay (FORCE_MODEL.md, "Device
/// limits").
#pragma once

#include <string>

#include "common/haptics/gate/force_gate.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The maximum stiffnesses of a scene's effects (EffectEntry::on_device).
struct HandleStiffness {
  double across_N_per_m = 0;      ///< across the needle, at the tip: both bone and fixture hold a needle that
                                  ///< sticks on bone
  double turning_Nm_per_rad = 0;  ///< of the torques
  double handle_Nm_per_rad = 0;   ///< of all together, about the handle's worst axis
};

/// A stiffness k across the needle becomes k·lever² about the handle; wall or bone along the needle act with
/// the lever's component across the needle; torques add their own.
/// `spec` is the scene and `axial_N_per_m` its stiffness along the needle (axialStiffness_N_per_m).
HandleStiffness handleStiffness(const SceneSpec& spec, double axial_N_per_m, const Pose& X_HT);

/// With less than this share of a profile's stiffness, a lesson would not be the same, and is refused.
inline constexpr double kMinStiffnessShare = 0.5;

/// The share of these effects (fixture, bone, orientation limit), in [0, 1], with which a device of `limits`
/// can hold the scene: what is across the needle at the tip, everything about the handle. 1: nothing needs
/// lowering. 0: the walls alone are too stiff for a tool so far off its axis. Does not check the stiffness
/// along the needle.
double heldStiffnessShare(const SceneSpec& spec, double axial_N_per_m, const DeviceLimits& limits,
                          const Pose& X_HT);

/// The damping of the lightest grip: what a hand adds to the device's own.
inline constexpr double kLightestGrip_Ns_per_m = 0.9;

/// The greatest stiffness along the needle that is stable in this grip or a firmer one: (b + 0.9 N·s/m)/(T (½
/// + D)), coupled stability (FORCE_MODEL.md, "Stiffnesses"). `damping_Ns_per_m`: b, of the device.
/// `delay_ticks`: D, from a reading to its force, a lag included.
double stableInLightestGrip_N_per_m(double damping_Ns_per_m, double rate_hz, double delay_ticks);

/// What of a scene's stiffness is rendered, each in (0, 1].
struct StiffnessShares {
  double lever = 1;  ///< of what acts across the needle or turns it (heldStiffnessShare)
  double delay =
      1;  ///< of what acts at once along the needle: its cutting, friction's and rupture forces stay
};

/// Lowers each effect to the lesser of the shares that it has.
void lowerStiffness(SceneSpec& spec, const StiffnessShares& shares);

/// A text for people, shown beside a score; empty if both shares are 1 and no effect was left out.
std::string stiffnessShareText(const StiffnessShares& shares, EffectMask left_out);

}  // namespace needlelab
