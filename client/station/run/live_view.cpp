#include "client/station/run/live_view.h"

#include <utility>

#include "common/haptics/device_condition.h"
#include "common/haptics/engine.h"

namespace needlelab {

std::string holdText(std::uint32_t flags) {
  // the one that a person can do most about
  if ((flags & kDeviceReleased) != 0) return "nobody holds the handle";
  if ((flags & kDevicePowerOff) != 0) return "the motors have no power";
  if ((flags & kDeviceNotReady) != 0) return "the device is not ready yet";
  if ((flags & kFlagStartedInside) != 0) return "the needle began in the tissue, take it out once";
  return {};
}

std::string spoolText(const SpoolWriterCounts& counts) {
  return counts.disk_error.empty() ? "recording" : "NOT RECORDING: " + counts.disk_error;
}

std::string serverText(const UplinkState& state) {
  const std::string chunks =
      std::to_string(state.chunks_left) + (state.chunks_left == 1 ? " chunk" : " chunks");
  if (state.denied) return "server refuses";
  if (!state.connected) return "server away, " + chunks + (state.chunks_left == 1 ? " waits" : " wait");
  // the chunk that is being filled and the one under way are always there
  return state.chunks_left <= 2 ? "server" : "server, " + chunks + " behind";
}

LiveView LiveViewer::look(std::string spool, std::string server) {
  LiveView view;
  static_cast<void>(loop_.latest(sample_));
  view.sample = sample_;
  view.time_s = static_cast<double>(sample_.tick) * period_s_;
  if (sample_.layer >= 0 && static_cast<std::size_t>(sample_.layer) < layers_.size())
    view.layer = layers_[static_cast<std::size_t>(sample_.layer)];
  view.fault = loop_.fault();
  view.hold = holdText(loop_.condition() | (sample_.flags & kFlagStartedInside));
  view.wakeup = loop_.stats().wakeup.quantiles();
  view.missed_ticks = loop_.missedTicks();
  view.spool = std::move(spool);
  view.server = std::move(server);
  return view;
}

}  // namespace needlelab
