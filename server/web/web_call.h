/// Parsers for a browser's request: target, cookies, conditions. All input is untrusted.
#pragma once

#include <google/protobuf/message.h>

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/service/requests/requests.h"
#include "server/base/http_message.h"
#include "server/live/login/login_state.h"

namespace needlelab {

// --- converts wire messages to the browser's JSON and back: the only place that defines their differences

/// Returns all fields in the order of the .proto, in snake_case; omits absent messages and lists. Differences
/// from the canonical JSON of common/profile:
/// - times `…_unix_ns` become `…_unix_ms`, numbers with a fraction, because ns have too many digits for
///   JavaScript; 0 (has not happened) becomes null;
/// - `session_id` is the UUID's text, `hash` and other bytes are hexadecimal, `next_page` is base64url;
/// - texts that contain JSON (`json`, `…_json`, `records`) become objects and lists; their names lose
///   `_json`.
WebJson jsonOf(const google::protobuf::Message& message);

/// Fills `message` strictly (profile/message_json.h) from a browser's JSON; converts `…_unix_ms` to ns.
Status messageOf(nlohmann::json body, google::protobuf::Message& message);

/// Parses `"018f3a5e-…"` into 16 bytes. kNotFound for other text, because no session can have that name.
Result<std::string> sessionBytesOf(const std::string& text);

/// Decodes a list's `next_page` from the query. kInvalidInput.
Result<std::string> pageOf(const std::string& text);

/// `/api/v1/people/anna%20b?page=x`: segments and query decoded.
struct WebTarget {
  std::vector<std::string> segments;
  std::map<std::string, std::string> query;
  /// Each decoded segment with '/' before it; "/" without segments.
  [[nodiscard]] std::string path() const;
};

/// Accepts origin form only. Refuses: over 2048 bytes, control characters, bytes that are not UTF-8 after
/// decoding, broken escapes, empty segments other than the last, "." and "..", '/' or NUL in an escape, a
/// duplicate name, more than 32 names. Errors: kInvalidInput.
Result<WebTarget> parseTarget(std::string_view target);
/// An address's path for the log, with "*" instead of people's names and of addresses that this server does
/// not have, which may contain anything, e.g. a name or a password. `route`: "GET /people/{name}", "file", or
/// empty if no route was found.
std::string pathForLog(std::string_view target, std::string_view route);

/// The value of a cookie in a Cookie header; nothing when it is missing or duplicated.
std::optional<std::string> cookieNamed(std::string_view header, std::string_view name);

/// Parses `"7"` or `W/"7"` as a revision. kInvalidInput for anything else.
Result<std::uint32_t> parseIfMatch(std::string_view header);

/// True if the request comes from a page of this server: `origin` is https:// and `host`.
bool isSameOrigin(std::string_view origin, std::string_view host);

/// False if `host` (a Host header) is an address or a name of this machine itself: a browser told to use only
/// HTTPS for localhost would do so for all other programs on its machine, too.
bool mayDemandHttps(std::string_view host);

/// True for "application/json" with or without parameters.
bool isJsonType(std::string_view content_type);

/// Parses a query's whole number. kInvalidInput names `name` and the allowed range.
Result<std::uint64_t> wholeOf(std::string_view name, std::string_view text, std::uint64_t min,
                              std::uint64_t max);
/// Parses a query's finite decimal number within [min, max]. kInvalidInput.
Result<double> numberOf(std::string_view name, std::string_view text, double min, double max);

/// RFC 4648 §5, without padding. The inverse returns nothing for invalid text.
std::string base64Url(std::string_view bytes);
std::optional<std::string> bytesOfBase64Url(std::string_view text);

/// One API request during its processing.
struct WebCall {
  WebTarget target;
  std::vector<std::string> parts;              ///< the values of {…} in the route's pattern
  nlohmann::json body;                         ///< null: no body, or `request` has been built from it
  std::shared_ptr<const pb::Request> request;  ///< null: not built yet
  std::size_t body_bytes = 0;                  ///< of the body's text
  std::optional<std::uint32_t> if_match;       ///< the change's base revision
  Principal who;

  /// A query parameter; empty when absent.
  [[nodiscard]] std::string query(const std::string& name) const;
};

/// A reply that takes long to make, in steps; between them other work has its turn.
struct WebSteps {
  /// Does one step; returns the reply with the last one, otherwise nothing. On a worker's thread, one call at
  /// a time.
  std::function<Result<std::optional<WebJson>>()> step;
};

/// A piece of a stream has at most kMaxPieceBytes, including what is kept for the next one
/// (kMaxHeldByStream). While making a piece, a download holds this much of the budget of unread replies;
/// afterwards the piece's actual length instead of the maximum.
inline constexpr std::size_t kMaxPieceBytes = 5u << 20, kMaxHeldByStream = 1u << 20;

/// A piece of a stream. Nothing: no text yet, call again. Empty text: the end.
using WebPiece = std::optional<std::string>;

/// A reply too long to hold in memory, made piece by piece.
struct WebStream {
  std::string type;       ///< Content-Type
  std::string file_name;  ///< the name suggested to the browser; letters, digits, '-', '_', '.'
  /// Makes the next piece. Each call is limited in work as well as in text, so that others get turns in
  /// between and a disconnected browser ends the stream. On a worker's thread, one call at a time.
  std::function<Result<WebPiece>()> next;
};

// --- browser sessions: the cookie, and the token against forged requests

inline constexpr std::string_view kSessionCookie = "__Host-needlelab";

struct WebSession {
  std::string token;  ///< as stored
  Tokens::Holder holder;
};

/// Thread: the network's. `logins` must outlive it.
class WebSessions {
 public:
  explicit WebSessions(LoginState& logins);

  /// Finds the session of a Cookie header; nothing without a valid session. `asker`: as in
  /// LoginState::find(). kUnavailable: the database is unreachable.
  Task<Result<std::optional<WebSession>>> find(std::string cookie_header, std::string asker) const;
  /// Whether a Cookie header may belong to a session, without a database look-up.
  [[nodiscard]] bool mayBeSession(std::string_view cookie_header) const;
  /// The Set-Cookie value for a new session, or, for an empty token, one that deletes the cookie.
  static std::string cookieFor(std::string_view token);
  /// The text that a page must send in X-CSRF-Token. Only a page that can read the log-in's reply knows it.
  [[nodiscard]] std::string csrfOf(std::string_view token) const;
  [[nodiscard]] bool csrfFits(std::string_view token, std::string_view given) const;

 private:
  LoginState& logins_;
  std::array<unsigned char, 32> key_{};  // of this process, or of all servers that work together
};

}  // namespace needlelab
