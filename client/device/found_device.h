/// What `--list-devices` has to say of one device, or of one way to reach a device.
#pragma once

#include <string>
#include <vector>

namespace needlelab {

/// Each kind of device has a function that gives a list of these: `listVirtuose`, `listFalcons`. They move
/// nothing and give no force.
struct FoundDevice {
  std::string spec;    ///< what to give to `--device`, e.g. "virtuose:127.0.0.1#53210"
  std::string name;    ///< for a person, e.g. "Virtuose 6D Desktop, library 3.98"
  std::string state;   ///< words for a person: how it is and, unless it is ready, what to do
  bool ready = false;  ///< `--device spec` would work now
};

}  // namespace needlelab
