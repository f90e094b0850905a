/// What theory says of the largest stiffness that a sampled wall can have: the passivity bounds of the
/// literature, and the exact limit of the linear loop.
#pragma once

namespace needlelab {

/// Colgate and Schenkel (1997): a wall K, sampled and held, is passive when b > K T/2; with d further ticks
/// of delay b > K T (½ + d). The hand's damping counts as the device's. In N/m.
double passiveStiffnessLimit(double damping_Ns_per_m, double period_s, double delay_ticks);

/// Abbott and Okamura (2005), Diolaiti et al. (2006): with encoder step Δ and Coulomb friction f_c a wall is
/// passive, down to the smallest cycle, when K ≤ min(2b/T, 2f_c/Δ). Infinite second part where Δ is 0. In
/// N/m.
double quantisedStiffnessLimit(double damping_Ns_per_m, double period_s, double dry_friction_N,
                               double encoder_step_m);

/// The loop of a wall that stays in contact: handle and hand are a mass on a spring and a damper, the wall is
/// K + B (1 − z⁻¹)/T, sampled and held, d ticks late.
struct LinearLoop {
  double mass_kg = 0.35;
  double damping_Ns_per_m = 3.5;     ///< of device and hand
  double stiffness_N_per_m = 300;    ///< of the hand, more than 0
  double period_s = 1e-3;            ///< T
  unsigned delay_ticks = 1;          ///< d
  double wall_damping_Ns_per_m = 0;  ///< B, by a one-tick difference
};

/// The smallest K at which the linear loop swings without end, from its pulse transfer function (no small-KT
/// approximation). In N/m; infinite where there is none.
double sampledStiffnessLimit(const LinearLoop& loop);

}  // namespace needlelab
