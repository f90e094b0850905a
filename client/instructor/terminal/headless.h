/// The instructor in a terminal: live lines of a station or session, an overview of all stations, or a
/// replay.
#pragma once

#include <functional>
#include <ostream>

#include "client/instructor/terminal/options.h"
#include "client/net/blocking_client.h"
#include "common/base/result.h"

namespace needlelab {

/// Shared by the three of them.
struct HeadlessRun {
  const InstructorOptions& options;
  BlockingClient& client;
  std::ostream& out;
  std::function<bool()> stop;             ///< Ctrl-C
  BlockingClient::Clock::time_point end;  ///< --seconds

  [[nodiscard]] bool over() const { return stop() || BlockingClient::Clock::now() >= end; }
  void line(const std::string& text) const;
  void note(const std::string& text) const;
  /// Reconnects; says so before and after.
  Status recover(const Error& why) const;
};

/// Lines until --seconds or Ctrl-C, then the summary. The link must be connected.
/// Errors: kNotFound (no such session), kCorrupt (a stored chunk), kDenied, kUnavailable (lost, and the time
/// is over).
Status runHeadless(const HeadlessRun& run);

/// Lines of --station or --session, live.
Status watchLive(const HeadlessRun& run);  // watch.cpp
/// Lines of the stored --session, at the speed of its own clock.
Status replaySession(const HeadlessRun& run);  // replay.cpp

}  // namespace needlelab
