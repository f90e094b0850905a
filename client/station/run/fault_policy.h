/// What the station does in FAULT.
#pragma once

#include <cstdint>

namespace needlelab {

/// What the loop does once the gate has taken the force away.
enum class FaultPolicy : std::uint8_t {
  kEnd,   ///< it ends 50 ms later
  kWait,  ///< it goes on without force, reading the device and recording, until `acknowledge` and the gate's
          ///< own conditions (the cause is over, the tip is outside) let the force fade in again
};

}  // namespace needlelab
