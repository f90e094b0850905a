#include "client/device/delay_fit.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

namespace needlelab {
namespace {

using Complex = std::complex<double>;

constexpr double kPeriod_s = 0.5;
constexpr std::array<double, 8> kSines_hz = {14, 18, 24, 30, 38, 46, 56, 68};
constexpr std::size_t kMinPeriods = 6;
constexpr double kMax_s = 15e-3, kCoarse_s = 0.5e-3, kFine_s = 0.01e-3;
constexpr double kMaxWeight = 300;  // a model of a hand is not more accurate than this
constexpr double kMaxUnexplained = 0.05;
// hand and forearm have 2.5 % of a man's mass (Plagenhoef et al. 1983): 2 kg of 80 kg. The fit of a handle
// without a hand is up to 11 % too light
constexpr double kMaxHand_kg = 2, kMinOfHandle = 0.8;
// a force below 0 by less than this share of the mass's force at the lowest sine cannot be told from 0: in a
// light grip with tremor, good measurements go down to 0.1
constexpr double kBelowZero = 0.1;

std::size_t periodTicks(double rate_hz) {
  return static_cast<std::size_t>(std::lround(kPeriod_s * rate_hz));
}

// a measurement at one frequency
struct Line {
  double omega = 0;
  Complex held;      // a force that is held for a tick
  Complex response;  // place over force, m/N
  double weight = 0;
};

// the component at `hz`, under a Hann window, which excludes the hand's drift and tremor
Complex componentOf(std::span<const ResponseSample> samples, double rate_hz, double hz,
                    double ResponseSample::*of) {
  const double count = static_cast<double>(samples.size());
  Complex sum = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double at = static_cast<double>(i);
    const double window = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * at / count);
    sum += samples[i].*of * window * std::polar(1.0, -2 * std::numbers::pi * hz * at / rate_hz);
  }
  return sum / count;
}

std::vector<Line> linesOf(std::span<const ResponseSample> samples, double rate_hz) {
  std::vector<Line> lines;
  // four bins of the window away, there is only noise
  const double apart_hz = 4 * rate_hz / static_cast<double>(samples.size());
  for (const double hz : kSines_hz) {
    const Complex force = componentOf(samples, rate_hz, hz, &ResponseSample::force_N);
    const Complex place = componentOf(samples, rate_hz, hz, &ResponseSample::place_m);
    if (std::abs(force) == 0) continue;
    double noise = 0;
    for (const double aside : {-1.5, -1.0, 1.0, 1.5})
      noise += std::norm(componentOf(samples, rate_hz, hz + aside * apart_hz, &ResponseSample::place_m)) / 4;
    const double turn = hz / rate_hz, x = std::numbers::pi * turn;
    Line line{2 * std::numbers::pi * hz, std::polar(std::sin(x) / x, -x), place / force, kMaxWeight};
    if (noise > 0) line.weight = std::min(kMaxWeight, std::abs(place) / std::sqrt(noise));
    lines.push_back(line);
  }
  return lines;
}

// weighted least squares of (k, b, m) in k + iωb − ω²m = held·e^(−iωθ)/((1 + iωτ)·response), each line
// relative to its own size
struct Fitted {
  double error = HUGE_VAL;
  double stiffness = 0, damping = 0, mass = 0;
};
Fitted fitted(std::span<const Line> lines, double delay_s, double lag_s) {
  // real part: k − ω²m; imaginary part: ωb. They are independent
  double one = 0, w2 = 0, w4 = 0, r = 0, rw2 = 0, ww = 0, iw = 0, all = 0, weights = 0;
  for (const Line& line : lines) {
    const Complex wanted =
        line.held * std::polar(1.0, -line.omega * delay_s) / (Complex(1, line.omega * lag_s) * line.response);
    const double w = line.weight * line.weight / std::norm(wanted), o2 = line.omega * line.omega;
    one += w, w2 += w * o2, w4 += w * o2 * o2;
    r += w * wanted.real(), rw2 += w * o2 * wanted.real();
    ww += w * o2, iw += w * line.omega * wanted.imag();
    all += w * std::norm(wanted), weights += line.weight * line.weight;
  }
  const double det = one * w4 - w2 * w2;
  if (!(det > 0) || !(ww > 0)) return {};
  Fitted f;
  f.stiffness = (r * w4 - rw2 * w2) / det;
  f.mass = (r * w2 - rw2 * one) / det;
  f.damping = iw / ww;
  // the remaining squares
  f.error = std::max(0.0, all - (f.stiffness * r - f.mass * rw2) - f.damping * iw) / weights;
  return f;
}

