/// Runs good and bad device samples through the gate, and checks the force against the timeline of
/// FORCE_MODEL.md, "Gate".
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "client/device/hand_plan.h"
#include "client/sim/stability/plant.h"
#include "common/haptics/axial_model.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// The report of the device in one tick.
struct DeviceSample {
  TipSample tip;
  bool fresh = true;               ///< false: it said nothing
  bool acknowledge = false;        ///< a person acknowledges the fault in this tick
  std::int64_t elapsed_ticks = 1;  ///< periods since the sample before, by the loop's clock
};

/// The same rotation.
inline Quat otherSign(Quat q) {
  return {-q.x, -q.y, -q.z, -q.w};
}

struct GatedTick {
  DeviceSample sample;
  StepReport report;  ///< of the last tick that was stepped
  Wrench out_W;       ///< to the device
  Fault fault = Fault::kNone;
  double depth_m = 0;
};

/// A source behind the gate, as in the haptic loop; `with_gate` false gives the source's wrench to the device
/// as it is, and steps every sample. A plane's normal must have unit length.
class GatedSource {
 public:
  GatedSource(std::unique_ptr<ForceSource> source, const Limb& limb, double rate_hz, bool with_gate)
      : source_(std::move(source)), limb_(limb), gate_(DeviceLimits{}, rate_hz), with_gate_(with_gate) {}
  GatedTick next(const DeviceSample& sample);

 private:
  std::unique_ptr<ForceSource> source_;
  Limb limb_;
  ForceGate gate_;
  bool with_gate_;
  StepReport report_;
};

/// Runs a new source over the samples. Errors: those of the source.
Result<std::vector<GatedTick>> runGated(const ForceSourceFactory& source, const SceneSpec& scene,
                                        const std::vector<DeviceSample>& samples, double rate_hz,
                                        bool with_gate);

/// What FORCE_MODEL.md, "Gate", allows after the samples turn bad at tick `from`.
struct FaultTimeline {
  std::size_t from = 0;         ///< first bad tick
  std::size_t held_ticks = 5;   ///< the last force is held for so many, then FAULT
  std::size_t slack_ticks = 0;  ///< that the fault may come late
  std::size_t fade_ticks = 20;  ///< force is zero so many ticks after the fault at the latest
  std::size_t restart = 0;      ///< first tick at which the tip is outside and the fault was acknowledged
  Fault fault = Fault::kSampleNotFinite;
};

/// The greatest violation of the timeline in N; infinite when the fault is not raised or another one is, or
/// when a force is not finite. A run without a gate (a control) never raises the fault. The check then judges
/// the forces alone, as if the fault had come at the last tick allowed.
double violationOf(const std::vector<GatedTick>& ticks, const FaultTimeline& timeline, bool with_gate);

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
  static std::size_t ticksOf(double seconds) { return static_cast<std::size_t>(seconds * kRate_hz + 0.5); }
  DeviceSample now_;
  std::vector<DeviceSample> samples_;
};

struct FuzzFindings {
  bool finite = true;
  std::uint64_t ticks = 0;
  double max_force_N = 0;
  double excess_force_N = 0;     ///< of the source, above the scene's greatest force
  double excess_rendered_N = 0;  ///< after the gate, above the device's peak
  double direction_error = 0;    ///< | |u| − 1 |
};

/// Steps new sources of random scenes for `ticks` ticks in all; every sample is given to one source, and to
/// another one behind the gate. Deterministic. Errors: those of the source.
Result<FuzzFindings> fuzzSource(const ForceSourceFactory& source, AxialModel model, std::uint64_t ticks,
                                bool with_gate);

}  // namespace needlelab
