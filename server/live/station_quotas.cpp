#include "server/live/station_quotas.h"

#include <fmt/core.h>

namespace needlelab {
namespace {

Error usedUp(const std::string& station, const std::string& what, const std::string& remedy) {
  return {ErrorCode::kNoRoom, "station '" + station + "' " + what + "; " + remedy +
                                  "; the station keeps the session and tries again by itself"};
}

}  // namespace

Status StationQuotas::admit(const std::string& station, const NewSession& session, std::int64_t now_ns) {
  if (session.open_sessions >= settings_.open_sessions)
    return usedUp(
        station,
        fmt::format("has {} open sessions on the server, at most {} are allowed", session.open_sessions,
                    settings_.open_sessions),
        "see who has its key, and give it a new one: needlelab-admin station revoke, then station add");

  Used& used = used_[station];
  const auto bytes = static_cast<double>(session.description_bytes);
  if (const double share = settings_.description_bytes; !used.description_bytes.has(bytes, share, now_ns))
    return usedUp(
        station,
        fmt::format("has brought {:.0f} MiB of descriptions and profiles within a day, this one has {} bytes",
                    used.description_bytes.usedAt(share, now_ns) / 0x1p20, session.description_bytes),
        fmt::format("there is room for it in {:.0f} min; if nobody practised so much, see who has "
                    "its key",
                    used.description_bytes.minutesUntil(bytes, share, now_ns)));
  if (session.unknown_name) {
    const double share = settings_.unknown_names;
    if (!used.unknown_names.has(1, share, now_ns))
      return usedUp(station, fmt::format("has brought {:.0f} names of trainees that nobody has", share),
                    fmt::format("add the person (needlelab-admin user add), or wait {:.0f} min",
                                used.unknown_names.minutesUntil(1, share, now_ns)));
    used.unknown_names.take(1, share, now_ns);
  }
  used.description_bytes.take(bytes, settings_.description_bytes, now_ns);
  return {};
}

Status StationQuotas::admitChunk(const std::string& station, const NewChunk& chunk, std::int64_t now_ns) {
  Used& used = used_[station];
  const auto cost = static_cast<double>(chunk.bytes + kChunkRowBytes);
  const auto refused = [&](const DayShare& of, double share, const std::string& what) {
    return usedUp(
        station, fmt::format("has brought {:.0f} MiB of {} within a day", share / 0x1p20, what),
        fmt::format("there is room for this one in {:.0f} min; if nobody practised so much, see who "
                    "has its key",
                    of.minutesUntil(cost, share, now_ns)));
  };
  if (!used.chunk_bytes.has(cost, settings_.chunk_bytes, now_ns))
    return refused(used.chunk_bytes, settings_.chunk_bytes, "recordings");
  if (chunk.undecodable) {
    if (!used.undecodable_bytes.has(cost, settings_.undecodable_bytes, now_ns))
      return refused(used.undecodable_bytes, settings_.undecodable_bytes, "chunks that cannot be decoded");
    used.undecodable_bytes.take(cost, settings_.undecodable_bytes, now_ns);
  }
  used.chunk_bytes.take(cost, settings_.chunk_bytes, now_ns);
  return {};
}

Status StationQuotas::roomForChunks(const std::string& station, std::int64_t now_ns) {
  const double share = settings_.chunk_bytes, least = share / kChunksAtOnce;
  const DayShare& used = used_[station].chunk_bytes;
  if (used.has(least, share, now_ns)) return {};
  return usedUp(station, fmt::format("has brought {:.0f} MiB of recordings within a day", share / 0x1p20),
                fmt::format("there is room for more in {:.0f} min; if nobody practised so much, see who has "
                            "its key",
                            used.minutesUntil(least, share, now_ns)));
}

}  // namespace needlelab
