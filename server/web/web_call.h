/// What a browser asks, taken apart: target, cookies, conditions. Everything here comes from strangers.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/service/principal.h"

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

}  // namespace needlelab
