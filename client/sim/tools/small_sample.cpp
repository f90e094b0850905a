#include "client/sim/tools/small_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace needlelab {

double studentTail(double t, std::size_t freedom) {
  const double angle = std::atan(std::fabs(t) / std::sqrt(static_cast<double>(freedom)));
  const double s = std::sin(angle), c2 = std::cos(angle) * std::cos(angle);
  // odd: cos + 2/3 cos³ + 2·4/(3·5) cos⁵ …; even: 1 + 1/2 cos² + 1·3/(2·4) cos⁴ …, up to cos^(freedom − 2)
  const bool odd = freedom % 2 == 1;
  double term = odd ? std::cos(angle) : 1, sum = freedom > 1 ? term : 0;
  for (std::size_t k = odd ? 3 : 2; k + 2 <= freedom; k += 2) {
    term *= c2 * static_cast<double>(k - 1) / static_cast<double>(k);
    sum += term;
  }
  const double inside = odd ? 2 / std::numbers::pi * (angle + s * sum) : s * sum;
  return std::clamp(1 - inside, 0.0, 1.0);
}

double studentQuantile(double tail, std::size_t freedom) {
  double low = 0, high = 1;
  while (studentTail(high, freedom) > tail && high < 1e12) high *= 2;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (studentTail(middle, freedom) > tail ? low : high) = middle;
  }
  return high;
}

namespace {

double meanOf(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Standard error of the mean.
double errorOfMean(std::span<const double> values, double mean) {
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  const auto n = static_cast<double>(values.size());
  return std::sqrt(squares / (n - 1) / n);
}

}  // namespace

MeanInterval meanInterval(std::span<const double> values) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  MeanInterval interval{0, -kNone, kNone, values.size()};
  if (values.empty()) return interval;
  interval.mean = meanOf(values);
  if (values.size() < 2) return interval;
  const double half = studentQuantile(0.05, values.size() - 1) * errorOfMean(values, interval.mean);
  interval.low = interval.mean - half;
  interval.high = interval.mean + half;
  return interval;
}

ShareInterval wilsonInterval(double share, std::size_t count) {
  if (count == 0) return {};
  const auto n = static_cast<double>(count);
  const double z2 = kNormal975 * kNormal975, middle = (share + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kNormal975 / (1 + z2 / n) * std::sqrt(share * (1 - share) / n + z2 / (4 * n * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

}  // namespace needlelab
