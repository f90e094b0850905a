#include "device/hand_tremor.h"

#include <cmath>

namespace needlelab {
namespace {

constexpr double kTwoPi = 6.283185307179586;

struct Circle {
  double c, s;
};

// cosine and sine of a small angle (at most 0.16 rad) by Taylor's series: exact to rounding, and the same
// everywhere
Circle smallTurn(double x) {
  const double x2 = x * x;
  const double c = 1 - x2 / 2 * (1 - x2 / 12 * (1 - x2 / 30 * (1 - x2 / 56 * (1 - x2 / 90))));
  const double s = x * (1 - x2 / 6 * (1 - x2 / 20 * (1 - x2 / 42 * (1 - x2 / 72 * (1 - x2 / 110)))));
  return {c, s};
}

// a random point of the unit circle, without trigonometry
Circle randomPhase(HandRandom& random) {
  for (;;) {
    const double x = 2 * random.uniform() - 1, y = 2 * random.uniform() - 1;
    const double r2 = x * x + y * y;
    if (r2 > 0.01 && r2 <= 1) return {x / std::sqrt(r2), y / std::sqrt(r2)};
  }
}

}  // namespace

std::uint64_t HandRandom::next() noexcept {
  state_ += 0x9E3779B97F4A7C15u;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

double HandRandom::uniform() noexcept {
  return static_cast<double>(next() >> 11) * 0x1p-53;
}

HandTremor::HandTremor(double amplitude_m, std::uint64_t seed, double step_s)
    : share_m_(amplitude_m / static_cast<double>(kPartials)) {
  HandRandom random(seed);
  for (auto& axis : partials_)
    for (Partial& partial : axis) {
      partial.hz = kLowHz + (kHighHz - kLowHz) * random.uniform();
      const Circle phase = randomPhase(random);
      const Circle turn = smallTurn(kTwoPi * partial.hz * step_s);
      partial.c = phase.c, partial.s = phase.s;
      partial.turn_c = turn.c, partial.turn_s = turn.s;
    }
}

Vec3 HandTremor::next() noexcept {
  if (share_m_ == 0) return {};
  double sum[3] = {0, 0, 0};
  for (std::size_t i = 0; i < 3; ++i)
    for (Partial& p : partials_[i]) {
      const double c = p.c * p.turn_c - p.s * p.turn_s, s = p.s * p.turn_c + p.c * p.turn_s;
      // one step of Newton's towards length 1, so that rounding never adds up
      const double scale = 1.5 - 0.5 * (c * c + s * s);
      p.c = c * scale, p.s = s * scale;
      sum[i] += p.s;
    }
  return Vec3{sum[0], sum[1], sum[2]} * share_m_;
}

}  // namespace needlelab
