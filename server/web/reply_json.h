/// Converts wire messages to the browser's JSON and back. The only place that defines their differences.
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "server/base/http_message.h"

namespace needlelab {

/// Returns all fields in the order of the .proto, in snake_case; omits absent messages and lists. Differences
/// from the canonical JSON of common/profile:
/// - times `…_unix_ns` become `…_unix_ms`, numbers with a fraction, because ns have too many digits for
///   JavaScript; 0 (has not happened) becomes null;
/// - `session_id` is the UUID's text, `hash` and other bytes are hexadecimal, `next_page` is base64url;
/// - texts that contain JSON (`json`, `…_json`, `records`) become objects and lists; their names lose
///   `_json`.
WebJson jsonOf(const google::protobuf::Message& message);

/// Fills `message` strictly (profile/message_json.h) from a browser's JSON; converts `…_unix_ms` to ns.
Status messageOf(nlohmann::json body, google::protobuf::Message& message);

/// Parses `"018f3a5e-…"` into 16 bytes. kNotFound for other text, because no session can have that name.
Result<std::string> sessionBytesOf(const std::string& text);

/// Decodes a list's `next_page` from the query. kInvalidInput.
Result<std::string> pageOf(const std::string& text);

}  // namespace needlelab
