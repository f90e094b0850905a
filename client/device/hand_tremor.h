/// Physiological tremor of a hand: small motion in the band 8-12 Hz, from a seed, the same on every machine.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/haptics/geometry.h"

namespace needlelab {

/// Random numbers with a fixed definition (SplitMix64, Steele et al. 2014), so that a seed means the same
/// hand everywhere.
class HandRandom {
 public:
  explicit HandRandom(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() noexcept;
  /// Uniform in [0, 1), 53 bits.
  double uniform() noexcept;

 private:
  std::uint64_t state_;
};

/// Per axis three sines in [8, 12] Hz with random frequencies and phases, each of a third of the amplitude:
/// the displacement of an axis never exceeds the amplitude and comes near it again and again. The sines are
/// turned by complex multiplication, so that no C library decides about bits.
class HandTremor {
 public:
  static constexpr double kLowHz = 8, kHighHz = 12;
  static constexpr std::size_t kPartials = 3;

  /// `amplitude_m`: peak per axis. `step_s`: time between two calls of `next`.
  HandTremor(double amplitude_m, std::uint64_t seed, double step_s);

  /// Displacement in W at the next step.
  Vec3 next() noexcept;
  /// Frequency of a partial of an axis, in Hz.
  [[nodiscard]] double frequencyHz(std::size_t axis, std::size_t partial) const {
    return partials_[axis][partial].hz;
  }

 private:
  struct Partial {
    double hz = 0;
    double c = 1, s = 0;            // the phase now, as a point on the unit circle
    double turn_c = 1, turn_s = 0;  // turn of one step
  };
  double share_m_;
  std::array<std::array<Partial, kPartials>, 3> partials_;
};

}  // namespace needlelab
