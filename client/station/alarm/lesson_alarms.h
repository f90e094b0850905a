/// A lesson's alarms, from gesture, loop, device and time; and the tone when one begins.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/station/alarm/tone.h"
#include "common/haptics/gate/force_gate.h"
#include "common/scoring/alarms/alarms.h"

namespace needlelab {

/// Less time left than this is an alarm.
inline constexpr double kTimeAlarm_s = 10;

/// The lesson's state, 20 times a second.
struct AlarmFacts {
  Fault fault = Fault::kNone;
  std::string hold;              ///< reason for zero force without a fault; empty: force is on
  std::optional<double> left_s;  ///< of the time limit; empty: none
  bool gesture_shown = true;     ///< the trainee has the aid ALARMS
};

class LessonAlarms {
 public:
  /// `tone` outlives this.
  LessonAlarms(Tone& tone, ToneChoice choice) : tone_(tone), choice_(choice) {}

  /// Takes the gesture's alarms so far. Thread: the spool writer's.
  void take(const GestureAlarms& gesture);
  /// Returns the present alarms, most urgent first, and sounds those that began since the last call. Omits
  /// the gesture's alarms if the trainee must not see them. Thread: the lesson's.
  std::vector<ActiveAlarm> update(const AlarmFacts& facts);
  /// The gesture's alarms, for the summary. Thread: any.
  [[nodiscard]] std::vector<AlarmCount> counts() const;

 private:
  void soundNew(const std::vector<ActiveAlarm>& now, const std::vector<AlarmCount>& counts,
                bool gesture_shown);

  Tone& tone_;
  ToneChoice choice_;
  mutable std::mutex mutex_;
  std::vector<ActiveAlarm> gesture_;  // under mutex_
  std::vector<AlarmCount> counts_;    // under mutex_
  std::vector<std::uint32_t> sounded_ = std::vector<std::uint32_t>(alarmKinds().size());
  std::vector<bool> lasted_ = std::vector<bool>(alarmKinds().size());
};

}  // namespace needlelab
