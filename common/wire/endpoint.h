/// HOST:PORT as written on command lines, alone or several of them.
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
/// The inverse; encloses an IPv6 address in brackets.
std::string endpointText(const Endpoint& endpoint);
/// Whether both are the same as written: a name's case does not count.
bool sameEndpoint(const Endpoint& a, const Endpoint& b);

/// The servers of one lab, any of which will do, in the order in which they were written; at least one.
using Endpoints = std::vector<Endpoint>;
inline constexpr std::size_t kMostEndpoints = 16;

/// Parses "a:7750,b:7750", or one alone; blanks may stand around a comma. Errors: kInvalidInput: as
/// parseEndpoint, an empty entry, one that is named twice, more than kMostEndpoints.
Result<Endpoints> parseEndpoints(std::string_view text);
/// The inverse.
std::string endpointsText(const Endpoints& endpoints);

}  // namespace needlelab
