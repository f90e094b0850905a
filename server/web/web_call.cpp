#include "server/web/web_call.h"

#include <fmt/core.h>
#include <sodium.h>

#include <charconv>
#include <utility>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxTarget = 2048;
constexpr std::size_t kMaxNames = 32;

Error targetFault(const std::string& text) {
  return {ErrorCode::kInvalidInput, "the address " + text};
}

/// Decodes %XX to bytes; in a query '+' is a space.
Result<std::string> unescaped(std::string_view text, bool is_query) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      const int high = i + 2 < text.size() ? hexDigit(text[i + 1]) : -1;
      const int low = i + 2 < text.size() ? hexDigit(text[i + 2]) : -1;
      if (high < 0 || low < 0) return targetFault("has a '%' without two hexadecimal digits");
      c = static_cast<char>(high * 16 + low);
      i += 2;
      if (!is_query && c == '/') return targetFault("has an escaped '/'");
    } else if (is_query && c == '+') {
      c = ' ';
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return targetFault("has control characters");
    plain += c;
  }
  if (!isUtf8(plain)) return targetFault("is not UTF-8");
  return plain;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

bool equalIgnoringCase(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (lowerCase(a[i]) != lowerCase(b[i])) return false;
  }
  return true;
}

Status takeQuery(std::string_view text, WebTarget& target) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('&'), text.size());
    const std::string_view pair = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (pair.empty()) continue;
    const std::size_t equals = std::min(pair.find('='), pair.size());
    ASSIGN_OR_RETURN(const auto name, unescaped(pair.substr(0, equals), true));
    ASSIGN_OR_RETURN(const auto value, unescaped(pair.substr(std::min(equals + 1, pair.size())), true));
    if (!target.query.emplace(name, value).second)
      return targetFault("gives '" + name.substr(0, 60) + "' twice");
    if (target.query.size() > kMaxNames) return targetFault("gives too many names");
  }
  return {};
}

}  // namespace

std::string WebTarget::path() const {
  if (segments.empty()) return "/";
  std::string all;
  for (const std::string& segment : segments) all += "/" + segment;
  return all;
}

Result<WebTarget> parseTarget(std::string_view target) {
  if (target.size() > kMaxTarget) return targetFault("has more than 2048 bytes");
  if (target.empty() || target.front() != '/') return targetFault("does not begin with '/'");
  WebTarget parsed;
  const std::size_t question = std::min(target.find('?'), target.size());
  std::string_view path = target.substr(1, question == 0 ? 0 : question - 1);
  while (!path.empty()) {
    const std::size_t end = std::min(path.find('/'), path.size());
    ASSIGN_OR_RETURN(auto segment, unescaped(path.substr(0, end), false));
    if (segment.empty()) return targetFault("has an empty part");
    if (segment == "." || segment == "..") return targetFault("has a part '" + segment + "'");
    parsed.segments.push_back(std::move(segment));
    path.remove_prefix(std::min(end + 1, path.size()));
  }
  if (question < target.size()) {
    RETURN_IF_ERROR(takeQuery(target.substr(question + 1), parsed));
  }
  return parsed;
}

std::string pathForLog(std::string_view target, std::string_view route) {
  const std::string_view path = target.substr(0, target.find('?'));
  if (route == "file") return std::string(path);
  const std::size_t begin = route.find(' ');
  constexpr std::string_view kApi = "/api/v1";
  if (begin == std::string_view::npos || !path.starts_with(kApi)) return "*";
  std::string_view pattern = route.substr(begin + 1), given = path.substr(kApi.size());
  std::string shown(kApi);
  // the route matches this path, so both have the same number of parts
  while (!pattern.empty() && !given.empty()) {
    const std::size_t pattern_end = std::min(pattern.find('/', 1), pattern.size());
    const std::size_t given_end = std::min(given.find('/', 1), given.size());
    const bool is_name = pattern.substr(0, pattern_end) == "/{name}";
    shown += is_name ? std::string_view("/*") : given.substr(0, given_end);
    pattern.remove_prefix(pattern_end);
    given.remove_prefix(given_end);
  }
  return shown;
}

std::optional<std::string> cookieNamed(std::string_view header, std::string_view name) {
  std::optional<std::string> found;
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(';'), header.size());
    const std::string_view pair = trimmed(header.substr(0, end));
    header.remove_prefix(std::min(end + 1, header.size()));
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos || trimmed(pair.substr(0, equals)) != name) continue;
    if (found) return std::nullopt;
    found = std::string(trimmed(pair.substr(equals + 1)));
  }
  return found;
}

Result<std::uint32_t> parseIfMatch(std::string_view header) {
  std::string_view text = trimmed(header);
  if (text.starts_with("W/")) text.remove_prefix(2);
  const Error fault{ErrorCode::kInvalidInput,
                    "If-Match: give the revision that was changed, in quotes, e.g. \"7\""};
  if (text.size() < 3 || text.front() != '"' || text.back() != '"') return fault;
  text = text.substr(1, text.size() - 2);
  std::uint32_t revision = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), revision);
  if (error != std::errc() || end != text.data() + text.size()) return fault;
  return revision;
}

