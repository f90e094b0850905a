#include "db/sessions/station_claims.h"

#include <fmt/core.h>

#include "common/base/planted_bug.h"

namespace needlelab {

Result<StationClaim> StationClaims::raise(const std::string& station, const std::string& server,
                                          std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(
      const std::int64_t epoch,
      connection_.insert("INSERT INTO station_claims (station, epoch, server, since_unix_ns) VALUES (?,1,?,?)"
                         " ON CONFLICT (station) DO UPDATE SET epoch = station_claims.epoch + 1,"
                         " server = excluded.server, since_unix_ns = excluded.since_unix_ns RETURNING epoch",
                         station, server, now_unix_ns));
  return StationClaim{station, server, epoch};
}

Result<StationClaim> StationClaims::raiseSince(const std::optional<StationClaim>& seen,
                                               const std::string& station, const std::string& server,
                                               std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto newest, this->newest(station));
  if (newest && newest != seen && newest->server != server)
    return Error{ErrorCode::kDeposed,
                 fmt::format("station '{}' has logged in at the server '{}' while this log-in waited",
                             station, newest->server)};
  return raise(station, server, now_unix_ns);
}

Status StationClaims::require(const StationClaim* claim) {
  if (claim == nullptr || planted(PlantedBug::kTakeoverUnfenced)) return {};
  ASSIGN_OR_RETURN(const auto newest, this->newest(claim->station));
  if (newest == *claim) return {};
  return Error{
      ErrorCode::kDeposed,
      fmt::format("station '{}' has logged in again since, at {}: nothing that comes by this log-in is "
                  "stored any more; connect again",
                  claim->station,
                  !newest                           ? "a server that this database does not know"
                  : newest->server == claim->server ? "this server"
                                                    : "the server '" + newest->server + "'")};
}

Result<std::optional<StationClaim>> StationClaims::newest(std::string_view station) {
  return connection_.query("SELECT station, server, epoch FROM station_claims WHERE station = ?", station)
      .first([](const Statement& row) {
        return StationClaim{row.text(0), row.text(1), row.integer(2)};
      });
}

}  // namespace needlelab
