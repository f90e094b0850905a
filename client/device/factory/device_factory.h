/// From the text of `--device` to a device.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand.h"
#include "client/device/hand_plan_choice.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// What a device may have to know of the lesson. Only the simulated device uses it: its hand pursues an
/// insertion.
struct DeviceOptions {
  SceneSpec scene;                                   ///< in W, the limb already placed
  std::vector<PlanTarget> targets;                   ///< of the profile, in W
  Pose X_HT;                                         ///< the tool: the tip in the handle's frame
  HandOptions hand;                                  ///< `--hand-…` (hand_cli.h)
  std::shared_ptr<HandSteering> steering = nullptr;  ///< for the plan `pointer`
};

/// For `--help` and for error messages: the kinds of device that there are, e.g. "simulated, recording:FILE".
std::string deviceKinds();

/// Makes the device that `spec` names (`simulated`, `recording:FILE`, `virtuose[:HOST#PORT]`,
/// `falcon[:FIRMWARE-FILE][@SERIAL-OR-BUS-PATH]`). It is not
/// opened yet. Errors (kInvalidInput): an unknown kind, with the list of those that exist; a recording that
/// cannot be read, with file, line, column and value; a hand's plan that does not fit the scene.
Result<std::unique_ptr<Device>> makeDevice(const std::string& spec, const DeviceOptions& options);

}  // namespace needlelab
