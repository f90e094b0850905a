/// HOST:PORT as written on command lines.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

struct Endpoint {
  std::string host = "127.0.0.1";  ///< a name or an IP address, without brackets
  std::uint16_t port = 7750;
};

/// Parses "host:port", "[::1]:7750", or a host alone (port 7750). Errors: kInvalidInput with the text.
Result<Endpoint> parseEndpoint(std::string_view text);
/// The inverse; encloses an IPv6 address in brackets.
std::string endpointText(const Endpoint& endpoint);

}  // namespace needlelab
