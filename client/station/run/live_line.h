/// One line for the person at the station while the lesson runs: on a terminal rewritten in place every
/// second, elsewhere printed every ten. What it shows is gathered from what the loop, the spool and the
/// uplink publish.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/net/spool_writer.h"
#include "client/net/uplink.h"
#include "client/station/run/servo_loop.h"
#include "common/base/histogram.h"
#include "common/gesture/sample.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// The figures that the exercise shows to the trainee.
struct LiveAids {
  bool phase = true, layer = true, depth = true, force = true;
};

/// The contents of the line: gathered from the loop's published values, never from the loop itself.
struct LiveView {
  double time_s = 0;     ///< since the lesson began
  GestureSample sample;  ///< ServoLoop::latest
  std::string layer;     ///< its name; empty: none, or a number is enough
  Fault fault = Fault::kNone;
  std::string hold;  ///< why there is no force although there is no fault; empty = there is
  LatencyQuantiles wakeup;
  std::uint64_t missed_ticks = 0;
  std::string spool, server;  ///< their state, in brief
  LiveAids aids = {};
};

/// "1:07  INSERTING muscle 23.4 mm 1.52 N | wake-up 25/46/452 µs, 0 missed | spool 3 | server"; a fault or a
/// hold stands first and in capitals.
std::string liveText(const LiveView& view);

/// `text` cut to at most `width` characters of a terminal (UTF-8, each one column wide).
std::string cutToWidth(const std::string& text, std::size_t width);

/// Thread: any; messages and the live line never mix.
class LiveLine {
 public:
  /// Writes to the file descriptor, e.g. STDERR_FILENO.
  explicit LiveLine(int file);

  /// A message of its own line; the live line moves below it.
  void printMessage(const std::string& message);
  /// Is it time (again)? On a terminal at once, elsewhere 10 s after the first question. `now_ns` is
  /// steadyNowNs.
  [[nodiscard]] bool due(std::int64_t now_ns);
  void show(const LiveView& view, std::int64_t now_ns);
  /// The lesson is over: nothing is rewritten any more.
  void end();

 private:
  void write(const std::string& text) const;

  const int file_;
  const bool terminal_;
  std::mutex mutex_;
  std::string shown_;  // on the terminal's last line now; empty = nothing
  std::optional<std::int64_t> next_ns_;
};

/// Text for DeviceFlag bits and kFlagStartedInside: why there is no force although there is no fault; empty
/// when there is force.
std::string holdText(std::uint32_t flags);
/// "recording", or the disk's error.
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
