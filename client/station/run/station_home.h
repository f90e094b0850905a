/// What a station keeps from one lesson to the next: its spool, and the link to its server.
#pragma once

#include <memory>
#include <string>

#include "client/net/spool_outlook.h"
#include "client/net/uplink.h"
#include "client/station/run/lesson_audience.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/run/options.h"

namespace needlelab {

/// Thread: made, opened and destroyed by the thread that runs the lessons; `requests` by any.
class StationHome {
 public:
  /// Both must outlive it.
  StationHome(const StationOptions& options, LessonAudience& audience)
      : audience_(audience), options_(options), station_(options.station) {}

  /// First. Errors: as Spool::open.
  Status openSpool();
  /// Second: the key's name; with a server, the link to it. Errors: of the key and the CA file; a server that
  /// is away is none.
  Status connect();
  /// Says goodbye to the server. May be called twice.
  void close();

  [[nodiscard]] Spool& spool() { return *spool_; }
  [[nodiscard]] SpoolGuard& guard() { return *guard_; }
  /// Null without a server.
  [[nodiscard]] Uplink* uplink() { return uplink_.get(); }
  [[nodiscard]] const std::string& station() const { return station_; }
  [[nodiscard]] LessonAudience& audience() { return audience_; }
  [[nodiscard]] LessonRequests& requests() { return requests_; }

 private:
  UplinkEvents events();

  LessonAudience& audience_;
  const StationOptions& options_;
  std::string station_;
  LessonRequests requests_;
  std::unique_ptr<Spool> spool_;
  std::unique_ptr<SpoolGuard> guard_;
  std::unique_ptr<Uplink> uplink_;  // last: its events use the others
};

}  // namespace needlelab
