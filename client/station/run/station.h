/// The station's shared state between lessons (spool and server link), and a whole lesson without a window.
#pragma once

#include <csignal>
#include <memory>
#include <string>

#include "client/net/spool_outlook.h"
#include "client/net/uplink.h"
#include "client/station/run/lesson_observer.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/run/options.h"
#include "client/station/run/signals.h"
#include "common/base/time_source.h"

namespace needlelab {

/// Thread: the thread that runs the lessons constructs, opens and destroys it; any calls `requests`.
class StationHome {
 public:
  /// All must outlive it.
  StationHome(const StationOptions& options, LessonObserver& observer, TimeSource& time = machineTime())
      : observer_(observer), options_(options), time_(time), station_(options.station) {}

  /// Call first. Errors: from Spool::open.
  Status openSpool();
  /// Call second. Reads the station's name from the key; with a server, starts the link. Errors: from the key
  /// and the CA file; an absent server is not an error.
  Status connect();
  /// Closes the link to the server. Repeated calls are allowed.
  void close();

  [[nodiscard]] Spool& spool() { return *spool_; }
  [[nodiscard]] SpoolGuard& guard() { return *guard_; }
  /// Null without a server.
  [[nodiscard]] Uplink* uplink() { return uplink_.get(); }
  [[nodiscard]] const std::string& station() const { return station_; }
  [[nodiscard]] LessonObserver& observer() { return observer_; }
  [[nodiscard]] LessonRequests& requests() { return requests_; }
  /// Of all of the station's threads but the haptic one.
  [[nodiscard]] TimeSource& time() { return time_; }

 private:
  UplinkEvents events();

  LessonObserver& observer_;
  const StationOptions& options_;
  TimeSource& time_;
  std::string station_;
  LessonRequests requests_;
  std::unique_ptr<Spool> spool_;
  std::unique_ptr<SpoolGuard> guard_;
  std::unique_ptr<Uplink> uplink_;  // last: its events use the others
};

/// Runs one lesson without a window and prints its summary. `stop_signals`: from blockStopSignals; the first
/// signal ends the lesson properly; the second also ends the wait for the server. Returns the program's exit
/// code (common/base/program.h). Thread: main. Starts and joins all others.
int runStation(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
