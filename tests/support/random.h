/// Our own small generator (splitmix64), so that a seed means the same on every machine and library.
#pragma once

#include <cstdint>

namespace needlelab::test {

/// splitmix64 (Steele, Lea, Flood 2014). Equal seeds give equal sequences everywhere; only + × and shifts.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  /// Uniform in [0, 1).
  double unit() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }
  /// Uniform in [low, high).
  double in(double low, double high) { return low + (high - low) * unit(); }
  /// Uniform in 0 … count − 1.
  std::uint64_t below(std::uint64_t count) { return bits() % count; }
  /// Uniform in 0 … most: a time in ns, a number of bytes.
  std::int64_t upTo(std::int64_t most) {
    return static_cast<std::int64_t>(unit() * static_cast<double>(most));
  }
  bool chance(double probability) { return unit() < probability; }

 private:
  std::uint64_t state_;
};

}  // namespace needlelab::test
