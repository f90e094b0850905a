/// Falcons on this computer's USB, through libusb.
#pragma once

#include <memory>

#include "client/device/falcon/falcon_link.h"

namespace needlelab::falcon {

/// libusb is started at its first use. The bus must outlive its links.
std::unique_ptr<FalconBus> makeUsbBus();

}  // namespace needlelab::falcon
