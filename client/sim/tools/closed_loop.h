/// The haptic chain on virtual time, device included: one tick after the other, nothing waits.
#pragma once

#include <cstdint>
#include <vector>

#include "client/device/haptic_chain.h"
#include "common/base/result.h"

namespace needlelab {

/// Runs until the device has finished, or for `max_ticks`. `model` was compiled for the rate that the device
/// is opened with. Errors: those of the device's `open`; kFailed when the gate took the force away, with the
/// tick and the reason.
Result<std::vector<ChainTick>> runClosedLoop(const SceneModel& model, Device& device, const Pose& X_HT,
                                             std::uint64_t max_ticks);

}  // namespace needlelab
