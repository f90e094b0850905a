/// The station between lessons (its spool and the link to its server), and a whole lesson without a window.
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

namespace needlelab {

/// Thread: made, opened and destroyed by the thread that runs the lessons; `requests` by any.
class StationHome {
 public:
  /// Both must outlive it.
  StationHome(const StationOptions& options, LessonObserver& observer)
      : observer_(observer), options_(options), station_(options.station) {}

  /// First. Errors: as Spool::open.
  Status openSpool();
  /// Second: the key's name; with a server, the link to it. Errors: of the key and the CA file; an absent
  /// server is not an error.
  Status connect();
  /// Closes the link to the server. May be called twice.
  void close();

  [[nodiscard]] Spool& spool() { return *spool_; }
  [[nodiscard]] SpoolGuard& guard() { return *guard_; }
  /// Null without a server.
  [[nodiscard]] Uplink* uplink() { return uplink_.get(); }
  [[nodiscard]] const std::string& station() const { return station_; }
  [[nodiscard]] LessonObserver& observer() { return observer_; }
  [[nodiscard]] LessonRequests& requests() { return requests_; }

 private:
  UplinkEvents events();

  LessonObserver& observer_;
  const StationOptions& options_;
  std::string station_;
  LessonRequests requests_;
  std::unique_ptr<Spool> spool_;
  std::unique_ptr<SpoolGuard> guard_;
  std::unique_ptr<Uplink> uplink_;  // last: its events use the others
};

/// Runs one lesson without a window and prints its summary. `stop_signals`: from blockStopSignals; the first
/// such signal ends the lesson properly, the second one does not wait for the server any more. Returns the
/// program's exit code (common/base/program.h). Thread: main; starts and joins all others.
int runStation(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
