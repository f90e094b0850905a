/// What a request needs beside the store, on both ports: the threads that execute it, what only the running
/// server can add to the reply, and the consequences for others who are connected.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "needlelab/session.pb.h"
#include "server/live/context.h"

namespace needlelab {

/// A password in it is wiped when its last holder lets go of it.
std::shared_ptr<const pb::Request> wipedWhenReleased(pb::Request request);

/// Executes a request on the threads that its row names (db/service/requests.cpp). Thread: the network's.
Task<std::shared_ptr<Outcome>> executeRequest(ServerContext& context, Principal who,
                                              std::shared_ptr<const pb::Request> request);

/// Adds to `outcome` what only a running server can: who is online; a message that a station has confirmed.
/// Gives a refusal in place of the reply. `request` and `outcome` must outlive it. Thread: the network's.
Task<std::optional<pb::Refusal>> complete(ServerContext& context, const pb::Request& request, std::string by,
                                          Outcome& outcome);

/// After a request that was done: accounts that end, passwords that changed, backups made. `asker` (may be
/// null) is the connection that a new password of its own does not end. Thread: the network's.
void followUp(ServerContext& context, const pb::Request& request, const pb::Reply& reply,
              const std::string& by, const PeerConnection* asker);

/// All connections and tokens of a name end. `logged_as`: what the logs say in place of the name; empty: the
/// name. Thread: the network's.
void endAccess(ServerContext& context, const std::string& name, bool station, const std::string& by,
               const PeerConnection* except, const std::string& text, const std::string& logged_as = {});

}  // namespace needlelab
