/// Which address stands for which request: one table.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "db/service/service.h"
#include "needlelab/control.pb.h"
#include "server/web/web_answer.h"
#include "server/web/web_call.h"
#include "server/web/web_stream.h"

namespace needlelab {

inline constexpr std::string_view kApiBase = "/api/v1";

/// What only the connection's side can do.
enum class WebAction {
  kRequest,  ///< `build` → the service → `shape`
  kWork,     ///< `work` on a worker's thread: several requests that read, or the engine
  kLogIn,
  kWhoAmI,
  kLogOut,
  kLive,    ///< becomes a WebSocket
  kText,    ///< `text`, the same for everybody who is logged in
  kStream,  ///< `stream`
};

/// `build` runs on the network's thread, the others on a worker's.
struct WebRoute {
  std::string_view method;
  std::string_view pattern;  ///< below kApiBase, e.g. "/people/{name}"
  /// Whose rule in db/service/roles.cpp counts; CALL_NOT_SET: everybody who is logged in (or nobody yet).
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;
  WebAction action = WebAction::kRequest;
  Result<pb::Request> (*build)(const WebCall& call) = nullptr;
  WebJson (*shape)(const WebCall& call, const pb::Reply& reply) = nullptr;
  Result<WebJson> (*work)(Service& service, const WebCall& call) = nullptr;
  unsigned status = 200;
  Result<WebStream> (*stream)(Service& service, const WebCall& call) = nullptr;
  std::string_view (*text)() = nullptr;
};

/// All of them; a pattern with a fixed part stands before one with {…} in its place.
std::span<const WebRoute> webRoutes();

struct WebMatch {
  const WebRoute* route = nullptr;
  std::vector<std::string> parts;    ///< what stood for {…}
  std::vector<std::string> allowed;  ///< the methods of this path, when it is known and the method is not
};
/// `segments` without "api" and "v1".
WebMatch matchRoute(std::string_view method, std::span<const std::string> segments);

}  // namespace needlelab
