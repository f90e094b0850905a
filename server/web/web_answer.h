/// What goes back to a browser.
#pragma once

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

/// JSON with its members in the order in which they were written.
using WebJson = nlohmann::ordered_json;

struct WebAnswer {
  unsigned status = 200;
  std::string type = "application/json";
  std::string body;
  std::shared_ptr<const std::string> shared_body;            ///< in place of `body`
  std::vector<std::pair<std::string, std::string>> headers;  ///< beside those that every answer has
  /// Set: the body comes in pieces, an empty one is the end; an error cuts the connection, so that nobody
  /// takes a part for the whole. Asked for the next only when the last has been sent.
  std::function<Task<Result<std::string>>()> pieces;
  std::string live_token;  ///< set: the connection becomes a WebSocket of this session
  bool no_store = true;
  bool close = false;  ///< the connection ends with it
};

WebAnswer jsonAnswer(const WebJson& json, unsigned status = 200);

/// `{"error":{"code":…,"message":…,"field":…}}`; no field: there is none to name.
WebAnswer errorAnswer(unsigned status, std::string_view code, const std::string& message,
                      const std::string& field = {});
/// By the error's code; a message that begins with `PATH: ` names its field.
WebAnswer errorAnswer(const Error& error);

/// The path before the first ": " when it looks like one of a document, e.g. `layers[2].cut_force_n`; else
/// empty.
std::string fieldOfMessage(std::string_view message);

}  // namespace needlelab
