/// The lesson thread's work while the loop runs: watches loop, device, requests and signals.
#pragma once

#include <csignal>
#include <cstdint>
#include <optional>

#include "client/device/device.h"
#include "client/device/turns.h"
#include "client/net/spool/spool_writer.h"
#include "client/station/alarm/lesson_alarms.h"
#include "client/station/run/io/live_line.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/run/loop/fault_watch.h"
#include "client/station/run/loop/servo_loop.h"
#include "client/station/run/station.h"

namespace needlelab {

/// What a LoopWatch observes. All of it must outlive the watch.
struct WatchedLesson {
  StationHome& home;
  const StationOptions& options;
  const StationLesson& lesson;
  ServoLoop& loop;
  const SpoolWriter& writer;
  const DeviceMaintenance& maintenance;
  FaultPolicy on_fault = FaultPolicy::kEnd;
  LessonAlarms& alarms;
  double limit_s = 0;             ///< time limit of the lesson; 0: none
  bool limit_from_start = false;  ///< it counts from the first tick; else from the needle's first contact
};

/// Looks every 50 ms of the home's time: first 50 ms after the beginning, for the last time after the loop
/// ended. A look
/// - stops the loop on a stop signal, or at a person's or an instructor's request;
/// - acknowledges a reported fault when a person pressed Enter or a button of the window, or sent SIGUSR1;
/// - reports loop, device, disk and alarms to the person, the observer and the server.
/// A signal triggers the next look early. Thread: one, the lesson's.
class LoopWatch final : public Turns {
 public:
  /// `stop_signals`: from blockStopSignals. `enter` must outlive the watch.
  LoopWatch(const WatchedLesson& watched, const sigset_t& stop_signals, EnterKey& enter);

  /// Looks until the loop has ended.
  void run();
  /// One look of `run`; the first call only sets the time.
  std::optional<std::int64_t> turn() noexcept override;
  void rest(std::int64_t until_ns) noexcept override;

  /// A stop signal came: the program must end, not only the lesson.
  [[nodiscard]] bool interrupted() const { return interrupted_; }
  /// The first request that stopped the loop.
  [[nodiscard]] const std::optional<StopCause>& stopped() const { return stopped_; }

 private:
  void look();
  void handleRequests();
  void handleFaults(WatchedState& state);
  void showStatus(const WatchedState& state);
  void reportToServer();

  WatchedLesson watched_;
  sigset_t signals_;  // also SIGUSR1
  EnterKey& enter_;
  FaultWatch faults_;
  LiveViewer viewer_;
  LiveAids aids_;
  bool alarms_shown_;
  bool begun_ = false;
  int signal_ = 0;  // the signal that ended the last rest; 0: none
  bool interrupted_ = false;
  std::optional<StopCause> stopped_;
};

}  // namespace needlelab
