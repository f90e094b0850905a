/// Parses untrusted JSON text into a tree and refuses everything doubtful.
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

/// Parses JSON that others wrote and we only pass on. What is nested deeper than 64 is left out: writing it,
/// or freeing it, would take a stack frame a level, and a megabyte can nest a million. Returns a discarded
/// value for what is not JSON.
template <typename Json>
Json readShallowJson(std::string_view text) {
  constexpr int kMostDepth = 64;
  return Json::parse(
      text, [](int depth, auto, const Json&) { return depth <= kMostDepth; }, false);
}

/// Returns `PATH: words`, or the words alone if the path is empty.
Error fieldError(const std::string& path, const std::string& words);

/// `text` as a JSON string, cut after some 60 bytes: safe to print in a message.
std::string quotedText(std::string_view text);

}  // namespace needlelab
