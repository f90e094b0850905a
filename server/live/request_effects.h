/// What a request needs beside the store, whichever port it came by: the threads to run on, what only the
/// running server can add to the reply, and what follows for others who are connected.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <memory>
#include <optional>
#include <string>

#include "needlelab/session.pb.h"
#include "server/live/context.h"

namespace needlelab {

/// Where a request runs, so that a backup of minutes or a flood of passwords does not hold up a lesson.
asio::thread_pool& poolFor(ServerContext& context, const pb::Request& request);

/// The password in it, if any, is wiped at the end, whoever holds it last.
std::shared_ptr<const pb::Request> heldSecretly(pb::Request request);

/// Adds to `outcome` what only a running server can: who is online; a message that a station has confirmed.
/// Gives a refusal in place of the reply. `request` and `outcome` must outlive it. Thread: the network's.
Task<std::optional<pb::Refusal>> complete(ServerContext& context, const pb::Request& request, std::string by,
                                          Outcome& outcome);

/// After a request that was done: accounts that end, passwords that changed, backups made. `asker` (may be
/// null) is the connection that a new password of its own does not end. Thread: the network's.
void followUp(ServerContext& context, const pb::Request& request, const pb::Reply& reply,
              const std::string& by, const PeerConnection* asker);

/// All connections and tokens of a name end. `said_as`: what the logs say in place of the name; empty: the
/// name. Thread: the network's.
void endAccess(ServerContext& context, const std::string& name, bool station, const std::string& by,
               const PeerConnection* except, const std::string& text, const std::string& said_as = {});

}  // namespace needlelab
