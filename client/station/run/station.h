/// The station's shared state between lessons: spool and server link.
#pragma once

#include <memory>
#include <string>

#include "client/net/spool/spool_outlook.h"
#include "client/net/uplink/uplink.h"
#include "client/station/run/io/options.h"
#include "client/station/run/lesson_observer.h"
#include "client/station/run/lesson_requests.h"
#include "common/base/time/time_source.h"

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
  /// The time of all the station's threads except the haptic one.
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

}  // namespace needlelab
