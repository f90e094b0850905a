/// Messages of the wire as a browser reads them, and back: the one place where their forms differ.
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "server/base/http_message.h"

namespace needlelab {

/// All fields in the order of the .proto, in snake_case; those of a message or a list only when they are
/// there. Different from the canonical JSON of common/profile:
/// - times `…_unix_ns` are `…_unix_ms`, numbers with a fraction: ns are too many digits for JavaScript;
///   null for 0, what has not happened;
/// - `session_id` is the UUID's text, `hash` and other bytes are hexadecimal, `next_page` is base64url;
/// - texts that are JSON themselves (`json`, `…_json`, `records`) are objects and lists; without the `_json`.
WebJson jsonOf(const google::protobuf::Message& message);

/// Fills `message` strictly (profile/message_json.h) from what a browser sent; `…_unix_ms` become ns.
Status messageOf(nlohmann::json body, google::protobuf::Message& message);

/// `"018f3a5e-…"` to the 16 bytes. kNotFound for other text: nothing has such a name.
Result<std::string> sessionBytesOf(const std::string& text);

/// A list's `next_page` back from the query. kInvalidInput.
Result<std::string> pageOf(const std::string& text);

}  // namespace needlelab
