/// Fenced takeover of stations (server/PROMISES.md, "Several servers"): of several servers on one database,
/// only the one at which a station last logged in stores its sessions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// One log-in of a station at one of several servers.
struct StationClaim {
  std::string station;
  std::string server;      ///< its name (serverNameOf)
  std::int64_t epoch = 0;  ///< number of log-ins up to and including this one
  bool operator==(const StationClaim&) const = default;
};

/// Does not own the connection. Thread: as its Connection; all functions but newest() need the writer's
/// connection and a transaction.
class StationClaims {
 public:
  explicit StationClaims(Connection& connection) : connection_(connection) {}

  /// The station has logged in at `server`: once committed, data under older claims is refused.
  Result<StationClaim> raise(const std::string& station, const std::string& server, std::int64_t now_unix_ns);
  /// Same for a log-in that started when `seen` was the newest claim: kDeposed if another server has raised
  /// it meanwhile, because that log-in is newer.
  Result<StationClaim> raiseSince(const std::optional<StationClaim>& seen, const std::string& station,
                                  const std::string& server, std::int64_t now_unix_ns);
  /// kDeposed if the station has logged in again since, here or elsewhere. Call in the transaction that
  /// stores data of its sessions. Null: no other server works on the database, and nothing is checked.
  Status require(const StationClaim* claim);
  /// Nothing: the station has never logged in at a server that works with others.
  Result<std::optional<StationClaim>> newest(std::string_view station);

 private:
  Connection& connection_;
};

}  // namespace needlelab
