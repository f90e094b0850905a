/// Soft tissue under a ball as a spring that stiffens as the ball comes near bone (FORCE_MODEL.md,
/// "Palpation"). Its energy W depends on the stretch s and on the cover T: how far the ball may go from where
/// it rests on the skin until it meets bone. With x = min(1, s/T) the stiffness is K + A·x⁴, so that
///   s ≤ T:  W = K·s²/2 + A·s⁶/(30·T⁴)
///   s > T:  W = K·s²/2 + A·(T²/30 + T·(s − T)/5 + (s − T)²/2)
/// W, ∂W/∂s and ∂W/∂T are continuous; ∂W/∂T ≤ 0, and the force ∂W/∂s changes with T by at most 4/5·A.
#pragma once

#include <cmath>

namespace needlelab {

struct SoftTissue {
  double soft_N_per_m = 0;   ///< K: far from bone
  double added_N_per_m = 0;  ///< A: what is added where the ball meets bone

  /// Of a stretch and a cover, both in m, at least 0; the cover may be infinite.
  struct At {
    double energy_J = 0;
    double force_N = 0;       ///< ∂W/∂s
    double per_cover_N = 0;   ///< ∂W/∂T
    double bend_N_per_m = 0;  ///< ∂²W/∂T²
  };
  [[nodiscard]] At at(double stretch_m, double cover_m) const noexcept {
    const double s = stretch_m, T = cover_m;
    At now{0.5 * soft_N_per_m * s * s, soft_N_per_m * s};
    if (!(s > 0.0) || !(added_N_per_m > 0.0)) return now;
    if (s <= T) {
      const double x = s / T, x4 = x * x * x * x;
      now.energy_J += added_N_per_m * s * s * x4 / 30;
      now.force_N += added_N_per_m * s * x4 / 5;
      now.per_cover_N = -added_N_per_m * s * x4 * x * (2.0 / 15);
      now.bend_N_per_m = added_N_per_m * x4 * x * x * (2.0 / 3);
    } else {
      const double beyond = s - T;
      now.energy_J += added_N_per_m * (T * T / 30 + T * beyond / 5 + beyond * beyond / 2);
      now.force_N += added_N_per_m * (s - 0.8 * T);
      now.per_cover_N = added_N_per_m * (2.0 / 3 * T - 0.8 * s);
      now.bend_N_per_m = added_N_per_m * (2.0 / 3);
    }
    return now;
  }
};

}  // namespace needlelab
