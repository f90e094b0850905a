/// The interface through which a window observes lessons. Without a window it does nothing.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand/hand.h"
#include "client/device/hand/hand_options.h"
#include "client/net/spool/spool_writer.h"
#include "client/net/uplink/uplink.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/lesson/local_score.h"
#include "client/station/run/summary.h"
#include "common/base/histogram.h"
#include "common/haptics/geometry.h"
#include "common/scoring/alarms/alarms.h"

namespace needlelab {

/// The data of a lesson that stay constant while it runs.
struct LessonBeginning {
  std::string session_id, trainee;
  bool code_unchecked = false;  ///< the trainee must be told: kCodeUnchecked
  StationLesson lesson;
  Pose X_WL;
  double rate_hz = 1000;
  DeviceInfo device;
  std::vector<std::string> device_notes;   ///< its limits, and the substitutes for them
  std::shared_ptr<HandSteering> steering;  ///< input of a steered hand; null for other hands
  PlannedInsertion way;                    ///< of the needle; a steered hand waits at its start
};

/// The state of loop and device, 20 times a second.
struct LessonStatus {
  double time_s = 0;             ///< since the loop's first tick
  std::optional<double> left_s;  ///< of the time limit; empty: none
  bool limit_runs = false;       ///< false: it begins with the needle's first contact
  Fault fault = Fault::kNone;
  bool cause_lasts = false, acknowledged = false;
  bool waits = false;           ///< true: a fault waits for an acknowledgement; false: it ends the lesson
  std::uint32_t condition = 0;  ///< DeviceFlag bits
  std::string device_status;    ///< Device::status
  std::string hold;             ///< reason for zero force without a fault
  LatencyQuantiles wakeup;
  std::uint64_t missed_ticks = 0;
  std::string spool, server;        ///< short state, as on the live line
  std::string room;                 ///< free space of the spool, or of the server; empty unless it is urgent
  std::vector<ActiveAlarm> alarms;  ///< visible to the trainee, most urgent first
};

/// The outcome of a finished lesson so far; the server's score may come later.
struct LessonOutcome {
  StationSummary summary;
  Status stored;                ///< whether the recording is stored safely
  bool code_unchecked = false;  ///< as in LessonBeginning
  GestureCurve curve;
  std::optional<NeedleLine> deepest;  ///< where the needle went deepest; none: never in tissue, or no curve
};

/// The station's threads call it, never the haptic thread. An implementation may block only on a short lock.
class LessonObserver {
 public:
  virtual ~LessonObserver() = default;
  /// A lesson is in preparation; `what` names the step, e.g. "fetching the exercise". Thread: the lesson's,
  /// as for the next functions.
  virtual void preparing(const std::string& what) { static_cast<void>(what); }
  /// An exam waits until the trainee begins it or the lesson is stopped. `terms`: examTerms(); empty: no
  /// longer.
  virtual void examWaits(const std::string& terms) { static_cast<void>(terms); }
  virtual void began(std::shared_ptr<const LessonBeginning> beginning) { static_cast<void>(beginning); }
  virtual void status(const LessonStatus& status) { static_cast<void>(status); }
  /// An instructor changed the aids.
  virtual void aids(const ChosenAids& chosen) { static_cast<void>(chosen); }
  /// The loop has ended; the station stores the recording.
  virtual void concluding() {}
  /// Thread: the uplink's.
  virtual void message(const std::string& from, const std::string& text) {
    static_cast<void>(from), static_cast<void>(text);
  }
  virtual void nextExercise(const std::string& from, const std::string& exercise_id) {
    static_cast<void>(from), static_cast<void>(exercise_id);
  }
  /// About 20 ms of samples. Thread: the spool writer's.
  virtual void piece(const SamplePiece& piece) { static_cast<void>(piece); }
};

}  // namespace needlelab
