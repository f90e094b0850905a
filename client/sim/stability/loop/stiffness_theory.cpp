#include "client/sim/stability/loop/stiffness_theory.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

namespace needlelab {

namespace {

using Complex = std::complex<double>;

// Mass, damper and spring behind a zero-order hold: sum of the residues of the step response, times 1 − z⁻¹.
class PulseTransfer {
 public:
  explicit PulseTransfer(const LinearLoop& loop) {
    const double half = loop.damping_Ns_per_m / (2 * loop.mass_kg);
    const Complex root = std::sqrt(Complex(half * half - loop.stiffness_N_per_m / loop.mass_kg));
    const Complex p1 = -half + root, p2 = -half - root;
    gain_ = 1 / loop.stiffness_N_per_m;
    a1_ = 1.0 / (loop.mass_kg * p1 * (p1 - p2));
    a2_ = 1.0 / (loop.mass_kg * p2 * (p2 - p1));
    e1_ = std::exp(p1 * loop.period_s);
    e2_ = std::exp(p2 * loop.period_s);
  }
  [[nodiscard]] Complex at(Complex z) const {
    return gain_ + (z - 1.0) * (a1_ / (z - e1_) + a2_ / (z - e2_));
  }

 private:
  double gain_;
  Complex a1_, a2_, e1_, e2_;
};

// The K that closes the loop 1 + (K + B (1 − z⁻¹)/T) G z⁻ᵈ = 0 at z = e^{jφ}; a wall can have it if it is
// real.
Complex closingStiffness(const LinearLoop& loop, const PulseTransfer& plant, double phase_rad) {
  const Complex z = std::polar(1.0, phase_rad);
  const Complex late = std::polar(1.0, phase_rad * static_cast<double>(loop.delay_ticks));
  return -late / plant.at(z) - loop.wall_damping_Ns_per_m / loop.period_s * (1.0 - 1.0 / z);
}

}  // namespace

double passiveStiffnessLimit(double damping_Ns_per_m, double period_s, double delay_ticks) {
  return damping_Ns_per_m / (period_s * (0.5 + delay_ticks));
}

double sampledStiffnessLimit(const LinearLoop& loop) {
  const PulseTransfer plant(loop);
  constexpr int kSteps = 20'000;  // on the upper half of the unit circle
  constexpr double kHalfTurn = 3.14159265358979323846;
  double best = std::numeric_limits<double>::infinity();
  double before = kHalfTurn / kSteps;
  for (int i = 2; i <= kSteps; ++i) {
    const double here = kHalfTurn * i / kSteps;
    double from = before, to = here;
    before = here;
    const bool rising = closingStiffness(loop, plant, from).imag() < 0;
    if (rising == (closingStiffness(loop, plant, to).imag() < 0)) continue;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = (from + to) / 2;
      ((closingStiffness(loop, plant, middle).imag() < 0) == rising ? from : to) = middle;
    }
    const double stiffness = closingStiffness(loop, plant, to).real();
    if (stiffness > 0) best = std::min(best, stiffness);
  }
  return best;
}

double dampingAcross(double damping_Ns_per_m, double rotational_damping_Nms_per_rad, double lever_m) {
  if (lever_m == 0) return damping_Ns_per_m;
  if (damping_Ns_per_m == 0 || rotational_damping_Nms_per_rad == 0) return 0;
  return 1 / (1 / damping_Ns_per_m + lever_m * lever_m / rotational_damping_Nms_per_rad);
}

}  // namespace needlelab
