/// An alarm in a station's status.
#pragma once

#include <cstdint>
#include <string>

#include "needlelab/live.pb.h"

namespace needlelab {

/// Replaces the status's earlier entry for this alarm.
inline void addAlarm(pb::StationStatus& status, const std::string& alarm, std::uint32_t begun, bool now,
                     const std::string& detail) {
  status.clear_alarms();
  pb::AlarmCount& count = *status.add_alarms();
  count.set_alarm(alarm);
  count.set_begun(begun);
  count.set_now(now);
  count.set_detail(detail);
}

}  // namespace needlelab
