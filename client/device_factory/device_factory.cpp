#include "device_factory/device_factory.h"

#include <filesystem>
#include <utility>

#include "device/recording_device.h"
#include "device/simulated_device.h"
#include "virtuose/virtuose_device.h"

namespace needlelab {

std::string deviceKinds() {
  return "simulated, recording:FILE, virtuose[:HOST#PORT]";
}

Result<std::unique_ptr<Device>> makeDevice(const std::string& spec, const DeviceOptions& options) {
  const std::size_t colon = spec.find(':');
  const std::string kind = spec.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : spec.substr(colon + 1);

  if (kind == "simulated" && colon == std::string::npos) {
    auto plan = choosePlan(options.hand, options.scene, options.targets);
    if (!plan.ok()) return plan.error();
    SimulatedDeviceOptions simulated;
    simulated.hand = options.hand;
    simulated.X_HT = options.X_HT;
    return std::unique_ptr<Device>(std::make_unique<SimulatedDevice>(simulated, std::move(*plan)));
  }
  if (kind == "recording") {
    if (rest.empty())
      return Error{ErrorCode::kInvalidInput, "--device recording: needs a file, as in recording:stroke.csv"};
    auto track = readPoseTrack(rest);
    if (!track.ok()) return track.error();
    const std::string name = std::filesystem::path(rest).filename().string();
    return std::unique_ptr<Device>(std::make_unique<RecordingDevice>(std::move(*track), name));
  }
  if (kind == "virtuose") {
    auto address = virtuoseAddress(rest);
    if (!address.ok()) return address.error();
    VirtuoseOptions virtuose;
    virtuose.address = std::move(*address);
    return std::unique_ptr<Device>(std::make_unique<VirtuoseDevice>(std::move(virtuose)));
  }
  return Error{ErrorCode::kInvalidInput, "--device '" + spec + "' is unknown; there are " + deviceKinds()};
}

}  // namespace needlelab
