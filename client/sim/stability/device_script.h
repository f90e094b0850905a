/// Samples of a device that holds a needle which goes straight in and out of the plane z = 0, and now and
/// then says something else.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "client/device/hand_plan.h"
#include "client/sim/stability/gated_run.h"

namespace needlelab {

/// Put together piece by piece; starts upright, 5 mm outside. Ticks of 1 ms.
class DeviceScript {
 public:
  static constexpr double kRate_hz = 1000;

  DeviceScript() { now_.tip = {{0, 0, 0.005}, orientationAlong({0, 0, -1})}; }
  DeviceScript& rest(double seconds) {
    for (std::size_t k = ticksOf(seconds); k > 0; --k) samples_.push_back(now_);
    return *this;
  }
  DeviceScript& goTo(double depth_m, double speed_mps) {
    const double from = now_.tip.p_WT_m.z, way = -depth_m - from;
    const std::size_t ticks = ticksOf(std::abs(way) / speed_mps);
    for (std::size_t k = 1; k <= ticks; ++k) {
      now_.tip.p_WT_m.z = from + way * static_cast<double>(k) / static_cast<double>(ticks);
      samples_.push_back(now_);
    }
    return *this;
  }
  /// For a while the device says something else: `change(sample, k)`, k from 0.
  template <typename Change>
  DeviceScript& with(double seconds, const Change& change) {
    for (std::size_t k = 0; k < ticksOf(seconds); ++k) {
      samples_.push_back(now_);
      change(samples_.back(), k);
    }
    return *this;
  }
  /// A person acknowledges the fault in the last tick.
  DeviceScript& acknowledge() {
    samples_.back().acknowledge = true;
    return *this;
  }
  [[nodiscard]] std::size_t ticks() const { return samples_.size(); }
  [[nodiscard]] const std::vector<DeviceSample>& samples() const { return samples_; }

 private:
  static std::size_t ticksOf(double seconds) { return static_cast<std::size_t>(seconds * kRate_hz + 0.5); }
  DeviceSample now_;
  std::vector<DeviceSample> samples_;
};

}  // namespace needlelab
