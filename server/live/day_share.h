/// A share of something that comes back within a day.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace needlelab {

/// The whole share is there at once and comes back evenly within a day: so nobody gets more than two of them
/// in a day. Times: steady clock (ns), from the caller, never going back. Thread: one.
class DayShare {
 public:
  /// Whether `amount` of a share of `size` is left.
  [[nodiscard]] bool has(double amount, double size, std::int64_t now_ns) const {
    return usedAt(size, now_ns) + amount <= size * (1 + kRounding);
  }
  /// Takes it, whether it is left or not: ask has() first.
  void take(double amount, double size, std::int64_t now_ns) {
    used_ = usedAt(size, now_ns) + amount;
    at_ns_ = now_ns;
  }
  [[nodiscard]] double usedAt(double size, std::int64_t now_ns) const {
    return std::max(0.0, used_ - static_cast<double>(now_ns - at_ns_) / kDay_ns * size);
  }
  /// Minutes until has() is true, rounded up. `amount`: at most `size`.
  [[nodiscard]] double minutesUntil(double amount, double size, std::int64_t now_ns) const {
    return std::ceil((usedAt(size, now_ns) + amount - size) / size * 24 * 60 * (1 - kRounding));
  }

 private:
  static constexpr double kDay_ns = 86'400e9;
  static constexpr double kRounding = 1e-9;  // of sums and products of shares

  double used_ = 0;
  std::int64_t at_ns_ = 0;
};

}  // namespace needlelab
