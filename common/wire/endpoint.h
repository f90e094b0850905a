/// HOST:PORT as written on command lines, one or several.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

struct Endpoint {
  std::string host = "127.0.0.1";  ///< a name or an IP address, without brackets
  std::uint16_t port = 7750;
};

/// Parses "host:port", "[::1]:7750", or a host alone (port 7750). Errors: kInvalidInput with the text.
Result<Endpoint> parseEndpoint(std::string_view text);
/// The inverse of parseEndpoint; encloses an IPv6 address in brackets.
std::string endpointText(const Endpoint& endpoint);
/// Whether both are written the same, ignoring the case of names.
bool sameEndpoint(const Endpoint& a, const Endpoint& b);

/// The equivalent servers of one lab, in the order in which they were given; at least one.
using Endpoints = std::vector<Endpoint>;
inline constexpr std::size_t kMaxEndpoints = 16;

/// Parses "a:7750,b:7750" or a single one; blanks around commas are allowed. Errors: kInvalidInput: as
/// parseEndpoint, an empty entry, a duplicate, more than kMaxEndpoints.
Result<Endpoints> parseEndpoints(std::string_view text);
/// The inverse of parseEndpoints.
std::string endpointsText(const Endpoints& endpoints);

}  // namespace needlelab
