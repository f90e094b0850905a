#include "common/haptics/det_math.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>

namespace needlelab {
namespace {

// sine and cosine for |r| ≤ π/4 by their series
double sinNear(double r) noexcept {
  const double s = r * r;
  const double tail =
      s * (-1.0 / 6 +
           s * (1.0 / 120 +
                s * (-1.0 / 5040 +
                     s * (1.0 / 362880 +
                          s * (-1.0 / 39916800 + s * (1.0 / 6227020800.0 + s * (-1.0 / 1307674368000.0)))))));
  return r + r * tail;
}
double cosNear(double r) noexcept {
  const double s = r * r;
  const double tail =
      s * s *
      (1.0 / 24 +
       s * (-1.0 / 720 +
            s * (1.0 / 40320 +
                 s * (-1.0 / 3628800 +
                      s * (1.0 / 479001600.0 + s * (-1.0 / 87178291200.0 + s * (1.0 / 20922789888000.0)))))));
  return (1.0 - 0.5 * s) + tail;
}

// x = quadrant·π/2 + r with |r| ≤ π/4; π/2 in three parts, the first two with trailing zeros so that the
// products are exact
double reduceQuarter(double x, int& quadrant) noexcept {
  const double n = std::floor(x * (2.0 / kPi) + 0.5);
  quadrant = static_cast<int>(static_cast<std::int64_t>(n) & 3);
  constexpr double kHigh = 1.57079632673412561417e+00, kMiddle = 6.07710050630396597660e-11,
                   kLow = 2.02226624879595063154e-21;
  return ((x - n * kHigh) - n * kMiddle) - n * kLow;
}

}  // namespace

double detAtan2(double y, double x) noexcept {
  return detAtan2Inline(y, x);
}

double detAsin(double x) noexcept {
  const double held = std::clamp(x, -1.0, 1.0);
  return detAtan2(held, std::sqrt((1.0 - held) * (1.0 + held)));
}

double detSin(double x) noexcept {
  int quadrant;
  const double r = reduceQuarter(x, quadrant);
  const double magnitude = (quadrant & 1) != 0 ? cosNear(r) : sinNear(r);
  return (quadrant & 2) != 0 ? -magnitude : magnitude;
}

double detCos(double x) noexcept {
  int quadrant;
  const double r = reduceQuarter(x, quadrant);
  const double magnitude = (quadrant & 1) != 0 ? sinNear(r) : cosNear(r);
  return quadrant == 1 || quadrant == 2 ? -magnitude : magnitude;
}

double detLog(double x) noexcept {
  assert(!(x < 0.0));
  if (x == 0.0) return -std::numeric_limits<double>::infinity();
  // x = m·2^e with m in [√½, √2): ln m = 2 atanh((m − 1)/(m + 1)) by its series, whose argument is below
  // 0.172
  int e = 0;
  double m = std::frexp(x, &e);
  if (m < 0.70710678118654752440) {
    m *= 2.0;
    --e;
  }
  const double s = (m - 1.0) / (m + 1.0), q = s * s;
  double sum = 1.0 / 23;
  for (int k = 21; k >= 3; k -= 2) sum = 1.0 / k + q * sum;
  // ln 2 in two parts, as in detExp
  constexpr double kLn2High = 6.93147180369123816490e-01, kLn2Low = 1.90821492927058770002e-10;
  return e * kLn2High + (e * kLn2Low + (2.0 * s + 2.0 * s * (q * sum)));
}

double detExp(double x) noexcept {
  if (std::isnan(x)) return x;
  if (x > 709.8) return std::numeric_limits<double>::infinity();
  if (x < -745.0) return 0.0;
  // x = n·ln 2 + r; ln 2 in two parts, the first with trailing zeros
  constexpr double kLn2High = 6.93147180369123816490e-01, kLn2Low = 1.90821492927058770002e-10;
  const double n = std::floor(x * 1.4426950408889634074 + 0.5);
  const double r = (x - n * kLn2High) - n * kLn2Low;
  // 1 + r (1 + r/2 (1 + r/3 (…))), from the inside out, so that only the last addition's rounding matters
  double sum = 1.0;
  for (int k = 14; k >= 1; --k) sum = 1.0 + sum * (r / k);
  return std::ldexp(sum, static_cast<int>(n));
}

}  // namespace needlelab
