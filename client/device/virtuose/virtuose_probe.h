/// What there is of a Virtuose at this computer, for `--list-devices`.
#pragma once

#include <string>
#include <vector>

#include "client/device/found_device.h"
#include "client/device/virtuose/virtuose_link.h"

namespace needlelab {

/// One entry: whether the vendor's library is there and of which version, whether a device answers at
/// `address`, and how it is. Connects and asks; gives no power and no force, but takes the device's only
/// connection for a moment. `library` empty: as loadVirtuoseApi().
std::vector<FoundDevice> listVirtuose(const std::string& address = kVirtuoseAddress,
                                      const std::string& library = {});

}  // namespace needlelab
