#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "common/base/text.h"

namespace needlelab {
namespace {

Error invalid(std::string_view field, const std::string& why) {
  return {ErrorCode::kInvalidInput, std::string(field) + ": " + why};
}

Status check(std::string_view field, std::string_view value, std::size_t min, std::size_t max, bool lines) {
  if (value.size() < min || value.size() > max) {
    return invalid(field, fmt::format("has {} bytes, allowed are {} to {}", value.size(), min, max));
  }
  if (!isUtf8(value)) return invalid(field, "is no valid UTF-8 text");
  const auto is_control = [&](char c) {
    const auto code = static_cast<unsigned char>(c);
    return (code < 0x20 && !(lines && (c == '\n' || c == '\r' || c == '\t'))) || code == 0x7f;
  };
  // U+0080 to U+009F are control characters, too: a terminal takes U+009B for ESC [
  bool c1 = false;
  for (std::size_t i = 0; i + 1 < value.size(); ++i) {
    c1 = c1 || (value[i] == '\xc2' && static_cast<unsigned char>(value[i + 1]) < 0xa0);
  }
  if (c1 || std::any_of(value.begin(), value.end(), is_control))
    return invalid(field, "holds a control character");
  return {};
}

}  // namespace

bool isUtf8(std::string_view text) {
  std::size_t i = 0;
  while (i < text.size()) {
    const auto lead = static_cast<unsigned char>(text[i]);
    if (lead == 0) return false;
    if (lead < 0x80) {
      ++i;
      continue;
    }
    const int more = lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
    if (lead < 0xc2 || lead > 0xf4 || text.size() - i <= static_cast<std::size_t>(more)) return false;
    std::uint32_t point = lead & (0x3fu >> more);
    for (int k = 1; k <= more; ++k) {
      const auto next = static_cast<unsigned char>(text[i + static_cast<std::size_t>(k)]);
      if ((next & 0xc0) != 0x80) return false;
      point = point << 6 | (next & 0x3fu);
    }
    constexpr std::uint32_t kLeast[] = {0, 0x80, 0x800, 0x10000};
    if (point < kLeast[more] || point > 0x10ffff || (point >= 0xd800 && point <= 0xdfff)) return false;
    i += static_cast<std::size_t>(more) + 1;
  }
  return true;
}

std::string printable(std::string_view text) {
  std::string out(text);
  const bool utf8 = std::find(out.begin(), out.end(), '\0') == out.end() && isUtf8(out);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto code = static_cast<unsigned char>(out[i]);
    if (code < 0x20 || code == 0x7f || (code >= 0x80 && !utf8)) out[i] = '?';
    // U+0080 to U+009F
    if (code == 0xc2 && utf8 && static_cast<unsigned char>(out[i + 1]) < 0xa0) out[i] = out[i + 1] = '?';
  }
  return out;
}

std::string fixedText(double value, int decimals, Sign sign) {
  std::string text = sign == Sign::kBoth ? fmt::format("{:+.{}f}", value, decimals)
                                         : fmt::format("{:.{}f}", value, decimals);
  if (text.find_first_not_of("+-0.") == std::string::npos && (text[0] == '-' || text[0] == '+'))
    text.erase(0, 1);
  return text;
}

std::string lowerCase(std::string_view text) {
  std::string small(text);
  for (char& c : small) c = lowerCase(c);
  return small;
}

Status checkText(std::string_view field, std::string_view value, std::size_t min, std::size_t max) {
  return check(field, value, min, max, false);
}

Status checkName(std::string_view field, std::string_view value) {
  RETURN_IF_ERROR(check(field, value, 1, kMaxNameBytes, false));
  if (value.front() == ' ' || value.back() == ' ') return invalid(field, "begins or ends with a space");
  return {};
}

Status checkNewName(std::string_view field, std::string_view value) {
  RETURN_IF_ERROR(checkName(field, value));
  if (value.find('/') != std::string_view::npos)
    return invalid(field, "holds a '/', which addresses of the web use for themselves: take '-' or a space");
  if (value == "." || value == "..")
    return invalid(field, "is '" + std::string(value) + "', which is a folder's");
  return {};
}

Status checkNote(std::string_view field, std::string_view value, std::size_t min, std::size_t max) {
  return check(field, value, min, max, true);
}

Status checkCode(std::string_view code) {
  if (code.size() < kMinCodeBytes || code.size() > kMaxCodeBytes)
    return Error{ErrorCode::kInvalidInput, fmt::format("code: has {} characters, allowed are {} to {}",
                                                       code.size(), kMinCodeBytes, kMaxCodeBytes)};
  if (!std::all_of(code.begin(), code.end(), [](char c) { return c >= ' ' && c <= '~'; }))
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("code: has a character that is no printable ASCII: allowed are {} to {} letters "
                             "without accents, digits, and signs",
                             kMinCodeBytes, kMaxCodeBytes)};
  return {};
}

}  // namespace needlelab
