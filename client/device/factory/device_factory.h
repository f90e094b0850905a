/// The table of devices: makes a device from the text of `--device`, and lists this computer's devices.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand/hand.h"
#include "client/device/hand/hand_options.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Facts of the lesson for the device. Only the simulated device uses them, for its hand's insertion.
struct DeviceOptions {
  SceneSpec scene;                                   ///< in W, the limb already placed
  std::vector<PlanTarget> targets;                   ///< of the profile, in W
  Pose X_HT;                                         ///< the tool: the tip in the handle's frame
  HandOptions hand;                                  ///< `--hand-…` (hand_options.h)
  std::shared_ptr<HandSteering> steering = nullptr;  ///< for the plan `pointer`
  PlannedInsertion way = {};                         ///< where that one starts
};

/// A kind of device: one row of the table.
struct DeviceKind {
  const char* name;        ///< `--device NAME…`
  const char* arguments;   ///< optional text after the name, for --help, e.g. "[:HOST#PORT]"
  const char* separators;  ///< characters that may follow the name: "", ":" or ":@"
  const char* listed_as;   ///< entry in --list-devices when the kind has no listing of its own
  const char* title;       ///< for a person
  /// Ticks from a reading to its force, as lessons assume them until they are measured, where the device does
  /// not know them (DeviceInfo::delay_ticks). An assumption: one to read, compute and write, two in the
  /// device.
  double assumed_delay_ticks;
  /// Makes the device without opening it. `rest`: the text of `--device` after the name, separator included.
  Result<std::unique_ptr<Device>> (*make)(const std::string& rest, const DeviceOptions& options);
  /// Lists the devices of this kind on this computer. Renders no force; may take long.
  std::vector<FoundDevice> (*list)();
};

/// All kinds, in the order of `--list-devices`.
std::span<const DeviceKind> deviceKinds();

/// For `--help` and for error messages, e.g. "simulated, recording:FILE".
std::string deviceKindsText();

/// The kind of the device that `spec` names; null if it names none.
const DeviceKind* deviceKindOf(const std::string& spec);

/// Makes the device named by `spec`, without opening it. Errors (kInvalidInput): an unknown kind, with the
/// list of known ones; a recording that cannot be read, with file, line, column and value; a hand's plan that
/// does not fit the scene.
Result<std::unique_ptr<Device>> makeDevice(const std::string& spec, const DeviceOptions& options);

}  // namespace needlelab
