/// A request of HTTP and its answer, as the handlers of both HTTP ports see them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

class HttpTakeover;

using HttpHeaders = std::vector<std::pair<std::string, std::string>>;

/// A request as it was read. Header fields are empty when absent.
struct HttpRequest {
  std::string method, target;
  std::string host, origin, fetch_site, cookie, content_type, if_match, if_none_match, csrf;
  std::string body;
  bool is_http_1_1 = true;
  bool upgrade = false;  ///< to a WebSocket

  std::uint64_t connection = 0;
  std::string address;         ///< of the peer, HOST:PORT
  std::function<bool()> gone;  ///< true: nobody waits for the answer any more

  // for the log and the metrics, filled in by the handler
  std::string route = "none";
  std::string who;
};

/// The next piece of a body, empty at the end.
using HttpPieces = std::function<Task<Result<std::string>>()>;

struct HttpAnswer {
  unsigned status = 200;
  std::string type = "application/json";
  std::string body = {};
  std::shared_ptr<const std::string> shared_body = {};  ///< in place of `body`
  HttpHeaders headers = {};                             ///< beside those that every answer has
  /// Set: the body comes in pieces. An error cuts the connection, so that nobody takes a part for the whole.
  /// The next piece is asked for only when the last one has been sent.
  HttpPieces pieces = {};
  std::shared_ptr<HttpTakeover> takeover = {};  ///< set: the connection becomes another protocol's
  bool no_store = true;
  bool close = false;  ///< the connection ends with it
};

/// JSON with its members in the order in which they were written.
using WebJson = nlohmann::ordered_json;

HttpAnswer jsonAnswer(const WebJson& json, unsigned status = 200);

/// `{"error":{"code":…,"message":…,"field":…}}`; an empty field is left out.
HttpAnswer errorAnswer(unsigned status, std::string_view code, const std::string& message,
                       const std::string& field = {});
/// By the error's code; a message that begins with `PATH: ` names its field.
HttpAnswer errorAnswer(const Error& error);

/// The path before the first ": " when it looks like one of a document, e.g. `layers[2].cut_force_n`; else
/// empty.
std::string fieldOfMessage(std::string_view message);

/// text/plain with a line's end.
HttpAnswer plainAnswer(unsigned status, const std::string& text);

}  // namespace needlelab
