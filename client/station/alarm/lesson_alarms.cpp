#include "client/station/alarm/lesson_alarms.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace needlelab {

void LessonAlarms::take(const GestureAlarms& gesture) {
  std::vector<ActiveAlarm> now = gesture.now();
  std::vector<AlarmCount> counts = gesture.counts();
  const std::scoped_lock lock(mutex_);
  gesture_ = std::move(now);
  counts_ = std::move(counts);
}

std::vector<AlarmCount> LessonAlarms::counts() const {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

std::vector<ActiveAlarm> LessonAlarms::update(const AlarmFacts& facts) {
  std::vector<ActiveAlarm> now;
  std::vector<AlarmCount> counts;
  {
    const std::scoped_lock lock(mutex_);
    if (facts.gesture_shown) now = gesture_;
    counts = counts_;
  }
  if (facts.fault != Fault::kNone) now.push_back({Alarm::kFault, faultText(facts.fault)});
  if (facts.fault == Fault::kNone && !facts.hold.empty()) now.push_back({Alarm::kDevice, facts.hold});
  if (facts.left_s && *facts.left_s < kTimeAlarm_s)
    now.push_back({Alarm::kTime, fmt::format("{:.0f} s left", std::ceil(*facts.left_s))});
  std::stable_sort(now.begin(), now.end(),
                   [](const ActiveAlarm& a, const ActiveAlarm& b) { return a.alarm < b.alarm; });
  soundNew(now, counts, facts.gesture_shown);
  return now;
}

// also sounds an alarm that came and went between two calls
void LessonAlarms::soundNew(const std::vector<ActiveAlarm>& now, const std::vector<AlarmCount>& counts,
                            bool gesture_shown) {
  bool any = false, danger = false;
  const auto begins = [&](const AlarmKind& kind) {
    if (choice_ == ToneChoice::kOff || (choice_ == ToneChoice::kDanger && !kind.danger)) return;
    any = true;
    danger = danger || kind.danger;
  };
  for (const AlarmKind& kind : alarmKinds()) {
    const auto at = static_cast<std::size_t>(kind.alarm);
    if (kind.of_gesture) {
      const auto count = std::find_if(counts.begin(), counts.end(),
                                      [&](const AlarmCount& c) { return c.alarm == kind.alarm; });
      if (count == counts.end()) continue;
      if (gesture_shown && count->begun > sounded_[at]) begins(kind);
      sounded_[at] = count->begun;
      continue;
    }
    const bool lasts = std::any_of(now.begin(), now.end(),
                                   [&](const ActiveAlarm& alarm) { return alarm.alarm == kind.alarm; });
    if (lasts && !lasted_[at]) begins(kind);
    lasted_[at] = lasts;
  }
  if (any) tone_.sound(danger);
}

}  // namespace needlelab
