/// How long to wait before the next try to connect: exponential with jitter, so that a thousand stations
/// whose server restarts do not come back at the same instant.
#pragma once

#include <chrono>
#include <cstdint>
#include <random>

namespace needlelab {

/// Deterministic for a seed. Thread: one.
class Backoff {
 public:
  struct Settings {
    std::chrono::milliseconds first{200};
    std::chrono::milliseconds most{10'000};
    double factor = 2.0;
  };

  Backoff(std::uint64_t seed, Settings settings) : settings_(settings), random_(seed) {}
  explicit Backoff(std::uint64_t seed) : Backoff(seed, Settings{}) {}

  /// Uniform in [d/2, d], d = min(most, first·factor^n) for the n-th call since the last reset.
  std::chrono::milliseconds next();
  /// After a success.
  void reset() { tries_ = 0; }
  [[nodiscard]] std::uint32_t tries() const { return tries_; }

 private:
  Settings settings_;
  std::mt19937_64 random_;
  std::uint32_t tries_ = 0;
};

}  // namespace needlelab
