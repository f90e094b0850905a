/// Reactions to access changes made by another server on the same database.
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "db/login/access_numbers.h"
#include "needlelab/session.pb.h"
#include "server/live/context.h"

namespace needlelab {

/// Ends connections, cached tokens and log-ins in progress that began before the change, as for a change made
/// here. Thread: the network's.
void onRemoteAccessChanges(ServerContext& context, const std::vector<AccessChange>& changes);

/// Checks the accounts of all connections and cached tokens in the database, and ends those whose access is
/// no longer valid. Only one check runs at a time; a call during one repeats it afterwards. Thread: the
/// network's; the context must outlive it.
void recheckAllAccess(ServerContext& context);

/// A refusal if, for AccessListener::Settings::watch_refused_after, no changes were heard and the database
/// answered no check: a person disabled elsewhere must not start watching. Nothing: changes are heard, or
/// this server is alone.
std::optional<pb::Refusal> accessUnknown(const ServerContext& context);

/// Call once a second, with several servers. Checks all accounts while changes are not heard, and ends
/// people's connections when that has failed for longer than `most`. Stations stay connected; their samples
/// are stored, and their access checked, when the database is back. Thread: the network's.
void stepUnheardAccess(ServerContext& context, std::chrono::nanoseconds most);

}  // namespace needlelab
