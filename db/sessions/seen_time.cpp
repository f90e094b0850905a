#include "db/sessions/seen_time.h"

#include <fmt/core.h>

#include <algorithm>
#include <string_view>

#include "common/base/time/clock.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

// keys of `meta`
constexpr std::string_view kLatest = "latest_unix_ns";
constexpr std::string_view kClosedBehind = "closed_behind ";  // followed by the session

bool isAhead(std::int64_t seen_unix_ns, std::int64_t now_unix_ns) {
  return seen_unix_ns != 0 && now_unix_ns - seen_unix_ns > kMaxAhead_ns;
}

}  // namespace

Result<std::int64_t> SeenTimeStore::latest() {
  auto rows = connection_.query(
      "SELECT coalesce((SELECT CAST(value AS BIGINT) FROM meta WHERE key = ?),"
      " max(coalesce((SELECT max(closed_unix_ns) FROM sessions), 0),"
      " coalesce((SELECT CAST(value AS BIGINT) FROM meta WHERE key = 'created_unix_ns'), 0)))",
      kLatest);
  ASSIGN_OR_RETURN(const bool there, rows.step());
  return there ? rows.integer(0) : 0;
}

Status SeenTimeStore::note(std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto seen, latest());
  // written even if unchanged: the time of a close under a clock that is ahead must not become the latest
  return confirm(isAhead(seen, now_unix_ns) ? seen : std::max(seen, now_unix_ns));
}

Status SeenTimeStore::noteClose(const Uuid& session, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto seen, latest());
  if (now_unix_ns >= seen) return note(now_unix_ns);
  if (now_unix_ns + kClockSlack_ns >= seen) return {};
  return MetaStore(connection_).set(std::string(kClosedBehind) + uuidText(session), std::to_string(seen));
}

Status SeenTimeStore::confirm(std::int64_t now_unix_ns) {
  return MetaStore(connection_).set(kLatest, std::to_string(now_unix_ns));
}

Result<std::map<Uuid, std::int64_t>> SeenTimeStore::closedBehind() {
  std::map<Uuid, std::int64_t> times;
  auto rows = connection_.query(
      "SELECT substr(key, 1 + length(?1)), CAST(value AS BIGINT) FROM meta"
      " WHERE substr(key, 1, length(?1)) = ?1",
      kClosedBehind);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return times;
    if (const auto session = parseUuid(rows.text(0))) times[*session] = rows.integer(1);
  }
}

Result<std::string> SeenTimeStore::behindText(std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto seen, latest());
  if (now_unix_ns + kClockSlack_ns >= seen) return std::string();
  return "the server's clock shows " + localTime(now_unix_ns, TimeForm::kZoned) + ", and it has shown " +
         localTime(seen, TimeForm::kZoned) +
         " before: set it right. If it is right (it was ahead before), confirm it by: needlelab-admin "
         "retention run";
}

Result<std::string> SeenTimeStore::aheadText(std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto seen, latest());
  if (!isAhead(seen, now_unix_ns)) return std::string();
  return fmt::format(
      "the server's clock shows {}, {} days after the latest time that is known, {}: retention removes "
      "nothing "
      "by itself. Set the clock right. If it is right (nothing ran for so long, or an older backup was "
      "restored), confirm it by: needlelab-admin retention run",
      localTime(now_unix_ns, TimeForm::kZoned), (now_unix_ns - seen) / 86'400'000'000'000,
      localTime(seen, TimeForm::kZoned));
}

}  // namespace needlelab
