/// How much force or torque a device's motors may still be asked for (DESIGN §3.7).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace needlelab {

/// What the motors may still take: the energy ∫|f|² of any 10 s stays at or below 10 s times the continuous
/// limit squared. A magnitude up to 0.98 of the continuous limit is never cut; a greater one is
/// let down, as the budget goes, to what can be held for good.
class ThermalBudget {
 public:
  ThermalBudget(double peak, double continuous, double period_s) noexcept;
  /// Largest magnitude allowed in this tick, to one who wants `wanted`. Once a tick.
  [[nodiscard]] double allowed(double wanted) noexcept;
  /// Counts the magnitude that was given to the device in this tick.
  void spend(double magnitude) noexcept;

 private:
  [[nodiscard]] double limitNow(double wanted) const noexcept;

  /// 100 ms each: the current one, 100 that the window reaches into, and one that has just left it.
  static constexpr std::size_t kBuckets = 102;
  double peak_, budget_, period_s_;
  double recovery_, allowed_;  ///< the allowed magnitude rises by at most so much a tick
  std::array<double, kBuckets> bucket_{};
  std::size_t current_ = 0;
  std::int64_t ticks_in_bucket_ = 0, ticks_per_bucket_;
  double whole_ = 0;  ///< sum of the 100
};

}  // namespace needlelab
