/// Who looks on at lessons beside the terminal: the window. Without one nobody does.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand_plan.h"
#include "client/device/hand_steering.h"
#include "client/net/spool_writer.h"
#include "client/net/uplink.h"
#include "client/station/run/gesture_curve.h"
#include "client/station/run/lesson.h"
#include "client/station/run/summary.h"
#include "common/base/histogram.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// A lesson that begins: everything that does not change any more.
struct LessonBeginning {
  std::string session_id, trainee;
  StationLesson lesson;
  Pose X_WL;
  double rate_hz = 1000;
  double time_limit_s = 0;  ///< 0: none
  DeviceInfo device;
  std::vector<std::string> device_notes;   ///< what it cannot do and was done instead
  std::shared_ptr<HandSteering> steering;  ///< of a hand that waits to be steered; null otherwise
  HandAim hand_start;                      ///< … where it waits
};

/// How loop and device stand, 20 times a second.
struct LessonStanding {
  double time_s = 0;  ///< since the loop's first tick
  Fault fault = Fault::kNone;
  bool cause_lasts = false, acknowledged = false;
  bool waits = false;           ///< a fault waits for an acknowledgement; else it ends the lesson
  std::uint32_t condition = 0;  ///< DeviceFlag bits
  std::string device_words;     ///< Device::status
  std::string hold;             ///< why there is no force although there is no fault
  LatencyQuantiles wakeup;
  std::uint64_t missed_ticks = 0;
  std::string spool, server;  ///< in few words, as on the live line
  std::string room;           ///< of the spool; empty unless it is urgent
};

/// A lesson that is over, as far as it is known by now: the server's word may come later.
struct LessonOutcome {
  StationSummary summary;
  Status stored;  ///< whether the recording is safe
  GestureCurve curve;
};

/// Called by the station's threads, never by the haptic one; none of it may wait for anything but a short
/// lock.
class LessonAudience {
 public:
  virtual ~LessonAudience() = default;
  /// What also stands on the terminal, for a person. Thread: any.
  virtual void said(const std::string& line) { static_cast<void>(line); }
  /// "fetching the exercise", …: a lesson is being prepared. Thread: the lesson's, as for what follows.
  virtual void preparing(const std::string& what) { static_cast<void>(what); }
  virtual void began(std::shared_ptr<const LessonBeginning> beginning) { static_cast<void>(beginning); }
  virtual void stands(const LessonStanding& standing) { static_cast<void>(standing); }
  /// An instructor changed what is shown.
  virtual void aids(const ChosenAids& chosen) { static_cast<void>(chosen); }
  /// The loop has ended; what was recorded is being put away.
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
