#include "haptics/det_math.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace needlelab {
namespace {

// atan(k/8): the argument is brought within 1/16 of one of them, where the series is short
constexpr double kAtanEighths[9] = {0.0,
                                    0.12435499454676144,
                                    0.24497866312686414,
                                    0.35877067027057225,
                                    0.4636476090008061,
                                    0.5585993153435624,
                                    0.6435011087932844,
                                    0.7188299996216245,
                                    0.7853981633974483};

// atan(num/den) for 0 ≤ num ≤ den, den > 0
double atanOfRatio(double num, double den) noexcept {
  const int k = static_cast<int>(num / den * 8.0 + 0.5);
  const double c = k * 0.125;
  const double t = (num - c * den) / (den + c * num);
  const double s = t * t;
  // alternating series; the first term left out, t^15/15, is below 6e-20
  const double tail =
      s * (-1.0 / 3 + s * (1.0 / 5 + s * (-1.0 / 7 + s * (1.0 / 9 + s * (-1.0 / 11 + s * (1.0 / 13))))));
  return kAtanEighths[k] + (t + t * tail);
}

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
  // 1 + r (1 + r/2 (1 + r/3 (…))), from the inside, so that the last addition's rounding is nearly the only
  // one
  double sum = 1.0;
  for (int k = 14; k >= 1; --k) sum = 1.0 + sum * (r / k);
  return std::ldexp(sum, static_cast<int>(n));
}

}  // namespace needlelab
