/// Log-in of a station by its key, on the log-ins' thread.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "needlelab/session.pb.h"
#include "server/live/context.h"

namespace needlelab {

/// Checks name and key. Until then the name is only claimed, so log-ins take turns by the address
/// (Admission::keyOf) and the name together: no other address can use up a station's turns. Errors: kDenied.
/// Thread: the network's; the context must outlive it.
Task<Result<Principal>> checkStationKey(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                        std::string address);

/// Whether a refused log-in claimed the name of an existing station, for the log. Takes the same turns.
Task<Result<bool>> claimsKnownStation(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                      std::string address);

/// The open sessions of a station whose key was right, from the database: 2 ms for 1,000 of them. Stations
/// take turns, so one that logs in repeatedly only delays itself. Thread: as above.
Task<Result<std::vector<pb::Welcome::OpenSession>>> openSessionsOf(ServerContext& context,
                                                                   std::string station);

}  // namespace needlelab
