/// The syringe mock on the device's handle: tip pose from handle pose, and the wrench transferred to the
/// handle (FORCE_MODEL.md, "Device limits").
#pragma once

#include "common/haptics/geometry.h"

namespace needlelab {

/// Tip pose X_WT from the handle's pose X_WH and the tool X_HT (the tip in the handle's frame).
constexpr Pose tipFromHandle(const Pose& X_WH, const Pose& X_HT) {
  return X_WH * X_HT;
}

/// The same wrench about the handle: τ_handle = τ + (p_tip − p_handle) × f. All in W.
constexpr Wrench wrenchAtHandle(const Wrench& at_tip, Vec3 p_WT_m, Vec3 p_WH_m) {
  return {at_tip.force_N, at_tip.torque_Nm + cross(p_WT_m - p_WH_m, at_tip.force_N)};
}

}  // namespace needlelab
