/// Good and bad samples from a device, and the gate's reaction.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "client/device/hand/hand_plan.h"
#include "client/sim/stability/loop/plant.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// Tick rate of prescribed motions and of samples before the gate, unless a case sets its own.
inline constexpr double kMotionRate_hz = 1000;

/// The device's report in one tick.
struct DeviceSample {
  TipSample tip;
  bool fresh = true;               ///< false: no report
  bool acknowledge = false;        ///< a person acknowledges the fault in this tick
  std::int64_t elapsed_ticks = 1;  ///< periods since the previous sample, by the loop's clock
};

/// The other quaternion of the same rotation.
inline Quat otherSign(Quat q) {
  return {-q.x, -q.y, -q.z, -q.w};
}

struct GatedTick {
  DeviceSample sample;
  StepReport report;  ///< of the last stepped tick
  Wrench out_W;       ///< to the device
  Fault fault = Fault::kNone;
  double depth_m = 0;
};

/// A source behind the gate, as in the haptic loop. `with_gate` false passes the source's wrench to the
/// device unchanged and steps every sample. A plane's normal must have unit length.
class GatedSource {
 public:
  GatedSource(std::unique_ptr<ForceSource> source, const Limb& limb, bool with_gate)
      : source_(std::move(source)), limb_(limb), with_gate_(with_gate) {}
  GatedTick next(const DeviceSample& sample) {
    const bool admitted = gate_.admit(sample.tip, sample.fresh, 0.0, sample.elapsed_ticks);
    Wrench wanted;
    if (with_gate_ ? admitted : sample.fresh) {
      source_->step(sample.tip, report_);
      wanted = report_.wrench_W;
    } else if (!with_gate_) {
      wanted = report_.wrench_W;  // no new sample: the device keeps the last wrench
    }
    const double depth_m = signedDepth(limb_, sample.tip.p_WT_m);
    gate_.noteOutside(depth_m <= 0);
    if (sample.acknowledge) gate_.acknowledge();
    const Wrench guarded = gate_.guard(wanted).wrench();
    return {sample, report_, with_gate_ ? guarded : wanted, with_gate_ ? gate_.fault() : Fault::kNone,
            depth_m};
  }

 private:
  std::unique_ptr<ForceSource> source_;
  Limb limb_;
  ForceGate gate_{DeviceLimits{}, kMotionRate_hz};
  bool with_gate_;
  StepReport report_;
};

/// Built piece by piece; starts upright, 5 mm outside, at kMotionRate_hz.
class DeviceScript {
 public:
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
  /// Changes the device's reports for a while: `change(sample, k)`, k from 0.
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
  static std::size_t ticksOf(double seconds) {
    return static_cast<std::size_t>(seconds * kMotionRate_hz + 0.5);
  }
  DeviceSample now_;
  std::vector<DeviceSample> samples_;
};

}  // namespace needlelab
