/// The waiting time before the next attempt to connect.
#pragma once

#include <algorithm>
#include <chrono>

namespace needlelab {

/// Doubles with each attempt, and is random so that servers which lost NATS together do not return together.
class BackOff {
 public:
  static constexpr std::chrono::milliseconds kFirst{100}, kLast{2'000};

  /// `drawn`: random, in [0, 1).
  std::chrono::milliseconds next(double drawn) {
    const auto whole = next_;
    next_ = std::min(2 * next_, kLast);
    return std::chrono::milliseconds(
        static_cast<std::chrono::milliseconds::rep>(static_cast<double>(whole.count()) * (0.5 + drawn / 2)));
  }
  /// Call when a connection has lasted for some time.
  void reset() { next_ = kFirst; }

 private:
  std::chrono::milliseconds next_ = kFirst;
};

}  // namespace needlelab
