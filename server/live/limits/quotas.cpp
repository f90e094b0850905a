#include "server/live/limits/quotas.h"

#include <fmt/core.h>

namespace needlelab {
namespace {

Error stationHas(const std::string& station, const std::string& what, const std::string& remedy) {
  return {ErrorCode::kNoRoom, "station '" + station + "' " + what + "; " + remedy +
                                  "; the station keeps the session and tries again by itself"};
}

/// `for_what`: what there is room for after `minutes`.
Error quotaError(const std::string& station, const std::string& what, const std::string& for_what,
                 double minutes) {
  return stationHas(
      station, "has brought " + what,
      fmt::format(
          "there is room for {} in {:.0f} min; if it brought more than was practised, check who has its key",
          for_what, minutes));
}

std::string ofADay(double share, const std::string& what) {
  return fmt::format("{:.0f} MiB of {} within a day", share / 0x1p20, what);
}

double shareOf(const AccountLimits& limits, pb::Role role) {
  switch (role) {
    case pb::ADMINISTRATOR:
      return limits.administrator_bytes;
    case pb::INSTRUCTOR:
    case pb::CURRICULUM_MANAGER:
      return limits.staff_bytes;
    default:
      return limits.own_bytes;
  }
}

}  // namespace

Status StationQuotas::admit(const std::string& station, const NewSession& session, std::int64_t now_ns) {
  if (session.open_sessions >= settings_.open_sessions)
    return stationHas(
        station,
        fmt::format("has {} open sessions on the server, at most {} are allowed", session.open_sessions,
                    settings_.open_sessions),
        "see who has its key, and give it a new one: needlelab-admin station revoke, then station add");
  const auto bytes = static_cast<double>(session.description_bytes);
  TokenBucket& descriptions =
      descriptions_.of(station, BucketRate::ofDay(settings_.description_bytes), now_ns);
  if (!descriptions.has(bytes, now_ns))
    return quotaError(station,
                      ofADay(descriptions.usedAt(now_ns), "descriptions and profiles") +
                          fmt::format(", this one has {} bytes", session.description_bytes),
                      "it", descriptions.minutesUntil(bytes, now_ns));
  if (session.unknown_name) {
    TokenBucket& names = names_.of(station, BucketRate::ofDay(settings_.unknown_names), now_ns);
    if (!names.has(1, now_ns))
      return stationHas(
          station,
          fmt::format("has brought {:.0f} names of trainees that nobody has", settings_.unknown_names),
          fmt::format("add the person (needlelab-admin user add), or wait {:.0f} min",
                      names.minutesUntil(1, now_ns)));
    names.take(1, now_ns);
  }
  descriptions.take(bytes, now_ns);
  return {};
}

Status StationQuotas::admitChunk(const std::string& station, const NewChunk& chunk, std::int64_t now_ns) {
  const auto cost = static_cast<double>(chunk.bytes + kChunkRowBytes);
  TokenBucket& chunks = chunks_.of(station, BucketRate::ofDay(settings_.chunk_bytes), now_ns);
  if (!chunks.has(cost, now_ns))
    return quotaError(station, ofADay(settings_.chunk_bytes, "recordings"), "this one",
                      chunks.minutesUntil(cost, now_ns));
  if (chunk.undecodable) {
    const BucketRate rate = BucketRate::ofDay(settings_.undecodable_bytes);
    if (!undecodable_.take(station, rate, cost, now_ns))
      return quotaError(station, ofADay(settings_.undecodable_bytes, "chunks that cannot be decoded"),
                        "this one", undecodable_.of(station, rate, now_ns).minutesUntil(cost, now_ns));
  }
  chunks.take(cost, now_ns);
  return {};
}

Status StationQuotas::roomForChunks(const std::string& station, std::int64_t now_ns) {
  const double least = settings_.chunk_bytes / kChunksAtOnce;
  const TokenBucket& chunks = chunks_.of(station, BucketRate::ofDay(settings_.chunk_bytes), now_ns);
  if (chunks.has(least, now_ns)) return {};
  return quotaError(station, ofADay(settings_.chunk_bytes, "recordings"), "more",
                    chunks.minutesUntil(least, now_ns));
}

Status PeopleShares::admit(const std::string& name, pb::Role role, std::size_t bytes, std::int64_t now_ns) {
  const double share = shareOf(settings_, role), cost = static_cast<double>(bytes + kRequestBytes);
  const BucketRate rate = BucketRate::ofDay(share);
  if (used_.take(name, rate, cost, now_ns)) return {};
  return Error{
      ErrorCode::kNoRoom,
      fmt::format("this account has used up what it may store in a day ({:.0f} MiB; each request counts its "
                  "length plus {} bytes): try again in {:.0f} min; if this was not you, have a manager "
                  "set a new password",
                  share / 0x1p20, kRequestBytes, used_.of(name, rate, now_ns).minutesUntil(cost, now_ns))};
}

}  // namespace needlelab
