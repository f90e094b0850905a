/// `needlelab-station --list-devices`: what can be chosen with --device on this computer, now.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/found_device.h"

namespace needlelab {

/// One kind of device, and how to look for it. `look` may take its time, and may hang: it is asked on a
/// thread of its own.
struct DeviceLister {
  std::string spec;  ///< of the kind, for the line that stands there when `look` does not come back
  std::string name;
  std::function<std::vector<FoundDevice>()> look;
};

/// Those of this program, in the order of deviceKinds().
std::vector<DeviceLister> deviceListers();

/// What the listers found, in their order.
struct DeviceList {
  std::vector<FoundDevice> devices;
  bool all_answered = true;  ///< false: a thread is still looking; end the program by std::_Exit
};
/// Asks all of them at once and waits at most `patience` in all: a kind that did not answer, or threw, gets a
/// line that says so.
DeviceList listDevices(const std::vector<DeviceLister>& listers, std::chrono::milliseconds patience);

/// A table for a person.
std::string deviceListText(const std::vector<FoundDevice>& devices);
/// {"version", "machine", "rows": [{"device", "name", "ready", "state"}]}
std::string deviceListJson(const std::vector<FoundDevice>& devices);

}  // namespace needlelab
