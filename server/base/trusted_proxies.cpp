#include "server/base/trusted_proxies.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <span>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

namespace ip = boost::asio::ip;

constexpr std::size_t kMaxAddress = 64;  // characters of an address with its port

/// Maps IPv4 in IPv6 to IPv4. Nothing: not an address.
std::optional<ip::address> addressOf(std::string_view text) {
  if (text.size() > kMaxAddress) return std::nullopt;
  boost::system::error_code error;
  const ip::address address = ip::make_address(std::string(text), error);
  if (error) return std::nullopt;
  if (address.is_v6() && address.to_v6().is_v4_mapped())
    return ip::make_address_v4(ip::v4_mapped, address.to_v6());
  return address;
}

bool sameBits(std::span<const unsigned char> a, std::span<const unsigned char> b, unsigned bits) {
  for (unsigned bit = 0; bit < bits; ++bit) {
    const unsigned mask = 0x80u >> bit % 8;
    if ((a[bit / 8] & mask) != (b[bit / 8] & mask)) return false;
  }
  return true;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

bool isPort(std::string_view text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc() && end == text.data() + text.size();
}

/// ADDRESS, ADDRESS:PORT, [ADDRESS] or [ADDRESS]:PORT.
std::optional<ip::address> hostOf(std::string_view text) {
  if (text.starts_with('[')) {
    const std::size_t end = text.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view rest = text.substr(end + 1);
    if (!rest.empty() && (rest.front() != ':' || !isPort(rest.substr(1)))) return std::nullopt;
    return addressOf(text.substr(1, end - 1));
  }
  // one colon separates a port, several are an IPv6 address
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos || text.find(':', colon + 1) != std::string_view::npos)
    return addressOf(text);
  return isPort(text.substr(colon + 1)) ? addressOf(text.substr(0, colon)) : std::nullopt;
}

/// The address of "for" in an element of Forwarded: `for=192.0.2.60;proto=https`, `For="[2001:db8::1]:4711"`.
std::optional<ip::address> forOf(std::string_view element) {
  while (!element.empty()) {
    const std::size_t end = std::min(element.find(';'), element.size());
    const std::string_view pair = trimmed(element.substr(0, end));
    element.remove_prefix(std::min(end + 1, element.size()));
    if (pair.size() < 4 || lowerCase(pair[0]) != 'f' || lowerCase(pair[1]) != 'o' ||
        lowerCase(pair[2]) != 'r' || pair[3] != '=')
      continue;
    std::string_view value = pair.substr(4);
    if (value.size() >= 2 && value.front() == '"' && value.back() == '"')
      value = value.substr(1, value.size() - 2);
    return hostOf(value);
  }
  return std::nullopt;
}

std::string textOf(const ip::address& address) {
  return (address.is_v6() ? "[" + address.to_string() + "]" : address.to_string()) + ":0";
}

}  // namespace

Result<TrustedProxies> TrustedProxies::parse(const std::vector<std::string>& networks,
                                             const std::string& header) {
  TrustedProxies proxies;
  if (header == "Forwarded")
    proxies.header_ = Header::kForwarded;
  else if (header != "X-Forwarded-For")
    return Error{ErrorCode::kInvalidInput,
                 "--web-proxy-header '" + header + "': give X-Forwarded-For or Forwarded"};
  for (const std::string& text : networks) {
    const Error fault{ErrorCode::kInvalidInput, "--web-proxy '" + text +
                                                    "': give ADDRESS or ADDRESS/BITS, e.g. 192.0.2.7 or "
                                                    "2001:db8::/64"};
    const std::size_t slash = text.find('/');
    const auto address = addressOf(std::string_view(text).substr(0, slash));
    if (!address) return fault;
    const unsigned most = address->is_v4() ? 32 : 128;
    unsigned bits = most;
    if (slash != std::string::npos) {
      const char* const end = text.data() + text.size();
      const auto [last, error] = std::from_chars(text.data() + slash + 1, end, bits);
      if (error != std::errc() || last != end || bits > most) return fault;
    }
    proxies.networks_.push_back({*address, bits});
  }
  return proxies;
}

bool TrustedProxies::trusts(std::string_view host) const {
  const auto address = networks_.empty() ? std::nullopt : addressOf(host);
  if (!address) return false;
  return std::any_of(networks_.begin(), networks_.end(), [&](const Network& network) {
    if (network.address.is_v4() != address->is_v4()) return false;
    if (address->is_v4())
      return sameBits(network.address.to_v4().to_bytes(), address->to_v4().to_bytes(), network.bits);
    return sameBits(network.address.to_v6().to_bytes(), address->to_v6().to_bytes(), network.bits);
  });
}

std::string TrustedProxies::clientOf(const std::string& peer, std::string_view value) const {
  const auto proxy = networks_.empty() ? std::nullopt : hostOf(peer);
  if (!proxy || !trusts(proxy->to_string())) return peer;
  std::string client = peer;
  while (!value.empty()) {
    const std::size_t comma = value.rfind(',');
    const std::string_view last = trimmed(comma == std::string_view::npos ? value : value.substr(comma + 1));
    value = comma == std::string_view::npos ? std::string_view() : value.substr(0, comma);
    const auto address = header_ == Header::kForwarded ? forOf(last) : hostOf(last);
    if (!address) break;
    client = textOf(*address);
    if (!trusts(address->to_string())) break;
  }
  return client;
}

}  // namespace needlelab
