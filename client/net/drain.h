/// Waiting at the end until the server has everything, no longer than that makes sense.
#pragma once

#include <chrono>
#include <functional>

#include "client/net/uplink.h"

namespace needlelab {

struct DrainPatience {
  std::chrono::duration<double> whole{10};           ///< in all (--drain)
  std::chrono::duration<double> never_connected{2};  ///< when no server was there in this whole run
  std::chrono::duration<double> long_away{30};       ///< … or none since so long
};

enum class DrainEnd : std::uint8_t {
  kDone,      ///< the server has closed or refused every session
  kAway,      ///< no server for so long that waiting makes no sense
  kTimeOver,  ///< connected, or lost a moment ago, but not done in time
  kStopped,   ///< by the caller
  kDenied,    ///< the server refuses us
};

/// Asks `stopped` about 50 times a second. Thread: any but the uplink's.
DrainEnd drain(Uplink& uplink, const DrainPatience& patience, const std::function<bool()>& stopped);

/// For a person; empty when there is nothing to say.
std::string drainText(DrainEnd end, const UplinkState& state);

}  // namespace needlelab
