/// From a request's parts to its answer, without Beast.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/web/web_answer.h"
#include "server/web/web_session.h"

namespace needlelab {

class WebServer;
struct WebRoute;

/// What was read of a request. Header fields are empty when absent.
struct WebRequest {
  std::string method, target;
  std::string host, origin, fetch_site, cookie, content_type, if_match, if_none_match, csrf;
  std::string body;
  bool upgrade = false;  ///< to a WebSocket

  std::uint64_t connection = 0;
  std::string address;         ///< of the peer, HOST:PORT
  std::function<bool()> gone;  ///< nobody waits for the answer any more
};

/// What the log and the metrics say of it.
struct WebTrace {
  std::string route = "none";  ///< the pattern
  std::string who;
};

/// How long a body may be, before it is read: by whether the cookie is of a session.
std::size_t bodyLimitOf(WebServer& server, const std::string& cookie);

/// Never fails: errors are answers. `request` is shared because its body is looked at after other requests of
/// other connections.
Task<WebAnswer> answerTo(std::shared_ptr<WebServer> server, std::shared_ptr<WebRequest> request,
                         std::shared_ptr<WebTrace> trace);

}  // namespace needlelab
