/// One status line for the person at the station during the lesson. A terminal rewrites it in place every
/// second; other outputs print it every 10 s. The figures come from the published values of loop, spool and
/// uplink.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/net/spool/spool_writer.h"
#include "client/net/uplink/uplink.h"
#include "client/station/run/loop/servo_loop.h"
#include "common/base/histogram.h"
#include "common/gesture/sample.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// The figures that the exercise shows to the trainee.
struct LiveAids {
  bool phase = true, layer = true, depth = true, force = true;
};

/// The line's contents. They come from the loop's published values, never from the loop itself.
struct LiveView {
  double time_s = 0;     ///< since the lesson began
  GestureSample sample;  ///< ServoLoop::latest
  std::string layer;     ///< name of the layer; empty: none, or show its number
  Fault fault = Fault::kNone;
  std::string hold;  ///< reason for zero force without a fault; empty: force is on
  LatencyQuantiles wakeup;
  std::uint64_t missed_ticks = 0;
  std::string spool, server;  ///< short state of each
  LiveAids aids = {};
};

/// "1:07  going in muscle 23.4 mm 1.52 N | wake-up 25/46/452 µs, 0 missed | spool 3 | server"; a fault or a
/// hold comes first, in capitals.
std::string liveText(const LiveView& view);

/// Returns `text` cut to at most `width` terminal characters (UTF-8, one column each).
std::string cutToWidth(const std::string& text, std::size_t width);

/// Thread: any; messages and the live line never interleave.
class LiveLine {
 public:
  /// Writes to the file descriptor, e.g. STDERR_FILENO.
  explicit LiveLine(int file);

  /// Prints a message on its own line; the live line moves below it.
  void printMessage(const std::string& message);
  /// Returns whether the line is due. The first line is due at once on a terminal, elsewhere 10 s after the
  /// first call. `now_ns` is steadyNowNs.
  [[nodiscard]] bool due(std::int64_t now_ns);
  void show(const LiveView& view, std::int64_t now_ns);
  /// Call at the lesson's end. Later calls do not rewrite the line.
  void end();

 private:
  void write(const std::string& text) const;

  const int file_;
  const bool terminal_;
  std::mutex mutex_;
  std::string shown_;  // text on the terminal's last line; empty: none
  std::optional<std::int64_t> next_ns_;
};

/// Returns the reason for zero force without a fault, from DeviceFlag bits and kFlagStartedInside; empty if
/// force is on.
std::string holdText(std::uint32_t flags);
/// Returns "recording", or the disk's error.
std::string spoolText(const SpoolWriterCounts& counts);
/// Returns e.g. "server", "server, 12 chunks behind", "server away, 12 chunks wait", "server refuses".
std::string serverText(const UplinkState& state);

/// Thread: one. No other thread may call ServoLoop::latest.
class LiveViewer {
 public:
  /// `layers`: layer names by index. `loop` must outlive it.
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
