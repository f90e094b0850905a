/// Our own elementary functions, computed with + − × ÷ and sqrt only: the C library's functions differ
/// between processors, and a replay must give the same bits on every machine. Accurate to about 2 units in
/// the last place.
#pragma once

#include <cmath>

namespace needlelab {

inline constexpr double kPi = 3.14159265358979323846;

// atan(k/8): the argument is reduced to within 1/16 of one of these points, where the series is short
inline constexpr double kAtanEighths[9] = {0.0,
                                           0.12435499454676144,
                                           0.24497866312686414,
                                           0.35877067027057225,
                                           0.4636476090008061,
                                           0.5585993153435624,
                                           0.6435011087932844,
                                           0.7188299996216245,
                                           0.7853981633974483};

// num8/den rounded to an integer, for 0 ≤ num8 ≤ 8·den. Uses comparisons, which the processor predicts well
// while an angle changes slowly; a division would stall the code after it
[[gnu::always_inline]] inline int nearestEighth(double num8, double den) noexcept {
  if (num8 < 3.5 * den) {
    if (num8 < 1.5 * den) return num8 < 0.5 * den ? 0 : 1;
    return num8 < 2.5 * den ? 2 : 3;
  }
  if (num8 < 5.5 * den) return num8 < 4.5 * den ? 4 : 5;
  if (num8 < 6.5 * den) return 6;
  return num8 < 7.5 * den ? 7 : 8;
}

// atan(num/den) for 0 ≤ num ≤ den, den > 0
[[gnu::always_inline]] inline double atanOfRatio(double num, double den) noexcept {
  const int k = nearestEighth(8.0 * num, den);
  const double c = k * 0.125;
  const double t = (num - c * den) / (den + c * num);
  const double s = t * t;
  // alternating series; the first omitted term, t^15/15, is below 6e-20
  const double tail =
      s * (-1.0 / 3 + s * (1.0 / 5 + s * (-1.0 / 7 + s * (1.0 / 9 + s * (-1.0 / 11 + s * (1.0 / 13))))));
  return kAtanEighths[k] + (t + t * tail);
}

/// Inline detAtan2, for ticks with torque, where a call costs too much.
[[gnu::always_inline]] inline double detAtan2Inline(double y, double x) noexcept {
  const double ay = std::fabs(y), ax = std::fabs(x);
  double angle;
  if (ay <= ax) {
    if (ax == 0.0) return 0.0;
    angle = atanOfRatio(ay, ax);
  } else {
    angle = kPi / 2 - atanOfRatio(ax, ay);
  }
  if (x < 0.0) angle = kPi - angle;
  return y < 0.0 ? -angle : angle;
}

/// Angle of (x, y) in (−π, π]; 0 for (0, 0).
double detAtan2(double y, double x) noexcept;
inline double detAtan(double x) noexcept {
  return detAtan2(x, 1.0);
}
/// `x` is clamped to [−1, 1].
double detAsin(double x) noexcept;
/// Valid for |x| up to 1e5.
double detSin(double x) noexcept;
double detCos(double x) noexcept;
/// Natural logarithm of a positive normal number; −infinity for 0.
double detLog(double x) noexcept;
/// e^x; 0 below −745, infinity above 709.8.
double detExp(double x) noexcept;

}  // namespace needlelab
