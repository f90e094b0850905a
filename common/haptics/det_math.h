/// Elementary functions of our own, from + − × ÷ and sqrt alone: the C library's differ between processors,
/// and a replay must give the same bits on every machine (FACTS, "What a tick can cost"). Accurate to about 2
/// units in the last place.
#pragma once

namespace needlelab {

inline constexpr double kPi = 3.14159265358979323846;

/// Angle of (x, y) in (−π, π]; 0 for (0, 0).
double detAtan2(double y, double x) noexcept;
inline double detAtan(double x) noexcept {
  return detAtan2(x, 1.0);
}
/// `x` is held to [−1, 1].
double detAsin(double x) noexcept;
/// For |x| up to 1e5.
double detSin(double x) noexcept;
double detCos(double x) noexcept;
/// Natural logarithm of a positive normal number; −infinity for 0.
double detLog(double x) noexcept;
/// e^x; 0 below −745, infinity above 709.8.
double detExp(double x) noexcept;

}  // namespace needlelab
