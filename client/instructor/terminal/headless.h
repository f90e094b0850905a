/// The instructor in a terminal: live lines for a station or session, an overview of all stations, or a
/// replay.
#pragma once

#include <cstdint>
#include <functional>
#include <ostream>
#include <string>

#include "client/instructor/terminal/options.h"
#include "client/instructor/terminal/update_line.h"
#include "client/net/link/blocking_client.h"
#include "common/base/result.h"
#include "common/base/time/time_source.h"

namespace needlelab {

/// Data shared by the three modes.
struct HeadlessRun {
  const InstructorOptions& options;
  BlockingClient& client;
  std::ostream& out;
  std::function<bool()> stop;        ///< Ctrl-C was pressed
  std::int64_t end_ns;               ///< end of --seconds, by the client's clock
  TimeSource& time = machineTime();  ///< of a replay

  [[nodiscard]] bool over() const { return stop() || client.nowNs() >= end_ns; }
  void line(const std::string& text) const { out << text << '\n' << std::flush; }
  void update(const Update& update) const { line(options.json ? jsonLine(update) : textLine(update)); }
  void note(const std::string& text) const { line(noteLine(text, options.json)); }
};

/// Prints lines until --seconds or Ctrl-C, then the summary. The client must be connected. Errors: kNotFound
/// (no such session), kCorrupt (a stored chunk), kDenied, kUnavailable (connection lost and the time is
/// over).
Status runHeadless(const HeadlessRun& run);

/// Reconnects to any of the servers; prints a note before and after.
Status recover(const HeadlessRun& run, const Error& why);

/// Prints lines for the stored --session at its recorded speed.
Status replaySession(const HeadlessRun& run);  // replay.cpp

}  // namespace needlelab
