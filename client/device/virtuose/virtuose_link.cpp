#include "client/device/virtuose/virtuose_link.h"

#include <fmt/core.h>

#include <charconv>

#include "client/device/virtuose/virtuose_errors.h"
#include "common/base/planted_bug.h"
#include "common/base/range.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

constexpr double kMaxRate_hz = 1000;
constexpr NumberRange kRates{kMinRateHz, kMaxRate_hz};
constexpr NumberRange kTimeouts{0.005, 1};

ErrorCode codeOf(int error) {
  if (error == kVirtIncompatibleVersion || error == kVirtMajorMinorVersion) return ErrorCode::kVersion;
  return virtuoseLinkIsLost(error) ? ErrorCode::kUnavailable : ErrorCode::kFailed;
}

Error failedCall(const VirtuoseApi& api, VirtContext context, const std::string& address,
                 const std::string& call) {
  const int code = api.virtGetErrorCode(context);
  return {codeOf(code), "Virtuose at " + address + ": " + call + " failed with " +
                            virtuoseErrorText(code, api.virtGetErrorMessage(code))};
}

// x y z qx qy qz qw; the library takes a non-const array
int setIdentity(int (*set)(VirtContext, float*), VirtContext context) {
  float identity[7] = {0, 0, 0, 0, 0, 0, 1};
  return set(context, identity);
}

int setZeroForce(const VirtuoseApi& api, VirtContext context) {
  float zero[6] = {};
  return api.virtSetForce(context, zero);
}

bool isPort(std::string_view text) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc{} && end == text.data() + text.size() && port >= 1 && port <= 65535;
}

std::string versionText(const VirtuoseApi& api, VirtContext context) {
  std::string text;
  if (const std::string version = virtuoseLibraryVersion(api); !version.empty())
    text += ", library " + version;
  int major = 0, minor = 0;
  if (api.virtGetControlerVersion != nullptr && api.virtGetControlerVersion(context, &major, &minor) == 0)
    text += fmt::format(", device software {}.{}", major, minor);
  return text;
}

// advice until the device is ready; empty when it is
std::string stateOf(const VirtuoseApi& api, VirtContext context) {
  int operational = 0;
  unsigned alarm = 0, failure = 0;
  // the error code belongs to the last call, so stop at the first refusal
  const bool answered = api.virtGetEmergencyStop(context, &operational) == 0 &&
                        api.virtGetAlarm(context, &alarm) == 0 && api.virtGetFailure(context, &failure) == 0;
  if (!answered) {
    const int code = api.virtGetErrorCode(context);
    return "it does not tell how it is: " + virtuoseErrorText(code, api.virtGetErrorMessage(code));
  }
  // no hand is needed yet, and without permission the device has no power
  return virtuoseStateText(operational != 0 ? 0u : kDeviceEmergencyStop, alarm, failure);
}

}  // namespace

Result<std::string> virtuoseAddress(const std::string& text) {
  if (text.empty()) return std::string(kVirtuoseAddress);
  const std::size_t mark = text.find('#');
  const std::string host = text.substr(0, mark);
  const bool host_is_good = !host.empty() && host.find_first_of(" \t\r\n:/") == std::string::npos;
  const std::string port =
      mark == std::string::npos
          ? std::string(kVirtuoseAddress).substr(std::string(kVirtuoseAddress).find('#') + 1)
          : text.substr(mark + 1);
  if (!host_is_good || !isPort(port))
    return Error{ErrorCode::kInvalidInput, "--device virtuose:" + text +
                                               ": the address is HOST#PORT with a port of 1 to 65535, e.g. "
                                               "virtuose:" +
                                               kVirtuoseAddress};
  return host + "#" + port;
}

