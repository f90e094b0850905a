/// What a server knows about the others it works with. Empty for a single server.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>

#include "server/together/access_listener.h"

namespace needlelab {

class RemoteLive;

/// A check of all accounts in use (remote_access.h).
struct AccessRecheck {
  bool is_under_way = false;
  bool is_due = false;                   ///< repeat the check afterwards
  std::int64_t unanswered_since_ns = 0;  ///< by steadyNowNs(); 0: the database answered the last check
};

struct ServerTogether {
  /// This server's name among those that work together (Store::sharedServerName); empty for a single server,
  /// where stations have no claims (db/sessions/station_claims.h).
  const std::string claims_as = {};
  /// The newest connection of each station that is connected here or logging in; an older one claims nothing.
  std::unordered_map<std::string, std::uint64_t> newest_logins{};
  AccessRecheck access_recheck{};
  /// Hears changes made by other servers on the database; null for a single server.
  std::unique_ptr<AccessListener> access_listener{};
  RemoteLive* remote = nullptr;  ///< the lab's other servers; null: it has only one
};

}  // namespace needlelab
