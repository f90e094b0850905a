/// Opening and closing the connection to a Virtuose, in the vendor's order, and what `--list-devices` says of
/// it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/virtuose/virtuose_api.h"
#include "common/base/result.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// Where the vendor's service listens on the computer that the device is plugged into.
inline constexpr const char* kVirtuoseAddress = "127.0.0.1#53210";

/// Parses the text after `virtuose:` on the command line: HOST#PORT, or HOST alone, or nothing. Errors
/// (kInvalidInput) name the text and the allowed form.
Result<std::string> virtuoseAddress(const std::string& text);

/// Settings of a connection.
struct VirtuoseSetup {
  std::string address = kVirtuoseAddress;
  double rate_hz = 1000;    ///< of the loop, [kMinRateHz, 1000]: the device takes one exchange per ms at most
  DeviceLimits limits;      ///< peak force and torque: the device itself saturates there, too
  double timeout_s = 0.05;  ///< a call that takes longer means that the link is lost, [0.005, 1]
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

/// Connects, takes `steps`; a step that fails undoes all (closeVirtuose) and is named in the error, with the
/// error's number, its meaning and advice. Errors: kInvalidInput (rate, time-out), kUnavailable (nothing
/// answers), kVersion, kFailed. Blocks for as long as the vendor's library does.
Result<VirtContext> openVirtuose(const VirtuoseApi& api, const VirtuoseSetup& setup,
                                 const std::vector<VirtuoseStep>& steps);
Result<VirtContext> openVirtuose(const VirtuoseApi& api, const VirtuoseSetup& setup);

/// Zero force, no power, then lets go. Failures on the way are ignored: the device's own watchdog takes
/// the force away 2 s after the last command.
void closeVirtuose(const VirtuoseApi& api, VirtContext context) noexcept;

/// One entry: whether the vendor's library is there and of which version, whether a device answers at
/// `address`, and how it is. Connects and asks; gives no power and no force, but takes the device's only
/// connection for a moment. `library` empty: as loadVirtuoseApi().
std::vector<FoundDevice> listVirtuose(const std::string& address = kVirtuoseAddress,
                                      const std::string& library = {});

}  // namespace needlelab
