#include "server/live/port/clock_offsets.h"

#include "common/base/time/clock.h"
#include "db/sessions/session_store.h"

namespace needlelab {

void ClockOffsets::put(DbWriter& writer, const Uuid& session, std::int64_t offset_ns,
                       std::int64_t round_trip_ns, std::shared_ptr<const StationClaim> claim) {
  Status posted;
  {
    const std::lock_guard lock(state_->mutex);
    auto& open = state_->open;
    if (open && open->size() >= kMaxSessions && !open->contains(session)) open.reset();
    if (!open) {
      const auto item = std::make_shared<Item>();
      DbWriter::Work work = [state = state_, item](Connection& connection) -> Status {
        state->end(item);
        for (const auto& [id, best] : *item) {
          Status stored = StationClaims(connection).require(best.claim.get());
          if (stored.ok())
            stored = SessionStore(connection).setClockOffset(id, best.offset_ns, best.round_trip_ns);
          if (stored.ok()) continue;
          // an erased session, or one whose station is elsewhere, must not prevent storing the others
          const ErrorCode code = stored.error().code;
          if (code != ErrorCode::kNotFound && code != ErrorCode::kDeposed) return stored;
          state->reportNotStored(stored.error());
        }
        return {};
      };
      posted = writer.post(std::move(work), [state = state_, item](const Status& stored) {
        state->end(item);  // also if the work did not start
        if (!stored.ok()) state->reportNotStored(stored.error());
      });
      if (posted.ok()) open = item;
    }
    if (posted.ok()) {
      Offset& best = open->try_emplace(session, Offset{offset_ns, round_trip_ns, claim}).first->second;
      // offsets of an earlier log-in are not stored
      if (round_trip_ns < best.round_trip_ns || best.claim != claim)
        best = {offset_ns, round_trip_ns, std::move(claim)};
    }
  }
  if (!posted.ok()) state_->reportNotStored(posted.error());
}

void ClockOffsets::State::end(const std::shared_ptr<Item>& item) {
  const std::lock_guard lock(mutex);
  if (open == item) open.reset();
}

void ClockOffsets::State::reportNotStored(const Error& error) {
  const std::lock_guard lock(lines_mutex);
  if (lines.take(steadyNowNs()))
    logEvent(LogLevel::kWarning, "clock_offset_not_stored", {{"text", error.message}});
}

void ClockOffsets::State::reportOmitted(std::int64_t now_ns) {
  const std::lock_guard lock(lines_mutex);
  if (const std::uint64_t count = lines.takeOmittedCount(now_ns); count > 0)
    logEvent(LogLevel::kWarning, "lines_left_out", {{"of", "clock_offset_not_stored"}, {"count", count}});
}

}  // namespace needlelab
