/// Messages from and to JSON, by their descriptors and the options of options.proto: those of profile.proto
/// both ways, those of requests (server/web) from it.
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Fills `message` (empty before) from `value`. Each field: known name in either case, given once, of its
/// type, within the range, size and presence that its options say; of each oneof exactly one. Enumerators by
/// name, none of them `…_UNSPECIFIED`. Errors: kInvalidInput, `PATH: words`, without a source.
Status readMessage(const nlohmann::json& value, google::protobuf::Message& message);

/// The same, but reads on behind each fault: all of them, at most 200; `message` holds what could be read.
std::vector<Error> messageFaults(const nlohmann::json& value, google::protobuf::Message& message);

/// The message's fields in the order of its .proto, in snake_case; a list that is `required` is written when
/// empty, too. Objects and lists that fit into one line stand on one line. Ends with a newline.
std::string writeMessage(const google::protobuf::Message& message);

}  // namespace needlelab
