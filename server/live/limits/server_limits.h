/// What a server admits: connections, handshakes, messages, stored data, log lines.
#pragma once

#include "common/wire/asio.h"
#include "server/live/limits/admission.h"
#include "server/live/limits/byte_budget.h"
#include "server/live/limits/disk_room.h"
#include "server/live/limits/handshake_turns.h"
#include "server/live/limits/limits.h"
#include "server/live/limits/peer_lines.h"
#include "server/live/limits/quotas.h"
#include "server/live/limits/token_bucket.h"

namespace needlelab {

struct ServerLimits {
  asio::io_context& io;
  ConnectionBounds bounds;
  Admission admission{};
  ByteBudget closes{
      {.station = bounds.closes_of_station}};  ///< counts sessions, not bytes; by name of the station
  /// Per account; before log-in, per connection.
  TokenBuckets small_messages{};
  PeerLines lines{bounds.log_lines};  ///< of the log, for both ports
  DiskRoom disk_room{0};
  StationQuotas quotas{};  ///< the writer's thread only
  PeopleShares shares{};
  HandshakeTurns handshakes{};
  asio::steady_timer handshakes_due{io};  ///< when the next handshake place becomes free by timeout
};

}  // namespace needlelab
