/// Fenced takeover of stations (ARCHITECTURE.md, "Several servers"): of servers that work on one database the
/// one at which a station logged in last stores its sessions, and no other.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// One log-in of a station at one of several servers.
struct StationClaim {
  std::string station;
  std::string server;      ///< its name (serverNameOf)
  std::int64_t epoch = 0;  ///< how many log-ins there were up to this one
  bool operator==(const StationClaim&) const = default;
};

/// Does not own the connection. Thread: as its Connection; all but newest() needs the writer's and a
/// transaction.
class StationClaims {
 public:
  explicit StationClaims(Connection& connection) : connection_(connection) {}

  /// The station has logged in at `server`: from the commit on, what comes by older claims is refused.
  Result<StationClaim> raise(const std::string& station, const std::string& server, std::int64_t now_unix_ns);
  /// The same of a log-in that has waited since `seen` was the newest claim: kDeposed where another server
  /// has raised it meanwhile, because that log-in is the newer one.
  Result<StationClaim> raiseSince(const std::optional<StationClaim>& seen, const std::string& station,
                                  const std::string& server, std::int64_t now_unix_ns);
  /// kDeposed unless the station has not logged in since, here or elsewhere. In the transaction that stores
  /// something of its sessions. Null: no other server works on the database, and nothing is asked.
  Status require(const StationClaim* claim);
  /// Nothing: no server that works with others has had the station.
  Result<std::optional<StationClaim>> newest(std::string_view station);

 private:
  Connection& connection_;
};

}  // namespace needlelab
