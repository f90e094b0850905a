/// The haptic chain with the device in virtual time: ticks run one after another without waiting.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "client/device/hand/simulated_device.h"
#include "client/device/haptic_chain.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Runs until the device has finished, or for `max_ticks`. `model` must be compiled for the opened device's
/// rate. Errors: those of the device's `open`; kFailed if the gate removed the force, with the tick and the
/// reason.
Result<std::vector<ChainTick>> runClosedLoop(const SceneModel& model, Device& device, const Pose& X_HT,
                                             std::uint64_t max_ticks);

/// One of the paper's profiles (db/samples), compiled into the program: "paper-1dof", "paper-six-layers",
/// "paper-clamping". `X_WL` places it.
Result<SceneModel> paperScene(std::string_view id, const Pose& X_WL, double rate_hz);

/// The same, not compiled.
Result<SceneSpec> paperSceneSpec(std::string_view id, const Pose& X_WL);

/// A run shown in a figure. Times are the figure's: `t0_s` is tick 0.
struct FigureRun {
  double rate_hz = 1000;
  double t0_s = 0;
  std::vector<ChainTick> ticks;
  [[nodiscard]] double time_s(std::size_t i) const {
    return t0_s + static_cast<double>(ticks[i].tick) / rate_hz;
  }
};

/// Runs `plan` to its end in `model` with the simulated hand and device, through the gate.
Result<FigureRun> runPlan(const SceneModel& model, const SimulatedDeviceOptions& device, HandPlan plan,
                          double t0_s);

}  // namespace needlelab
