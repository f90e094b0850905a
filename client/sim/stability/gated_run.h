/// Samples as a device might give them, good and bad, through the gate to the device: DESIGN §3.7 as a
/// timeline that the force must keep to.
#pragma once

#include <vector>

#include "client/sim/stability/force_source.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// What the device says in one tick.
struct DeviceSample {
  TipSample tip;
  bool fresh = true;         ///< false: it said nothing
  bool acknowledge = false;  ///< a person acknowledges the fault in this tick
};

struct GatedTick {
  DeviceSample sample;
  StepReport report;  ///< of the last tick that was stepped
  Wrench out_W;       ///< to the device
  Fault fault = Fault::kNone;
  double depth_m = 0;
};

/// Runs a new source behind the gate; `with_gate` false gives the source's wrench to the device as it is, and
/// steps every sample. A plane's normal must have unit length. Errors: those of the source.
Result<std::vector<GatedTick>> runGated(const ForceSourceFactory& source, const SceneSpec& scene,
                                        const std::vector<DeviceSample>& samples, double rate_hz,
                                        bool with_gate);

/// What DESIGN §3.7 allows after the samples turn bad at tick `from`.
struct FaultTimeline {
  std::size_t from = 0;         ///< first bad tick
  std::size_t held_ticks = 5;   ///< the last force is held for so many, then FAULT
  std::size_t slack_ticks = 0;  ///< that the fault may come late
  std::size_t fade_ticks = 20;  ///< force is zero so many ticks after the fault at the latest
  std::size_t restart = 0;      ///< first tick at which the tip is outside and the fault was acknowledged
  Fault fault = Fault::kSampleNotFinite;
};

/// The greatest violation of the timeline in N; infinite when the fault is not raised or another one is, or
/// when a force is not finite. Without a gate (a control) nobody raises it: then the forces alone are judged,
/// as if it had been raised at the last tick allowed.
double violationOf(const std::vector<GatedTick>& ticks, const FaultTimeline& timeline, bool with_gate);

}  // namespace needlelab
