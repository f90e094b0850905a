/// Aspirations and injections of closed sessions.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/event.pb.h"

namespace needlelab {

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class EventStore {
 public:
  explicit EventStore(Connection& connection) : connection_(connection) {}

  /// Notes that these are all that there were, none included. Once for a session: what was worked out once
  /// stays, a second call changes nothing. Errors: kNotFound (session), kInvalidInput (the session is open).
  Status put(const Uuid& session, std::span<const pb::SyringeEvent> events);
  /// In order of time; nothing when they were never put. kNotFound: unknown session.
  Result<std::optional<std::vector<pb::SyringeEvent>>> list(const Uuid& session);

 private:
  Connection& connection_;
};

}  // namespace needlelab