bool isSameOrigin(std::string_view origin, std::string_view host) {
  constexpr std::string_view kScheme = "https://";
  if (host.empty() || origin.size() <= kScheme.size() ||
      !equalIgnoringCase(origin.substr(0, kScheme.size()), kScheme))
    return false;
  // the default port of https is 443 (RFC 6454, 4)
  const auto withoutDefault = [](std::string_view authority) {
    constexpr std::string_view kDefault = ":443";
    if (authority.ends_with(kDefault)) authority.remove_suffix(kDefault.size());
    return authority;
  };
  return equalIgnoringCase(withoutDefault(origin.substr(kScheme.size())), withoutDefault(host));
}

bool mayDemandHttps(std::string_view host) {
  if (host.starts_with('[')) return false;  // an IPv6 address
  std::string name = lowerCase(host.substr(0, host.find(':')));
  if (name.ends_with('.')) name.pop_back();
  const std::string_view last = std::string_view(name).substr(name.rfind('.') + 1);
  // the last part of a name is never a number (RFC 1123, 2.1), so this is an IPv4 address
  const bool is_number = last.find_first_not_of("0123456789") == std::string_view::npos;
  return !is_number && last != "localhost" && name != "localhost.localdomain";
}

bool isJsonType(std::string_view content_type) {
  return equalIgnoringCase(trimmed(content_type.substr(0, content_type.find(';'))), "application/json");
}

Result<std::uint64_t> wholeOf(std::string_view name, std::string_view text, std::uint64_t min,
                              std::uint64_t max) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size() && number >= min && number <= max)
    return number;
  return Error{ErrorCode::kInvalidInput, fmt::format("{}: '{}' is not a whole number from {} to {}", name,
                                                     printable(text.substr(0, 40)), min, max)};
}

Result<double> numberOf(std::string_view name, std::string_view text, double min, double max) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size() && number >= min && number <= max)
    return number;
  return Error{ErrorCode::kInvalidInput, fmt::format("{}: '{}' is not a number from {:f} to {:f}", name,
                                                     printable(text.substr(0, 40)), min, max)};
}

namespace {
constexpr std::string_view kBase64Url = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
}

std::string base64Url(std::string_view bytes) {
  std::string text;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char c : bytes) {
    held = (held << 8) | static_cast<unsigned char>(c);
    for (bits += 8; bits >= 6; bits -= 6) text += kBase64Url[(held >> (bits - 6)) & 63];
  }
  if (bits > 0) text += kBase64Url[(held << (6 - bits)) & 63];
  return text;
}

std::optional<std::string> bytesOfBase64Url(std::string_view text) {
  std::string bytes;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char c : text) {
    const std::size_t digit = kBase64Url.find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    held = (held << 6) | static_cast<std::uint32_t>(digit);
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      bytes += static_cast<char>((held >> bits) & 255);
    }
  }
  // only one encoding per text is valid: the remaining bits must be zero and fewer than a digit
  if (bits >= 6 || (held & ((1u << bits) - 1)) != 0) return std::nullopt;
  return bytes;
}

std::string WebCall::query(const std::string& name) const {
  const auto found = target.query.find(name);
  return found == target.query.end() ? std::string() : found->second;
}

// --- WebSessions

namespace {

std::optional<std::string> tokenOfCookie(std::string_view cookie_header) {
  const auto value = cookieNamed(cookie_header, kSessionCookie);
  if (!value || value->size() > 64) return std::nullopt;
  return bytesOfBase64Url(*value);
}

}  // namespace

WebSessions::WebSessions(LoginState& logins) : logins_(logins) {
  if (const auto shared = logins.formKey())
    key_ = *shared;
  else
    randombytes_buf(key_.data(), key_.size());
}

Task<Result<std::optional<WebSession>>> WebSessions::find(std::string cookie_header,
                                                          std::string asker) const {
  auto token = tokenOfCookie(cookie_header);
  if (!token) co_return std::optional<WebSession>();
  auto holder = co_await logins_.find(*token, std::move(asker));
  if (!holder.ok()) co_return holder.error();
  if (!*holder) co_return std::optional<WebSession>();
  co_return std::optional(WebSession{std::move(*token), std::move(**holder)});
}

bool WebSessions::mayBeSession(std::string_view cookie_header) const {
  const auto token = tokenOfCookie(cookie_header);
  return token && logins_.mayBeToken(*token);
}

std::string WebSessions::cookieFor(std::string_view token) {
  std::string cookie = std::string(kSessionCookie) + "=" + base64Url(token);
  if (token.empty()) cookie += "; Max-Age=0";
  // __Host-: only for this host, for all paths, over TLS
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
