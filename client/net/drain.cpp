#include "client/net/drain.h"

#include <algorithm>

#include "common/base/clock.h"

namespace needlelab {

DrainEnd drain(Uplink& uplink, const DrainPatience& patience, const std::function<bool()>& stopped) {
  uplink.wake();
  const std::int64_t began_ns = steadyNowNs();
  const auto seconds = [](std::int64_t ns) {
    return std::chrono::duration<double>(1e-9 * static_cast<double>(ns));
  };
  while (!uplink.waitUntilDone(std::chrono::milliseconds(20))) {
    const UplinkState state = uplink.state();
    const std::int64_t now_ns = steadyNowNs();
    if (state.denied) return DrainEnd::kDenied;
    if (stopped()) return DrainEnd::kStopped;
    if (seconds(now_ns - began_ns) >= patience.whole) return DrainEnd::kTimeOver;
    if (state.connected) continue;
    // an attempt has failed already, so this is no server that is about to answer for the first time
    const auto away = seconds(now_ns - state.away_since_ns);
    const bool never = state.connections == 0 && !state.error.empty() && away >= patience.never_connected;
    const bool long_ago = state.connections > 0 && away >= patience.long_away;
    // one moment more: it may have come back just now
    if ((never || long_ago) &&
        seconds(now_ns - began_ns) >= std::min(patience.whole, patience.never_connected / 2))
      return DrainEnd::kAway;
  }
  return DrainEnd::kDone;
}

std::string drainText(DrainEnd end, const UplinkState& state) {
  switch (end) {
    case DrainEnd::kDone:
    case DrainEnd::kDenied:  // was said when it happened
      return {};
    case DrainEnd::kAway:
      return "not connected (" + state.error +
             "); the spool keeps everything, the next start with --server sends it";
    case DrainEnd::kTimeOver:
      return std::to_string(state.chunks_left) +
             " chunks could not be sent within --drain; the spool keeps them, the next start with --server "
             "sends them";
    case DrainEnd::kStopped:
      return "not waiting for the server any longer; the spool keeps everything";
  }
  return {};
}

}  // namespace needlelab
