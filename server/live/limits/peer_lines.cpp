#include "server/live/limits/peer_lines.h"

#include <iterator>

namespace needlelab {

LogBound PeerLines::boundOf(LineBound bound) const {
  switch (bound) {
    case LineBound::kAnswered:
      return LogBound(settings_.answered_a_minute);
    case LineBound::kNoRoom:
      return LogBound(settings_.no_room_an_hour, 60 * LogBound::kMinute_ns);
    case LineBound::kUsual:
      break;
  }
  return LogBound(settings_.a_minute);
}

void PeerLines::write(const std::string& owner, const PeerLineKind& kind, std::int64_t now_ns,
                      std::initializer_list<LogField> fields) {
  LogBound& bound = owners_[owner].try_emplace(kind, boundOf(kind.bound)).first->second;
  if (bound.take(now_ns)) logEvent(kind.level, kind.event, fields);
}

void PeerLines::reportOmitted(std::int64_t now_ns) {
  for (auto owner = owners_.begin(); owner != owners_.end();) {
    auto& bounds = owner->second;
    for (auto entry = bounds.begin(); entry != bounds.end();) {
      if (const std::uint64_t count = entry->second.takeOmittedCount(now_ns); count > 0) {
        const PeerLineKind& kind = entry->first;
        const std::string of =
            std::string(kind.event) + (kind.part.empty() ? "" : "/") + std::string(kind.part);
        logEvent(kind.level, "lines_left_out", {{"who", owner->first}, {"of", of}, {"count", count}});
      }
      entry = entry->second.over(now_ns) ? bounds.erase(entry) : std::next(entry);
    }
    owner = bounds.empty() ? owners_.erase(owner) : std::next(owner);
  }
}

}  // namespace needlelab
