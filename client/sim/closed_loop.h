/// The haptic chain on virtual time: device → tool → gate → engine → gate → device, one tick after the other,
/// nothing waits.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/result.h"
#include "device/device.h"
#include "gesture/sample.h"
#include "haptics/engine.h"
#include "haptics/force_gate.h"

namespace needlelab {

/// All that a tick saw and did.
struct ChainTick {
  std::uint64_t tick = 0;
  Pose X_WH, X_WT;    ///< as the device reported; of the handle and of the tip
  StepReport report;  ///< forces before the gate
  Wrench rendered_W;  ///< after the gate, at the handle
  std::uint32_t gate_flags = 0;
  Fault fault = Fault::kNone;
  double plunger = 0;
};

/// Gate and engine behind a device's readings. Same readings, same bits.
class HapticChain {
 public:
  /// `model` must outlive the chain.
  HapticChain(const SceneModel& model, const DeviceLimits& limits, const Pose& X_HT);
  /// One tick; `fresh` as in ForceGate::admit. What goes to the device is in `out.rendered_W` and the result.
  GuardedWrench tick(const DeviceReading& reading, bool fresh, ChainTick& out) noexcept;

 private:
  const SceneModel& model_;
  Pose X_HT_;
  ForceGate gate_;
  std::unique_ptr<SimState> state_;
  StepReport report_;
  std::uint64_t next_tick_ = 0;
};

/// Runs until the device has finished, or for `max_ticks`. `model` was compiled for the rate that the device
/// is opened with. Errors: those of the device's `open`; kFailed when the gate took the force away, with the
/// tick and the reason.
Result<std::vector<ChainTick>> runClosedLoop(const SceneModel& model, Device& device, const Pose& X_HT,
                                             std::uint64_t max_ticks);

/// A tick as a recording has it (the station's clock is tick/rate).
GestureSample gestureSampleOf(const ChainTick& tick, double rate_hz);

}  // namespace needlelab
