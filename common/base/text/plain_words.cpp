#include "common/base/text/plain_words.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <iterator>

#include "common/base/text/text.h"
#include "common/base/text/uuid.h"

namespace needlelab {
namespace {

bool isTokenCharacter(char c) {
  return isLetterOrDigit(c) || c == '_' || c == '-' || c == '.' || c == '+';
}

/// "NOT_FOUND"; a single word in capitals may be an abbreviation.
bool isEnumerator(std::string_view token) {
  return token.find('_') != std::string_view::npos && token.front() != '_' &&
         std::ranges::all_of(token, [](char c) { return (c >= 'A' && c <= 'Z') || c == '_'; });
}

std::string shortNumber(std::string_view token) {
  double value = 0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  const bool is_decimal = token.find('.') != std::string_view::npos;
  if (error != std::errc() || end != token.data() + token.size() || !is_decimal) return std::string(token);
  std::string rounded = fmt::format("{:.6g}", value);
  return rounded.size() < token.size() ? rounded : std::string(token);
}

void addId(std::string& text) {
  constexpr std::string_view kNone = "no session ", kOne = "session ";
  if (text.ends_with(kNone))
    text.replace(text.size() - kNone.size(), kNone.size(), "no such session");
  else if (text.ends_with(kOne))
    text.replace(text.size() - kOne.size(), kOne.size(), "this session");
  else if (text.ends_with(' '))
    text.pop_back();
}

}  // namespace

std::string plainWords(std::string_view message) {
  std::string text, whole(message);
  // errorOf(Refusal) of common/wire
  constexpr std::string_view kRefused = "the peer refused (", kEnd = "): ";
  for (std::size_t at = whole.find(kRefused), end; at != std::string::npos; at = whole.find(kRefused, at))
    if (end = whole.find(kEnd, at); end == std::string::npos)
      break;
    else
      whole.erase(at, end + kEnd.size() - at);
  message = whole;
  while (!message.empty()) {
    const auto after = std::ranges::find_if_not(message, isTokenCharacter);
    auto token = message.substr(0, static_cast<std::size_t>(after - message.begin()));
    if (token.ends_with('.')) token.remove_suffix(1);  // of the sentence
    if (parseUuid(token).ok())
      addId(text);
    else if (!token.empty() && isEnumerator(token))
      std::ranges::replace_copy(lowerCase(token), std::back_inserter(text), '_', ' ');
    else
      text += token.empty() ? std::string(1, message.front()) : shortNumber(token);
    message.remove_prefix(std::max<std::size_t>(token.size(), 1));
  }
  return text;
}

}  // namespace needlelab
