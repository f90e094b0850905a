#include "common/wire/endpoint.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>

#include "common/base/text/text.h"

namespace needlelab {

namespace {

std::string_view withoutBlanks(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

}  // namespace

Result<Endpoint> parseEndpoint(std::string_view typed) {
  std::string_view text = withoutBlanks(typed);
  if (const auto scheme = text.find("://");
      scheme != std::string_view::npos || text.find('#') != std::string_view::npos) {
    std::string_view host = scheme == std::string_view::npos ? text : text.substr(scheme + 3);
    host = host.substr(0, host.find_first_of(host.starts_with('[') ? "]/#" : ":/#"));
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("'{}' is the address of a page for browsers: programs take HOST:PORT with the port for "
                    "stations, e.g. {}{}:7750",
                    typed, host.empty() ? "lab.example" : host, host.starts_with('[') ? "]" : "")};
  }
  if (text.starts_with("//")) text.remove_prefix(2);
  if (text.ends_with('/')) text.remove_suffix(1);
  const auto bad = [&](const char* why) {
    return Error{ErrorCode::kInvalidInput, "'" + std::string(typed) + "' is no HOST:PORT (" + why +
                                               "), e.g. 127.0.0.1:7750 or [::1]:7750"};
  };
  Endpoint endpoint;
  std::string_view host = text, port;
  if (!text.empty() && text.front() == '[') {
    // [IPv6] or [IPv6]:port
    const auto end = text.find(']');
    if (end == std::string_view::npos) return bad("no closing bracket");
    host = text.substr(1, end - 1);
    if (host.find(':') == std::string_view::npos) return bad("in brackets stands an IPv6 address");
    const auto rest = text.substr(end + 1);
    if (!rest.empty()) {
      if (rest.front() != ':') return bad("after the bracket comes a colon");
      port = rest.substr(1);
      if (port.empty()) return bad("no port after the colon");
    }
  } else if (const auto colon = text.find(':'); colon != std::string_view::npos) {
    if (text.find(':', colon + 1) != std::string_view::npos) return bad("an IPv6 address needs brackets");
    host = withoutBlanks(text.substr(0, colon));
    port = withoutBlanks(text.substr(colon + 1));
    if (port.empty()) return bad("no port after the colon");
  }
  if (host.empty()) return bad("no host");
  for (const char c : host) {
    // colons and a zone (%eth0) are allowed in brackets only
    const std::string_view others = text.front() == '[' ? "-._:%" : "-._";
    if (!isLetterOrDigit(c) && others.find(c) == std::string_view::npos)
      return bad("a host has letters, digits, '-', '.' and '_', an address in brackets colons and '%', too");
  }
  endpoint.host = host;
  if (!port.empty()) {
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), endpoint.port);
    if (error != std::errc{} || end != port.data() + port.size())
      return bad("the port is a number from 0 to 65535");
  }
  return endpoint;
}

std::string endpointText(const Endpoint& endpoint) {
  const bool v6 = endpoint.host.find(':') != std::string::npos;
  return fmt::format("{}:{}", (v6 ? "[" + endpoint.host + "]" : endpoint.host), endpoint.port);
}

bool sameEndpoint(const Endpoint& a, const Endpoint& b) {
  return a.port == b.port && lowerCase(a.host) == lowerCase(b.host);
}

Result<Endpoints> parseEndpoints(std::string_view text) {
  const auto bad = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, "'" + std::string(text) + "' is no list of servers (" + why +
                                               "), e.g. a.example:7750,b.example:7750"};
  };
  const bool is_list = text.find(',') != std::string_view::npos;
  Endpoints all;
  for (std::string_view rest = text;;) {
    const auto comma = rest.find(',');
    std::string_view entry = rest.substr(0, comma);
    if (is_list) {
      entry = withoutBlanks(entry);
      if (entry.empty()) return bad("an entry is empty");
    }
    ASSIGN_OR_RETURN(auto endpoint, parseEndpoint(entry));
    if (std::any_of(all.begin(), all.end(),
                    [&](const Endpoint& known) { return sameEndpoint(known, endpoint); }))
      return bad(endpointText(endpoint) + " stands there twice");
    if (all.size() == kMaxEndpoints) return bad(fmt::format("it has more than {}", kMaxEndpoints));
    all.push_back(std::move(endpoint));
    if (comma == std::string_view::npos) return all;
    rest.remove_prefix(comma + 1);
  }
}

std::string endpointsText(const Endpoints& endpoints) {
  std::string text;
  for (const Endpoint& endpoint : endpoints) text += (text.empty() ? "" : ",") + endpointText(endpoint);
  return text;
}

}  // namespace needlelab
