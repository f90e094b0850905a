#include "common/scoring/smoothness.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

namespace needlelab {
namespace {

constexpr double kLeastPeak_mps = 1e-6;

double peakOf(std::span<const double> speed_mps) {
  double peak = 0;
  for (const double v : speed_mps) peak = std::max(peak, std::abs(v));
  return peak;
}

/// In-place discrete Fourier transform, length a power of two: bit-reversed order, then butterflies.
void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; (j & bit) != 0; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  std::vector<std::complex<double>> roots(n / 2);
  for (std::size_t k = 0; k < n / 2; ++k) {
    roots[k] = std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n));
  }
  for (std::size_t half = 1; half < n; half *= 2) {
    for (std::size_t start = 0; start < n; start += 2 * half) {
      for (std::size_t k = 0; k < half; ++k) {
        const std::complex<double> turned = roots[k * (n / (2 * half))] * x[start + half + k];
        x[start + half + k] = x[start + k] - turned;
        x[start + k] += turned;
      }
    }
  }
}

}  // namespace

std::optional<double> sparc(std::span<const double> speed_mps, double rate_hz) {
  if (speed_mps.size() < 3 || speed_mps.size() > kLongestProfile) return std::nullopt;
  if (peakOf(speed_mps) < kLeastPeak_mps) return std::nullopt;

  // amplitude spectrum up to the cut-off, normalised to its maximum there
  std::vector<std::complex<double>> spectrum(std::bit_ceil(speed_mps.size()) << kSparcPadding);
  std::copy(speed_mps.begin(), speed_mps.end(), spectrum.begin());
  transform(spectrum);
  const double step_hz = rate_hz / static_cast<double>(spectrum.size());
  std::vector<double> amplitude;
  for (std::size_t k = 0; k < spectrum.size() && static_cast<double>(k) * step_hz <= kSparcCutoffHz; ++k) {
    amplitude.push_back(std::abs(spectrum[k]));
  }
  const double greatest = *std::max_element(amplitude.begin(), amplitude.end());
  if (!(greatest > 0)) return std::nullopt;

  // the part between the first and the last frequency that reach the threshold
  const auto reaches = [&](double a) { return a >= kSparcThreshold * greatest; };
  const auto first = std::find_if(amplitude.begin(), amplitude.end(), reaches);
  const auto last = std::find_if(amplitude.rbegin(), amplitude.rend(), reaches).base() - 1;
  if (first >= last) return std::nullopt;
  const double width = 1.0 / static_cast<double>(last - first);
  double length = 0;
  for (auto a = first; a != last; ++a) length += std::hypot(width, (a[1] - a[0]) / greatest);
  return -length;
}

std::optional<double> ldlj(std::span<const double> speed_mps, double rate_hz) {
  if (speed_mps.size() < 3) return std::nullopt;
  const double peak = peakOf(speed_mps);
  if (peak < kLeastPeak_mps) return std::nullopt;
  double sum = 0;
  for (std::size_t i = 2; i < speed_mps.size(); ++i) {
    const double second = (speed_mps[i] - 2 * speed_mps[i - 1] + speed_mps[i - 2]) * rate_hz * rate_hz;
    sum += second * second;
  }
  const double duration_s = static_cast<double>(speed_mps.size()) / rate_hz;
  const double jerk = duration_s * duration_s * duration_s / (peak * peak) * sum / rate_hz;
  if (!(jerk > 0)) return std::nullopt;
  return -std::log(jerk);
}

}  // namespace needlelab
