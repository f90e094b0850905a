/// `needlelab-station --list-devices`: lists the values of --device that work on this computer now.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/device.h"
#include "client/station/run/io/options.h"
#include "common/base/time/time_source.h"

namespace needlelab {

/// One kind of device and its search function. `look` may be slow or hang, so it runs on its own thread.
struct DeviceLister {
  std::string spec;  ///< the kind's name, for the entry if `look` does not return
  std::string name;
  std::function<std::vector<FoundDevice>()> look;
};

/// Returns one lister for each of deviceKinds().
std::vector<DeviceLister> deviceListers();

/// The results, in the order of the listers.
struct DeviceList {
  std::vector<FoundDevice> devices;
  bool all_answered = true;  ///< false: a thread is still looking; end the program by endProgram
};
/// Runs all listers in parallel and waits at most `patience` in total. A kind that did not answer, or threw,
/// gets an entry that says so.
DeviceList listDevices(const std::vector<DeviceLister>& listers, std::chrono::milliseconds patience,
                       TimeSource& time = machineTime());

/// Returns a table for a person.
std::string deviceListText(const std::vector<FoundDevice>& devices);
/// {"version", "machine", "rows": [{"device", "name", "ready", "state"}]}
std::string deviceListJson(const std::vector<FoundDevice>& devices);

/// Runs `--list-devices`. The exit code is 0, even without any device.
int runListDevices(const StationOptions& options);

}  // namespace needlelab
