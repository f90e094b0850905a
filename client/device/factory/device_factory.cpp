#include "client/device/factory/device_factory.h"

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <string_view>
#include <utility>

#include "client/device/falcon/falcon_device.h"
#include "client/device/recording_device.h"
#include "client/device/simulated_device.h"
#include "client/device/virtuose/virtuose_device.h"

namespace needlelab {

std::string deviceKinds() {
  return "simulated, recording:FILE, virtuose[:HOST#PORT], falcon[:FIRMWARE-FILE][@SERIAL-OR-BUS-PATH]";
}

Result<std::unique_ptr<Device>> makeDevice(const std::string& spec, const DeviceOptions& options) {
  const std::size_t colon = spec.find(':');
  const std::string kind = spec.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : spec.substr(colon + 1);

  if (kind == "simulated" && colon == std::string::npos) {
    const bool steered = options.hand.plan == kPointerPlan && options.steering != nullptr;
    auto plan = steered ? Result<HandPlan>(steeredStart(options.scene, options.targets))
                        : choosePlan(options.hand, options.scene, options.targets);
    if (!plan.ok()) return plan.error();
    SimulatedDeviceOptions simulated;
    simulated.hand = options.hand;
    if (steered) simulated.steering = options.steering;
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
  // "falcon@1-4.2" has no colon
  constexpr std::string_view kFalcon = "falcon";
  if (spec == kFalcon || spec.starts_with("falcon:") || spec.starts_with("falcon@")) {
    auto falcon = falconOptions(spec.substr(kFalcon.size()));
    if (!falcon.ok()) return falcon.error();
    // loading takes some seconds: a person sees how far it is
    if (::isatty(STDERR_FILENO) != 0)
      falcon->progress = [](const std::string& words) {
        std::fprintf(stderr, "\r%s ", words.c_str());
        if (words.ends_with("100 %")) std::fputc('\n', stderr);
      };
    return std::unique_ptr<Device>(std::make_unique<FalconDevice>(std::move(*falcon)));
  }
  return Error{ErrorCode::kInvalidInput, "--device '" + spec + "' is unknown; there are " + deviceKinds()};
}

}  // namespace needlelab
