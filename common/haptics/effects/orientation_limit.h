/// Orientation limit: the freedom to tilt shrinks as the needle goes in (paper eq. 7; FORCE_MODEL.md,
/// "Orientation limit").
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "common/haptics/tick.h"

namespace needlelab {

/// Returns θ_l as a number; while the needle stays in the cone, θ_l is stored as "α at this depth", which
/// avoids trigonometry.
inline double tiltLimit(const SceneModel& model, const SimState& state) {
  return state.tilt_limit_is_cone ? orientationLimitAngle(model.needle_length_m, state.tilt_limit_insertion_m)
                                  : state.tilt_limit_rad;
}

/// Raises θ_l by as much as a turn of u0 raised θ.
void followTurn(const SceneModel& model, SimState& state, Vec3 axis_W, Vec3 u0_before_W) noexcept;

/// The needle's axis for the quick test of the cone; its length is 1 up to the quaternion's error.
struct RawAxis {
  Vec3 axis_W;
  double squared = 0;  ///< |axis|²
};

struct Nothing {};

/// The exact test of the cone, with the axis of length 1. When the needle is outside the cone: computes the
/// torque about the tip in W, and θ_l ← max(α, min(θ_l, θ)). A separate function, because it is rare and
/// needs angles.
void tiltNearCone(const SceneModel& model, SimState& state, double insertion_m, double axis_x, double axis_y,
                  double axis_z, StepReport& report) noexcept;

/// Writes the torque about the tip, in W, into the report.
[[gnu::always_inline]] inline void applyOrientationLimit(const SceneModel& model, SimState& state,
                                                         const RawAxis& raw, double insertion_m,
                                                         StepReport& report) {
  const double length = model.needle_length_m;
  const double insertion = std::min(insertion_m, length);  // d_t is never negative
  // tan θ ≤ (L − d)/(L + d) is cos θ > 0 and 2 cos² θ (L² + d²) ≥ (L + d)². Cheap, but imprecise where θ is
  // small: unless the needle is inside by a margin far above rounding, the exact test decides
  constexpr double kTwo = 2.0 * (1.0 - 1e-12);
  const double along = dot(raw.axis_W, state.u0_W);
  const double sum = length + insertion;
  const double squares = model.needle_length_squared_m2 + insertion * insertion;
  if (along * std::fabs(along) * squares * kTwo >= raw.squared * (sum * sum)) [[likely]] {
    state.tilt_limit_is_cone = true;
    state.tilt_limit_insertion_m = insertion;
    report.wrench_W.torque_Nm = {};
    return;
  }
  tiltNearCone(model, state, insertion, raw.axis_W.x, raw.axis_W.y, raw.axis_W.z, report);
}

/// The effect's place in a tick.
template <bool kLive>
struct OrientationLimitStep {
  [[no_unique_address]] std::conditional_t<kLive, RawAxis, Nothing> raw;

  /// Finite only if the sample's whole orientation is finite.
  [[gnu::always_inline]] double readPose(const TipSample& sample) {
    if constexpr (kLive) {
      raw.axis_W = zAxis(sample.q_WT);
      return raw.squared = normSquared(raw.axis_W);
    } else {
      return dot(sample.q_WT, sample.q_WT);
    }
  }
  [[gnu::always_inline]] void apply(const SceneModel& model, SimState& state, double insertion_m,
                                    StepReport& report) const {
    if constexpr (kLive)
      applyOrientationLimit(model, state, raw, insertion_m, report);
    else
      report.wrench_W.torque_Nm = {};
  }
};

}  // namespace needlelab
