/// The parts of a browser's request: target, cookies, conditions. Everything here comes from strangers.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/service/requests.h"
#include "server/live/tokens.h"

namespace needlelab {

/// `/api/v1/people/anna%20b?page=x`: segments and query decoded.
struct WebTarget {
  std::vector<std::string> segments;
  std::map<std::string, std::string> query;
  [[nodiscard]] std::string path() const;  ///< decoded segments with '/' before each; "/" for none
};

/// Origin form only. Refused: over 2048 bytes, control characters, bytes that are no UTF-8 after decoding,
/// broken escapes, empty segments other than the last, "." and "..", '/' or NUL in an escape, a name twice,
/// more than 32 names. Errors: kInvalidInput.
Result<WebTarget> parseTarget(std::string_view target);

/// The value of a cookie in a Cookie header; nothing when it is not there or is there twice.
std::optional<std::string> cookieNamed(std::string_view header, std::string_view name);

/// `"7"` or `W/"7"`: a revision. kInvalidInput for anything else.
Result<std::uint32_t> parseIfMatch(std::string_view header);

/// True when a page of this server asked: `origin` is https:// and `host`.
bool isSameOrigin(std::string_view origin, std::string_view host);

/// True for "application/json" with or without parameters.
bool isJsonType(std::string_view content_type);

/// A whole number of a query. kInvalidInput names `name` and the allowed range.
Result<std::uint64_t> wholeOf(std::string_view name, std::string_view text, std::uint64_t min,
                              std::uint64_t max);
/// A finite decimal number of a query, within [min, max]. kInvalidInput.
Result<double> numberOf(std::string_view name, std::string_view text, double min, double max);

/// RFC 4648 §5, without padding. The inverse gives nothing for other text.
std::string base64Url(std::string_view bytes);
std::optional<std::string> bytesOfBase64Url(std::string_view text);

/// One request of the API on its way to an answer.
struct WebCall {
  WebTarget target;
  std::vector<std::string> parts;         ///< what stood for the {…} of the route's pattern
  nlohmann::json body;                    ///< null: there was none
  std::size_t body_bytes = 0;             ///< of its text
  std::optional<std::uint32_t> if_match;  ///< revision that a change was made from
  Principal who;

  /// Of the query; empty when absent.
  [[nodiscard]] std::string query(const std::string& name) const;
};

/// A reply that is longer than one wants to hold: made piece by piece. The seam for formats of export: each
/// is one function that opens such a stream.
struct WebStream {
  std::string type;       ///< Content-Type
  std::string file_name;  ///< that a browser offers; letters, digits, '-', '_', '.'
  /// The next piece, empty at the end. On a worker's thread, one call at a time.
  std::function<Result<std::string>()> next;
};

// --- the session of a browser: its cookie, and the token against forged requests

inline constexpr std::string_view kSessionCookie = "__Host-needlelab";

struct WebSession {
  std::string token;  ///< as the store knows it
  Tokens::Holder holder;
};

/// Thread: the network's. The store must outlive it.
class WebSessions {
 public:
  explicit WebSessions(Tokens& tokens);

  /// From a Cookie header; nothing when it names no session that lasts.
  std::optional<WebSession> find(std::string_view cookie_header, std::int64_t now_ns) const;
  /// The value of Set-Cookie for a new session, or (empty token) the one that takes the cookie away.
  static std::string cookieFor(std::string_view token);
  /// The text that a page must send in X-CSRF-Token: only a page that can read the reply to a log-in knows
  /// it.
  [[nodiscard]] std::string csrfOf(std::string_view token) const;
  [[nodiscard]] bool csrfFits(std::string_view token, std::string_view given) const;

 private:
  Tokens& tokens_;
  std::array<unsigned char, 32> key_{};  // of this process
};

}  // namespace needlelab
