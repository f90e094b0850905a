/// Parses untrusted JSON text into a tree and refuses anything doubtful.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// Refused: over `max_bytes`, not UTF-8, syntax errors, text after the end, a key given twice, numbers too
/// large for a double, nesting over 32. Errors: kInvalidInput, `SOURCE: PATH: words`; syntax errors name line
/// and column.
Result<nlohmann::json> readStrictJson(std::string_view text, std::string_view source, std::size_t max_bytes);

/// Parses foreign JSON that we only pass on. Omits anything nested deeper than 64, because writing or freeing
/// it takes one stack frame per level and a megabyte can hold a million levels. Returns a discarded value if
/// the text is not JSON.
template <typename Json>
Json readShallowJson(std::string_view text) {
  constexpr int kMostDepth = 64;
  return Json::parse(
      text, [](int depth, auto, const Json&) { return depth <= kMostDepth; }, false);
}

/// Returns `PATH: words`, or just the words if the path is empty.
Error fieldError(const std::string& path, const std::string& words);

/// `text` as a JSON string, cut after about 60 bytes: safe to print in a message.
std::string quotedText(std::string_view text);

}  // namespace needlelab
