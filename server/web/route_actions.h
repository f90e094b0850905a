/// What a route of the API does with a request that was checked and read: execute it, compute, stream.
/// Private to this folder.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "server/base/http_message.h"
#include "server/live/access_changes.h"
#include "server/live/byte_budget.h"
#include "server/live/context.h"
#include "server/web/routes.h"
#include "server/web/web_call.h"
#include "server/web/web_server.h"

namespace needlelab {

/// Parsing JSON of this size takes about a millisecond.
inline constexpr std::size_t kSmallBody = 16u << 10;

/// The session that asked for what takes long.
struct AskedBy {
  std::string turn_name, token;
  AccessWatch account;  ///< since the session was found
};

/// The answer for a browser that has gone: nobody reads it.
HttpAnswer browserGone();

/// Counts a request that was refused for want of room and logs it, as the stations' port does.
void noteNoRoom(ServerContext& context, const WebCall& call, const Error& error);

// One function for each WebAction that has work on other threads. `route` outlives the server.

/// `share`: of the body's JSON. Once the request is built it is the request's, which may wait long.
Task<HttpAnswer> throughService(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> asked,
                                const WebRoute& route, std::shared_ptr<WebCall> call,
                                std::optional<ByteBudget::Share> share);
Task<HttpAnswer> throughWork(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> request,
                             const WebRoute& route, std::shared_ptr<const WebCall> call);
Task<HttpAnswer> throughSteps(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> request,
                              const WebRoute& route, std::shared_ptr<const WebCall> call, AskedBy by);
Task<HttpAnswer> throughStream(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> request,
                               const WebRoute& route, std::shared_ptr<const WebCall> call, AskedBy by);

}  // namespace needlelab
