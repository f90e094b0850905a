/// What the live line shows of a lesson, gathered from what the loop, the spool and the uplink publish.
#pragma once

#include <string>
#include <vector>

#include "client/net/spool_writer.h"
#include "client/net/uplink.h"
#include "client/station/run/live_line.h"
#include "client/station/run/servo_loop.h"

namespace needlelab {

/// Why there is no force although there is no fault: DeviceFlag bits and kFlagStartedInside in words; empty
/// when there is.
std::string holdText(std::uint32_t flags);
/// "recording", or what the disk refuses.
std::string spoolText(const SpoolWriterCounts& counts);
/// "server", "server, 12 chunks behind", "server away, 12 chunks wait", "server refuses".
std::string serverText(const UplinkState& state);

/// Thread: one, the only one that calls ServoLoop::latest.
class LiveViewer {
 public:
  /// `layers`: their names by index. `loop` must outlive it.
  LiveViewer(ServoLoop& loop, double rate_hz, std::vector<std::string> layers)
      : loop_(loop), period_s_(1 / rate_hz), layers_(std::move(layers)) {}

  [[nodiscard]] LiveView look(std::string spool, std::string server);

 private:
  ServoLoop& loop_;
  double period_s_;
  std::vector<std::string> layers_;
  GestureSample sample_;
};

}  // namespace needlelab
