/// `needlelab-station --list-devices`: the values of --device that work on this computer, now.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/device.h"
#include "client/station/run/options.h"

namespace needlelab {

/// One kind of device, and how to look for it. `look` may take long, and may hang: it runs on a thread of its
/// own.
struct DeviceLister {
  std::string spec;  ///< of the kind, for the entry when `look` does not come back
  std::string name;
  std::function<std::vector<FoundDevice>()> look;
};

/// One for each of deviceKinds().
std::vector<DeviceLister> deviceListers();

/// The listers' results, in their order.
struct DeviceList {
  std::vector<FoundDevice> devices;
  bool all_answered = true;  ///< false: a thread is still looking; end the program by std::_Exit
};
/// Asks all of them at once and waits at most `patience` in all: a kind that did not answer, or threw, gets
/// an entry that says so.
DeviceList listDevices(const std::vector<DeviceLister>& listers, std::chrono::milliseconds patience);

/// A table for a person.
std::string deviceListText(const std::vector<FoundDevice>& devices);
/// {"version", "machine", "rows": [{"device", "name", "ready", "state"}]}
std::string deviceListJson(const std::vector<FoundDevice>& devices);

/// `--list-devices`. The exit code is 0, also without any device.
int runListDevices(const StationOptions& options);

}  // namespace needlelab
