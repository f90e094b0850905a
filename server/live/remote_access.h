/// What a server does when another one on its database has changed an access.
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "db/access_numbers.h"
#include "server/live/context.h"

namespace needlelab {

/// Ends connections, tokens that are kept here and log-ins under way, as for a change of this server's own:
/// those that were opened before the change. Thread: the network's.
void accessChangedElsewhere(ServerContext& context, const std::vector<AccessChange>& changes);

/// Looks at the accounts of all connections and kept tokens in the database, and ends those whose access does
/// not hold any more. One such look at a time: a call during one has it done once more. Thread: the
/// network's; the context must outlive it.
void lookAtAllAccess(ServerContext& context);

/// A refusal when nobody has told of changes, nor the database answered a look, for
/// AccessListener::Settings::watch_refused_after: a person who was disabled elsewhere begins to watch nobody.
/// Nothing: changes are heard, or this server is alone.
std::optional<pb::Refusal> accessUnknown(const ServerContext& context);

/// Once a second, at a server of several: looks at all accounts while nobody tells of changes, and ends
/// people's connections when that was in vain for longer than `most`. Stations stay: their samples are stored
/// when the database is back, and asked for then. Thread: the network's.
void stepUnheardAccess(ServerContext& context, std::chrono::nanoseconds most);

}  // namespace needlelab
