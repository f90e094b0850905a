/// The second stage of an API request, after it was checked and read: execute, compute or stream it. Private
/// to this folder.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "server/base/http_message.h"
#include "server/live/context.h"
#include "server/live/limits/byte_budget.h"
#include "server/live/login/login_state.h"
#include "server/web/routes.h"
#include "server/web/web_call.h"
#include "server/web/web_server.h"

namespace needlelab {

/// Parsing JSON of this size takes about a millisecond.
inline constexpr std::size_t kSmallBody = 16u << 10;

/// The session that requested long-running work.
struct LongRequester {
  std::string turn_name, token;
  AccessWatch account;  ///< since the session was found
};

/// The answer when the browser has disconnected; it is not sent.
HttpAnswer disconnectedAnswer();

/// Counts and logs a request refused for lack of room, like the stations' port.
void noteNoRoom(ServerContext& context, const WebCall& call, const Error& error);

// One function per WebAction with work on other threads. `route` must outlive the server.

/// `share`: for the body's JSON. It passes to the request once that is built, because the request may wait
/// long.
Task<HttpAnswer> throughService(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> asked,
                                const WebRoute& route, std::shared_ptr<WebCall> call,
                                std::optional<ByteBudget::Share> share);
Task<HttpAnswer> throughWork(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> request,
                             const WebRoute& route, std::shared_ptr<const WebCall> call);
Task<HttpAnswer> throughSteps(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> request,
                              const WebRoute& route, std::shared_ptr<const WebCall> call, LongRequester by);
Task<HttpAnswer> throughStream(std::shared_ptr<WebServer> server, std::shared_ptr<HttpRequest> request,
                               const WebRoute& route, std::shared_ptr<const WebCall> call, LongRequester by);

}  // namespace needlelab
