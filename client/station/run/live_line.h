/// One line for the person at the station while the lesson runs: on a terminal rewritten in place every
/// second, elsewhere printed every ten.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "common/base/histogram.h"
#include "common/gesture/sample.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// What the exercise lets the trainee see while it practises.
struct LiveAids {
  bool phase = true, layer = true, depth = true, force = true;
};

/// What the line shows: gathered by its owner from what the loop publishes, never from the loop itself.
struct LiveView {
  double time_s = 0;     ///< since the lesson began
  GestureSample sample;  ///< ServoLoop::latest
  std::string layer;     ///< its name; empty: none, or a number is enough
  Fault fault = Fault::kNone;
  std::string hold;  ///< why there is no force although there is no fault; empty = there is
  LatencyQuantiles wakeup;
  std::uint64_t missed_ticks = 0;
  std::string spool, server;  ///< how they are, in few words
  LiveAids aids = {};
};

/// "1:07  INSERTING muscle 23.4 mm 1.52 N | wake-up 25/46/452 µs, 0 missed | spool 3 | server"; a fault or a
/// hold stands first and in capitals.
std::string liveText(const LiveView& view);

/// `text` cut to at most `width` characters of a terminal (UTF-8, each one column wide).
std::string cutToWidth(const std::string& text, std::size_t width);

/// Thread: any; what is said and what is shown never mix.
class LiveLine {
 public:
  /// Writes to the file descriptor, e.g. STDERR_FILENO.
  explicit LiveLine(int file);

  /// A message of its own line; the live line moves below it.
  void say(const std::string& message);
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

}  // namespace needlelab
