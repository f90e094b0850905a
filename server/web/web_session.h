/// Who a browser is: its cookie, and the token against forged requests.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/live/tokens.h"

namespace needlelab {

inline constexpr std::string_view kSessionCookie = "__Host-needlelab";

struct WebSession {
  std::string token;  ///< as the store knows it
  Tokens::Holder holder;
};

/// Thread: the network's. The store must outlive it.
class WebSessions {
 public:
  explicit WebSessions(Tokens& tokens);

  /// From a Cookie header; nothing when there is none that lasts.
  std::optional<WebSession> find(std::string_view cookie_header, std::int64_t now_ns) const;
  /// The value of Set-Cookie for a new session, or (empty token) the one that takes the cookie away.
  static std::string cookieFor(std::string_view token);
  /// What a page has to send in X-CSRF-Token: only who can read the reply to a log-in knows it.
  [[nodiscard]] std::string csrfOf(std::string_view token) const;
  [[nodiscard]] bool csrfFits(std::string_view token, std::string_view given) const;

 private:
  Tokens& tokens_;
  std::array<unsigned char, 32> key_{};  // of this process
};

}  // namespace needlelab
