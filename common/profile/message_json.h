/// Converts messages from and to JSON, using their descriptors and the options in options.proto: messages of
/// profile.proto in both directions, requests (server/web) from JSON only.
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Fills the empty `message` from `value`. Each field must have a known name (in either case), occur once,
/// have the right type, and meet the range, size and presence in its options; exactly one field of each oneof
/// must be set. Enumerators are given by name, never `…_UNSPECIFIED`. Errors: kInvalidInput, `PATH: words`,
/// without a source.
Status readMessage(const nlohmann::json& value, google::protobuf::Message& message);

/// As readMessage, but continues after each fault and returns all of them, at most 200; `message` gets the
/// readable fields.
std::vector<Error> messageFaults(const nlohmann::json& value, google::protobuf::Message& message);

/// Writes the message's fields in the order of its .proto, in snake_case; writes a `required` list even when
/// it is empty. Objects and lists that fit into one line stay on one line. Ends with a newline.
std::string writeMessage(const google::protobuf::Message& message);

}  // namespace needlelab
