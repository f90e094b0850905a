/// How long to wait before the next try to connect.
#pragma once

#include <algorithm>
#include <chrono>

namespace needlelab {

/// Doubles from try to try, and varies, so that servers which lost NATS together do not come back together.
class BackOff {
 public:
  static constexpr std::chrono::milliseconds kFirst{100}, kLast{2'000};

  /// `drawn`: in [0, 1).
  std::chrono::milliseconds next(double drawn) {
    const auto whole = next_;
    next_ = std::min(2 * next_, kLast);
    return std::chrono::milliseconds(
        static_cast<std::chrono::milliseconds::rep>(static_cast<double>(whole.count()) * (0.5 + drawn / 2)));
  }
  /// A connection was made, and lasted.
  void reset() { next_ = kFirst; }

 private:
  std::chrono::milliseconds next_ = kFirst;
};

}  // namespace needlelab