std::vector<VirtuoseStep> virtuoseSteps(const VirtuoseSetup& setup) {
  const auto step_s = static_cast<float>(1 / setup.rate_hz);
  const auto timeout_s = static_cast<float>(setup.timeout_s);
  const auto force_N = static_cast<float>(setup.limits.peak_force_N);
  const auto torque_Nm = static_cast<float>(setup.limits.peak_torque_Nm);
  using Api = const VirtuoseApi&;
  return {
      {"virtSetIndexingMode", "none",
       [](Api api, VirtContext vc) { return api.virtSetIndexingMode(vc, kVirtIndexingNone); }},
      {"virtSetForceFactor", "1", [](Api api, VirtContext vc) { return api.virtSetForceFactor(vc, 1); }},
      {"virtSetSpeedFactor", "1", [](Api api, VirtContext vc) { return api.virtSetSpeedFactor(vc, 1); }},
      {"virtSetTimeStep", numberText(1 / setup.rate_hz) + " s",
       [=](Api api, VirtContext vc) { return api.virtSetTimeStep(vc, step_s); }},
      {"virtSetBaseFrame", "identity",
       [](Api api, VirtContext vc) { return setIdentity(api.virtSetBaseFrame, vc); }},
      {"virtSetObservationFrame", "identity",
       [](Api api, VirtContext vc) { return setIdentity(api.virtSetObservationFrame, vc); }},
      {"virtSetCommandType", "impedance",
       [](Api api, VirtContext vc) { return api.virtSetCommandType(vc, kVirtImpedance); }},
      {"virtSaturateTorque",
       numberText(setup.limits.peak_force_N) + " N, " + numberText(setup.limits.peak_torque_Nm) + " N·m",
       [=](Api api, VirtContext vc) { return api.virtSaturateTorque(vc, force_N, torque_Nm); }},
      {"virtSetTimeoutValue", numberText(setup.timeout_s) + " s",
       [=](Api api, VirtContext vc) { return api.virtSetTimeoutValue(vc, timeout_s); }},
      {"virtSetForce", "zero", [](Api api, VirtContext vc) { return setZeroForce(api, vc); }},
      {"virtSetPowerOn", "permitted", [](Api api, VirtContext vc) { return api.virtSetPowerOn(vc, 1); }},
  };
}

Result<VirtContext> openVirtuose(const VirtuoseApi& api, const VirtuoseSetup& setup,
                                 const std::vector<VirtuoseStep>& steps) {
  if (!kRates.contains(setup.rate_hz)) {
    Error error = outOfRange("Virtuose: rate in Hz", setup.rate_hz, kRates);
    error.message += " (the device takes one exchange per millisecond at most): give another --rate";
    return error;
  }
  if (!kTimeouts.contains(setup.timeout_s))
    return outOfRange("Virtuose: time-out in s", setup.timeout_s, kTimeouts);

  VirtContext context = api.virtOpen(setup.address.c_str());
  if (context == nullptr) return failedCall(api, nullptr, setup.address, "connecting");
  for (const VirtuoseStep& step : steps) {
    if (step.run(api, context) == 0) continue;
    const std::string call = std::string(step.call) + "(" + step.value + ")";
    const Error error = failedCall(api, context, setup.address, call);
    closeVirtuose(api, context);
    return error;
  }
  return context;
}

Result<VirtContext> openVirtuose(const VirtuoseApi& api, const VirtuoseSetup& setup) {
  return openVirtuose(api, setup, virtuoseSteps(setup));
}

void closeVirtuose(const VirtuoseApi& api, VirtContext context) noexcept {
  if (context == nullptr) return;
  if (!planted(PlantedBug::kNoLastCommand)) setZeroForce(api, context);
  api.virtSetPowerOn(context, 0);
  api.virtClose(context);
}

std::vector<FoundDevice> listVirtuose(const std::string& address, const std::string& library) {
  FoundDevice found{"virtuose:" + address, "Virtuose 6D Desktop", "", false};
  const auto api = library.empty() ? loadVirtuoseApi() : loadVirtuoseApi(library);
  if (!api.ok()) {
    found.state = api.error().message;
    return {found};
  }
  VirtContext context = api->virtOpen(address.c_str());
  if (context == nullptr) {
    const int code = api->virtGetErrorCode(nullptr);
    if (const std::string version = virtuoseLibraryVersion(*api); !version.empty())
      found.name += ", library " + version;
    found.state =
        "no device answers at " + address + ": " + virtuoseErrorText(code, api->virtGetErrorMessage(code));
    return {found};
  }
  found.name += versionText(*api, context);
  found.state = stateOf(*api, context);
  found.ready = found.state.empty();
  if (found.ready)
    found.state = "it answers; press its power switch and hold the handle when the lesson begins";
  api->virtClose(context);
  return {found};
}

}  // namespace needlelab