struct Found {
  double delay_s = 0, lag_s = 0;
  Fitted model;
};
Found search(std::span<const Line> lines) {
  Found best;
  const auto scan = [&](double delay_from, double delay_to, double lag_from, double lag_to, double step) {
    for (double lag = std::max(0.0, lag_from); lag <= lag_to; lag += step)
      for (double delay = std::max(0.0, delay_from); delay <= delay_to; delay += step)
        if (const Fitted model = fitted(lines, delay, lag); model.error < best.model.error)
          best = {delay, lag, model};
  };
  scan(0, kMax_s, 0, kMax_s, kCoarse_s);
  for (double step = kCoarse_s / 5; step >= kFine_s; step /= 5) {
    const Found at = best;
    scan(at.delay_s - 8 * step, at.delay_s + 8 * step, at.lag_s - 8 * step, at.lag_s + 8 * step, step);
  }
  return best;
}

}  // namespace

std::vector<double> probeForce(double rate_hz, double seconds, double max_N) {
  const std::size_t period = periodTicks(rate_hz);
  std::vector<double> force(period, 0.0);
  double most = 0;
  for (std::size_t i = 0; i < period; ++i) {
    for (std::size_t k = 0; k < kSines_hz.size(); ++k) {
      // Schroeder's phases keep the peak low
      const double n = static_cast<double>(k),
                   phase = -std::numbers::pi * n * (n + 1) / static_cast<double>(kSines_hz.size());
      force[i] += std::sin(2 * std::numbers::pi * kSines_hz[k] * static_cast<double>(i) / rate_hz + phase);
    }
    most = std::max(most, std::abs(force[i]));
  }
  const auto periods = static_cast<std::size_t>(seconds / kPeriod_s + 1e-9);
  std::vector<double> all;
  all.reserve(periods * period);
  for (std::size_t i = 0; i < periods * period; ++i) all.push_back(force[i % period] * max_N / most);
  return all;
}

Result<DelayFit> fitDelay(std::span<const ResponseSample> samples, double rate_hz, double handle_kg) {
  const std::size_t period = periodTicks(rate_hz), periods = samples.size() / period;
  if (periods < kMinPeriods)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{:.1f} s were measured; {:.1f} s are needed",
                             static_cast<double>(samples.size()) / rate_hz, kMinPeriods * kPeriod_s)};
  const auto used = samples.subspan(period, (periods - 1) * period);
  const auto lines = linesOf(used, rate_hz);
  if (lines.empty()) return Error{ErrorCode::kFailed, "the device was given no force"};
  const Found found = search(lines);
  DelayFit fit{found.delay_s,
               found.lag_s,
               found.model.mass,
               found.model.damping,
               found.model.stiffness,
               std::sqrt(found.model.error),
               0};
  const double omega = 2 * std::numbers::pi * kSines_hz.front(), below = kBelowZero * fit.mass_kg * omega;
  const double from_kg = kMinOfHandle * handle_kg, to_kg = handle_kg + kMaxHand_kg;
  if (!(fit.unexplained <= kMaxUnexplained) || !(fit.mass_kg >= from_kg && fit.mass_kg <= to_kg) ||
      !(fit.damping_Ns_per_m >= -below) || !(fit.stiffness_N_per_m >= -below * omega))
    return Error{
        ErrorCode::kFailed,
        fmt::format(
            "the handle did not answer the force as one in a hand does: it moved like {:.2f} kg, "
            "{:.1f} N·s/m and {:.0f} N/m, with {:.0f} % of the movement something else. Right are "
            "{:.2f} to {:.2f} kg, nothing clearly below 0, and at most {:.0f} %. Hold the handle firmly "
            "and still, and measure again. If that fails too, friction or play hides the delay: have the device "
            "serviced. Lessons keep the delay that they had",
            fit.mass_kg, fit.damping_Ns_per_m, fit.stiffness_N_per_m, 100 * std::min(1.0, fit.unexplained),
            from_kg, to_kg, 100 * kMaxUnexplained)};
  const std::size_t half = (periods - 1) / 2 * period;
  const Found first = search(linesOf(used.first(half), rate_hz)),
              second = search(linesOf(used.last(half), rate_hz));
  fit.halves_apart_s = std::abs(first.delay_s + first.lag_s - second.delay_s - second.lag_s);
  return fit;
}

}  // namespace needlelab
