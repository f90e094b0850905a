/// Opens and closes the connection to a Virtuose in the vendor's order, and lists it for `--list-devices`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/virtuose/virtuose_api.h"
#include "common/base/result.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// Default address of the vendor's service on the device's computer.
inline constexpr const char* kVirtuoseAddress = "127.0.0.1#53210";

/// Parses the text after `virtuose:` on the command line: HOST#PORT, or HOST alone, or nothing. Errors
/// (kInvalidInput) name the text and the allowed form.
Result<std::string> virtuoseAddress(const std::string& text);

/// Settings of a connection.
struct VirtuoseSetup {
  std::string address = kVirtuoseAddress;
  double rate_hz = 1000;  ///< of the loop, [kMinRateHz, 1000]: the device allows at most one exchange per ms
  DeviceLimits limits;    ///< peak force and torque: the device itself saturates there too
  double timeout_s = 0.05;  ///< a longer call means that the link is lost, [0.005, 1]
};

/// One call of the set-up.
struct VirtuoseStep {
  const char* call = "";  ///< the vendor's name, for messages
  std::string value;      ///< for messages
  std::function<int(const VirtuoseApi&, VirtContext)> run;
};

/// The vendor's order: indexing, force and speed factor, time step, base and observation frame (identity: W
/// is the device's base), command type; then saturation, time-out, zero force, and permission of power.
std::vector<VirtuoseStep> virtuoseSteps(const VirtuoseSetup& setup);

/// Connects and runs `steps`. When a step fails, undoes everything (closeVirtuose); the error names the step,
/// the error's number, its meaning and advice. Errors: kInvalidInput (rate, time-out), kUnavailable (no
/// answer), kVersion, kFailed. Blocks as long as the vendor's library does.
Result<VirtContext> openVirtuose(const VirtuoseApi& api, const VirtuoseSetup& setup,
                                 const std::vector<VirtuoseStep>& steps);
Result<VirtContext> openVirtuose(const VirtuoseApi& api, const VirtuoseSetup& setup);

/// Sends zero force, turns the power off, then closes. Ignores failures on the way: the device's own watchdog
/// removes the force 2 s after the last command.
void closeVirtuose(const VirtuoseApi& api, VirtContext context) noexcept;

/// Returns one entry: whether the vendor's library is installed, its version, whether a device answers at
/// `address`, and its state. Connects and queries; enables no power and no force, but uses the device's only
/// connection for a moment. `library` empty: as loadVirtuoseApi().
std::vector<FoundDevice> listVirtuose(const std::string& address = kVirtuoseAddress,
                                      const std::string& library = {});

}  // namespace needlelab
