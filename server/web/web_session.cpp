#include "server/web/web_session.h"

#include <sodium.h>

#include "server/web/web_call.h"

namespace needlelab {

WebSessions::WebSessions(Tokens& tokens) : tokens_(tokens) {
  randombytes_buf(key_.data(), key_.size());
}

std::optional<WebSession> WebSessions::find(std::string_view cookie_header, std::int64_t now_ns) const {
  const auto value = cookieNamed(cookie_header, kSessionCookie);
  if (!value || value->size() > 64) return std::nullopt;
  auto token = bytesOfBase64Url(*value);
  if (!token) return std::nullopt;
  auto holder = tokens_.find(*token, now_ns);
  if (!holder) return std::nullopt;
  return WebSession{std::move(*token), std::move(*holder)};
}

std::string WebSessions::cookieFor(std::string_view token) {
  std::string cookie = std::string(kSessionCookie) + "=" + base64Url(token);
  if (token.empty()) cookie += "; Max-Age=0";
  // __Host-: from this host only, for all of it, and over TLS
  return cookie + "; Path=/; Secure; HttpOnly; SameSite=Strict";
}

std::string WebSessions::csrfOf(std::string_view token) const {
  std::array<unsigned char, 32> hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(token.data()),
                     token.size(), key_.data(), key_.size());
  return base64Url({reinterpret_cast<const char*>(hash.data()), hash.size()});
}

bool WebSessions::csrfFits(std::string_view token, std::string_view given) const {
  const std::string wanted = csrfOf(token);
  return given.size() == wanted.size() && sodium_memcmp(given.data(), wanted.data(), wanted.size()) == 0;
}

}  // namespace needlelab
