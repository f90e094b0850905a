#include "client/station/run/device_scene.h"

#include <utility>

namespace needlelab {
namespace {

bool lacksTorque(const DeviceInfo& device) {
  return device.renders_force && !device.renders_torque;
}

}  // namespace

SceneSpec forDevice(SceneSpec scene, const DeviceInfo& device, std::vector<std::string>& notes) {
  const EffectMask limit = bitOf(Effect::kOrientationLimit);
  if (!device.has_orientation)
    notes.push_back(
        "The device does not measure how it is turned: the needle is taken to stand on the skin, its axis "
        "the "
        "inward normal at the point of entry, kept for the insertion. Angles of the needle in the recording "
        "and in its measures are those of that axis.");
  if ((scene.effects & limit) != 0 && (!device.has_orientation || lacksTorque(device))) {
    scene.effects &= ~limit;
    notes.push_back(lacksTorque(device) ? "ORIENTATION_LIMIT is not live: the device renders no torque."
                                        : "ORIENTATION_LIMIT is not live: it needs the needle's angle.");
  }
  return scene;
}

void noteTool(const Pose& X_HT, const DeviceInfo& device, std::vector<std::string>& notes) {
  if (X_HT == Pose{}) return;
  if (!device.has_orientation)
    notes.push_back(
        "The tool's offset is taken along the axes of the device's base, however the hand turns; its "
        "direction "
        "is not used.");
  else if (lacksTorque(device) && X_HT.p != Vec3{})
    notes.push_back(
        "The handle gets the force at the needle's tip without the torque of its lever: a turn of the hand "
        "moves the tip and is not resisted.");
}

Status fitLesson(StationLesson& lesson, const DeviceInfo& device, const StationOptions& options,
                 std::vector<std::string>& notes) {
  const EffectMask before = lesson.scene.effects;
  lesson.scene = forDevice(std::move(lesson.scene), device, notes);
  noteTool(options.X_HT, device, notes);
  if (lesson.scene.effects == before) return {};
  auto model = compile(lesson.scene, options.rate_hz);
  if (!model.ok())
    return Error{model.error().code,
                 "profile " + lesson.profile.id() + " on the " + device.name + ": " + model.error().message};
  lesson.model = std::move(*model);
  return {};
}

}  // namespace needlelab
