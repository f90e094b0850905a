#include "client/device/hand_tremor.h"

#include "common/haptics/det_math.h"

namespace needlelab {

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
      const double phase = 2 * kPi * random.uniform();
      const double turn = 2 * kPi * partial.hz * step_s;
      partial.c = detCos(phase), partial.s = detSin(phase);
      partial.turn_c = detCos(turn), partial.turn_s = detSin(turn);
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
