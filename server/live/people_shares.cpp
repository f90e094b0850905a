#include "server/live/people_shares.h"

#include <fmt/core.h>

namespace needlelab {

double PeopleShares::shareOf(pb::Role role) const {
  switch (role) {
    case pb::ADMINISTRATOR:
      return settings_.administrator_bytes;
    case pb::INSTRUCTOR:
    case pb::CURRICULUM_MANAGER:
      return settings_.staff_bytes;
    default:
      return settings_.own_bytes;
  }
}

Status PeopleShares::admit(const std::string& name, pb::Role role, std::size_t bytes, std::int64_t now_ns) {
  const double share = shareOf(role);
  const double cost = static_cast<double>(bytes + kRequestBytes);
  DayShare& used = used_[name];
  if (used.has(cost, share, now_ns)) {
    used.take(cost, share, now_ns);
    return {};
  }
  return Error{
      ErrorCode::kNoRoom,
      fmt::format("'{}' has had stored what one account may within a day ({:.0f} MiB, of which each "
                  "request takes its length and {} bytes): there is room for this one in {:.0f} min; "
                  "if '{}' did not do so much, have a manager set a new password",
                  name, share / 0x1p20, kRequestBytes, used.minutesUntil(cost, share, now_ns), name)};
}

}  // namespace needlelab
