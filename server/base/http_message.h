/// HTTP requests and answers for the handlers of both HTTP ports.
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

/// A parsed request. Header fields are empty when absent.
struct HttpRequest {
  std::string method, target;
  std::string host, origin, fetch_site, cookie, content_type, if_match, if_none_match, csrf;
  std::string forwarded, x_forwarded_for;  ///< all values, joined by commas; any client may send them
  std::string body;
  bool is_http_1_1 = true;
  bool upgrade = false;  ///< requests a WebSocket

  std::uint64_t connection = 0;
  std::string address;  ///< the peer's, HOST:PORT; behind a trusted proxy the client's
  /// True once the client no longer waits for the answer. Never becomes false again. Thread: any.
  std::function<bool()> gone;

  // for the log and the metrics; set by the handler
  std::string route = "none";
  std::string who;
  std::string refused_for;  ///< logged beside the status of a refusal
};

/// The next piece of a body, empty at the end.
using HttpPieces = std::function<Task<Result<std::string>>()>;

struct HttpAnswer {
  unsigned status = 200;
  std::string type = "application/json";
  std::string body = {};
  std::shared_ptr<const std::string> shared_body = {};  ///< instead of `body`
  HttpHeaders headers = {};                             ///< in addition to commonHeaders()
  /// If set, the body is sent in pieces. An error cuts the connection, so that the client cannot mistake a
  /// part for the whole. The server requests a piece only after it has sent the previous one.
  HttpPieces pieces = {};
  std::shared_ptr<HttpTakeover> takeover = {};  ///< if set, another protocol takes over the connection
  std::shared_ptr<const void> until_sent =
      {};  ///< released when the answer has been written, or the peer is gone
  bool no_store = true;
  bool close = false;  ///< close the connection afterwards
};

/// JSON that keeps its members in insertion order.
using WebJson = nlohmann::ordered_json;

HttpAnswer jsonAnswer(const WebJson& json, unsigned status = 200);

/// `{"error":{"code":…,"message":…,"field":…}}`; an empty field is omitted.
HttpAnswer errorAnswer(unsigned status, std::string_view code, const std::string& message,
                       const std::string& field = {});
/// Status by the error's code; a message that begins with `PATH: ` names its field.
HttpAnswer errorAnswer(const Error& error);

/// The text before the first ": " when it looks like a document path, e.g. `layers[2].cut_force_n`; else
/// empty.
std::string fieldOfMessage(std::string_view message);

/// text/plain with a newline at the end.
HttpAnswer plainAnswer(unsigned status, const std::string& text);

}  // namespace needlelab
