/// Theoretical limits of a sampled wall: passive, stable with a hand, and the exact limit of the linear loop.
#pragma once

namespace needlelab {

/// Colgate and Schenkel (1997): a wall K, sampled and held, is passive if b > K T/2; with d additional ticks
/// of delay, b > K T (½ + d). With the device's damping alone: passive, so stable with any hand. Including
/// the hand's: stable with that hand (coupled stability). In N/m.
double passiveStiffnessLimit(double damping_Ns_per_m, double period_s, double delay_ticks);

/// The loop of a wall in permanent contact: handle and hand are a mass on a spring and a damper; the wall is
/// K + B (1 − z⁻¹)/T, sampled and held, d ticks late.
struct LinearLoop {
  double mass_kg = 0.35;
  double damping_Ns_per_m = 3.5;     ///< of device and hand
  double stiffness_N_per_m = 300;    ///< of the hand, more than 0
  double period_s = 1e-3;            ///< T
  unsigned delay_ticks = 1;          ///< d
  double wall_damping_Ns_per_m = 0;  ///< B, from a one-tick difference
};

/// The smallest K at which the linear loop oscillates forever, from its pulse transfer function (no small-KT
/// approximation). In N/m; infinite if there is none.
double sampledStiffnessLimit(const LinearLoop& loop);

/// Damping of a tip motion across the needle: handle and lever yield in series, 1/b_tip = 1/b +
/// lever²/b_turn. In N·s/m; 0 if either is 0.
double dampingAcross(double damping_Ns_per_m, double rotational_damping_Nms_per_rad, double lever_m);

}  // namespace needlelab
