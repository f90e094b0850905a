/// The client's address behind reverse proxies.
#pragma once

#include <boost/asio/ip/address.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Which peers are reverse proxies, and which header they write. A proxy appends its client's address to the
/// header, so it is read from the end: the first address that is not a trusted proxy is the client. Anything
/// before it is unverified. Immutable once made.
class TrustedProxies {
 public:
  enum class Header {
    kXForwardedFor,  ///< X-Forwarded-For: ADDRESS, ADDRESS …
    kForwarded,      ///< Forwarded: for=ADDRESS;…, for=ADDRESS;… (RFC 7239)
  };

  /// Trusts no proxy.
  TrustedProxies() = default;
  /// `networks`: ADDRESS or ADDRESS/BITS, IPv4 or IPv6. Only `header` is believed: a proxy that writes one of
  /// the two headers passes the other on unchanged. Errors: kInvalidInput, with the option's name.
  static Result<TrustedProxies> parse(const std::vector<std::string>& networks, const std::string& header);

  /// `host`: an address without port; IPv4 in IPv6 counts as IPv4.
  [[nodiscard]] bool trusts(std::string_view host) const;
  [[nodiscard]] Header header() const { return header_; }

  /// The client of a request as HOST:PORT. `peer`: HOST:PORT of the connection. A peer that is not trusted is
  /// itself the client. `value`: the header's values, joined by commas; if its end cannot be parsed, the
  /// proxy counts as the client. Port 0: the header has no port.
  [[nodiscard]] std::string clientOf(const std::string& peer, std::string_view value) const;

 private:
  struct Network {
    boost::asio::ip::address address;
    unsigned bits = 0;
  };
  std::vector<Network> networks_;
  Header header_ = Header::kXForwardedFor;
};

}  // namespace needlelab
