/// The client's address behind reverse proxies.
#pragma once

#include <boost/asio/ip/address.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Which peers are reverse proxies, and which header they write. A proxy appends the address of its own
/// client to what came, so the header is read from its end: the first address that is no trusted proxy is the
/// client's; what stands before it is only what that client says. Immutable once made.
class TrustedProxies {
 public:
  enum class Header {
    kXForwardedFor,  ///< X-Forwarded-For: ADDRESS, ADDRESS …
    kForwarded,      ///< Forwarded: for=ADDRESS;…, for=ADDRESS;… (RFC 7239)
  };

  /// Trusts nobody.
  TrustedProxies() = default;
  /// `networks`: ADDRESS or ADDRESS/BITS, IPv4 or IPv6. Only `header` is believed: a proxy that writes one of
  /// the two passes the other on as its client sent it. Errors: kInvalidInput, with the option's name.
  static Result<TrustedProxies> parse(const std::vector<std::string>& networks, const std::string& header);

  /// `host`: an address without port; IPv4 in IPv6 counts as IPv4.
  [[nodiscard]] bool trusts(std::string_view host) const;
  [[nodiscard]] Header header() const { return header_; }

  /// The client of a request as HOST:PORT. `peer`: HOST:PORT of the connection. A peer that is not trusted is
  /// the client itself. `value`: the values of the header, joined by commas; when its end cannot be read, the
  /// proxy itself counts as the client. Port 0: known from a header without a port.
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
