/// The instructor in a terminal: live lines for a station or session, an overview of all stations, or a
/// replay.
#pragma once

#include <cstdint>
#include <functional>
#include <ostream>

#include "client/instructor/terminal/options.h"
#include "client/net/blocking_client.h"
#include "common/base/result.h"
#include "common/base/time_source.h"

namespace needlelab {

/// Data shared by the three modes.
struct HeadlessRun {
  const InstructorOptions& options;
  BlockingClient& client;
  std::ostream& out;
  std::function<bool()> stop;        ///< Ctrl-C
  std::int64_t end_ns;               ///< --seconds, by the client's clock
  TimeSource& time = machineTime();  ///< of a replay

  [[nodiscard]] bool over() const { return stop() || client.nowNs() >= end_ns; }
  /// --server names several servers: notes then say which one it is.
  [[nodiscard]] bool several() const;
  void line(const std::string& text) const;
  void note(const std::string& text) const;
  /// Reconnects, to any of the servers; prints a note before and after.
  Status recover(const Error& why) const;
};

/// Prints lines until --seconds or Ctrl-C, then the summary. The client must be connected. Errors: kNotFound
/// (no such session), kCorrupt (a stored chunk), kDenied, kUnavailable (connection lost, and the time is
/// over).
Status runHeadless(const HeadlessRun& run);

/// Prints live lines for --station or --session.
Status watchLive(const HeadlessRun& run);  // watch.cpp
/// Prints lines for the stored --session at its recorded speed.
Status replaySession(const HeadlessRun& run);  // replay.cpp

}  // namespace needlelab
