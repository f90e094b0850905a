/// Log-in of a station by its key, on the log-ins' thread in turns.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "needlelab/session.pb.h"
#include "server/live/context.h"

namespace needlelab {

/// Checks name and key. Until then the name is only claimed: log-ins take turns by the address (a key,
/// Admission::keyOf) and the name, so that nobody elsewhere takes a station's turns by its name. Errors:
/// kDenied. Thread: the network's; the context must outlive it.
Task<Result<Principal>> checkStationKey(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                        std::string address);

/// Whether a refused log-in claimed the name of a station, for the log; in the same turns.
Task<Result<bool>> claimsKnownStation(ServerContext& context, std::shared_ptr<const pb::Login> login,
                                      std::string address);

/// The open sessions of a station whose key was right, from the database: 2 ms for 1,000 of them. Stations
/// take turns, so that one that logs in again and again waits behind itself. Thread: as above.
Task<Result<std::vector<pb::Welcome::OpenSession>>> openSessionsOf(ServerContext& context,
                                                                   std::string station);

}  // namespace needlelab
