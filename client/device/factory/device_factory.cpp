#include "client/device/factory/device_factory.h"

#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "client/device/falcon/falcon_device.h"
#include "client/device/hand/simulated_device.h"
#include "client/device/recording/needle_direction.h"
#include "client/device/recording/recording_device.h"
#include "client/device/virtuose/virtuose_device.h"
#include "client/device/virtuose/virtuose_link.h"
#include "common/gesture/whole_recording.h"

namespace needlelab {
namespace {

using MadeDevice = Result<std::unique_ptr<Device>>;

// returns the rest of the spec without the separator
std::string argumentOf(const std::string& rest) {
  return rest.empty() ? rest : rest.substr(1);
}

MadeDevice makeSimulated(const std::string& /*rest*/, const DeviceOptions& options) {
  const bool steered = options.hand.plan == kPointerPlan && options.steering != nullptr;
  ASSIGN_OR_RETURN(auto plan, steered ? Result<HandPlan>(steeredStart(options.way))
                                      : choosePlan(options.hand, options.scene, options.targets));
  SimulatedDeviceOptions simulated;
  simulated.hand = options.hand;
  if (steered) simulated.steering = options.steering;
  simulated.X_HT = options.X_HT;
  return MadeDevice(std::make_unique<SimulatedDevice>(simulated, std::move(plan)));
}

std::vector<FoundDevice> listSimulated() {
  return {{"simulated", "a Virtuose 6D Desktop held by a simulated hand", "needs no hardware", true}};
}

MadeDevice makeRecording(const std::string& rest, const DeviceOptions& options) {
  const std::string file = argumentOf(rest);
  if (file.empty())
    return Error{ErrorCode::kInvalidInput, "--device recording: needs a file, as in recording:stroke.csv"};
  const bool is_recording = beginsAsRecording(file);
  ASSIGN_OR_RETURN(auto track, is_recording ? readRecordedTrack(file, options.X_HT) : readPoseTrack(file));
  if (!is_recording) warnOfDirection(file, options.scene.limb, track, options.X_HT);
  return MadeDevice(
      std::make_unique<RecordingDevice>(std::move(track), std::filesystem::path(file).filename().string()));
}

std::vector<FoundDevice> listRecording() {
  return {{"recording:FILE", "the recorded motion in a recording or a CSV file; the hand feels nothing",
           "needs no hardware", true}};
}

MadeDevice makeVirtuose(const std::string& rest, const DeviceOptions& /*options*/) {
  VirtuoseOptions virtuose;
  ASSIGN_OR_RETURN(virtuose.address, virtuoseAddress(argumentOf(rest)));
  return MadeDevice(std::make_unique<VirtuoseDevice>(std::move(virtuose)));
}

MadeDevice makeFalcon(const std::string& rest, const DeviceOptions& /*options*/) {
  ASSIGN_OR_RETURN(auto falcon, falconOptions(rest));
  // loading takes some seconds: show the progress
  if (::isatty(STDERR_FILENO) != 0)
    falcon.progress = [](const std::string& text) {
      std::fprintf(stderr, "\r%s ", text.c_str());
      if (text.ends_with("100 %")) std::fputc('\n', stderr);
    };
  return MadeDevice(std::make_unique<FalconDevice>(std::move(falcon)));
}

constexpr DeviceKind kKinds[] = {
    {"simulated", "", "", "simulated", "simulated device", 0, makeSimulated, listSimulated},
    {"recording", ":FILE", ":", "recording:FILE", "recorded motion", 0, makeRecording, listRecording},
    {"virtuose", "[:HOST#PORT]", ":", "virtuose", "Virtuose 6D", 3, makeVirtuose,
     [] { return listVirtuose(); }},
    {"falcon", "[:FIRMWARE-FILE][@SERIAL-OR-BUS-PATH]", ":@", "falcon", "Novint Falcon", 3, makeFalcon,
     listFalcons},
};

}  // namespace

std::span<const DeviceKind> deviceKinds() {
  return kKinds;
}

std::string deviceKindsText() {
  std::string text;
  for (const DeviceKind& kind : kKinds)
    text += (text.empty() ? std::string() : ", ") + kind.name + kind.arguments;
  return text;
}

const DeviceKind* deviceKindOf(const std::string& spec) {
  for (const DeviceKind& kind : kKinds) {
    if (!spec.starts_with(kind.name)) continue;
    const std::size_t end = std::strlen(kind.name);
    if (spec.size() == end || std::strchr(kind.separators, spec[end]) != nullptr) return &kind;
  }
  return nullptr;
}

Result<std::unique_ptr<Device>> makeDevice(const std::string& spec, const DeviceOptions& options) {
  if (const DeviceKind* kind = deviceKindOf(spec))
    return kind->make(spec.substr(std::strlen(kind->name)), options);
  return Error{ErrorCode::kInvalidInput,
               "--device '" + spec + "' is unknown; there are " + deviceKindsText()};
}

}  // namespace needlelab
