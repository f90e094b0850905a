/// The gate's guarantees, checked tick by tick from outside, in any run.
#pragma once

#include <functional>
#include <string>

#include "tests/support/time/haptic_thread.h"

namespace needlelab::test {

/// The rules count ticks of 1 ms and do not know the gate's internals.
class GateRules {
 public:
  GateRules(const DeviceLimits& limits, std::function<void(const std::string&)> broken)
      : limits_(limits), broken_(std::move(broken)) {}
  /// Call after each tick of `haptic`.
  void check(const HapticThread& haptic);

 private:
  void checkFault(const HapticThread& haptic);
  void checkShare(const HapticThread& haptic);

  static constexpr double kFadeOutTicks = 20, kFadeInTicks = 200;
  static constexpr std::int64_t kMostSilentTicks = 20, kMostBadTicks = 5;
  static constexpr double kRounding_N = 1e-9;

  DeviceLimits limits_;
  std::function<void(const std::string&)> broken_;
  std::uint64_t last_tick_ = 0, faults_ = 0;
  bool any_tick_ = false, held_before_ = false;
  double last_force_N_ = 0, at_fault_N_ = 0, wanted_N_ = 0;
  double most_share_ = 0;  // of the wanted force
  std::int64_t fault_ticks_ = 0, silent_ticks_ = 0, bad_ticks_ = 0;
};

}  // namespace needlelab::test
