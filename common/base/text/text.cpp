#include "common/base/text/text.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

namespace needlelab {
namespace {

/// Invisible characters. client/web/app/lib/visible_text.js has the same table for the console.
struct HiddenCharacters {
  std::uint32_t first, last;
  const char* name;
};
constexpr HiddenCharacters kHidden[] = {
    {0x00ad, 0x00ad, "soft hyphen"},
    {0x061c, 0x061c, "Arabic letter mark"},
    {0x180e, 0x180e, "Mongolian vowel separator"},
    {0x200b, 0x200b, "zero width space"},
    {0x200c, 0x200c, "zero width non-joiner"},
    {0x200d, 0x200d, "zero width joiner"},
    {0x200e, 0x200e, "left-to-right mark"},
    {0x200f, 0x200f, "right-to-left mark"},
    {0x2028, 0x2028, "line separator"},
    {0x2029, 0x2029, "paragraph separator"},
    {0x202a, 0x202a, "left-to-right embedding"},
    {0x202b, 0x202b, "right-to-left embedding"},
    {0x202c, 0x202c, "pop directional formatting"},
    {0x202d, 0x202d, "left-to-right override"},
    {0x202e, 0x202e, "right-to-left override"},
    {0x2060, 0x2060, "word joiner"},
    {0x2061, 0x2064, "invisible operator"},
    {0x2066, 0x2066, "left-to-right isolate"},
    {0x2067, 0x2067, "right-to-left isolate"},
    {0x2068, 0x2068, "first strong isolate"},
    {0x2069, 0x2069, "pop directional isolate"},
    {0x206a, 0x206f, "deprecated format character"},
    {0xfeff, 0xfeff, "zero width no-break space"},
    {0xfff9, 0xfffb, "interlinear annotation"},
    {0xe0000, 0xe007f, "tag"},
};
// U+200C and U+200D may stand between characters from here on, i.e. beyond Latin, Greek and Cyrillic letters
constexpr std::uint32_t kFirstJoined = 0x0590;

struct Character {
  std::uint32_t point = 0;
  std::size_t bytes = 0;
};

/// The character at byte `at` of valid UTF-8; nothing at the end.
Character characterAt(std::string_view text, std::size_t at) {
  if (at >= text.size()) return {};
  const auto lead = static_cast<unsigned char>(text[at]);
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : lead >= 0x80 ? 2 : 1;
  std::uint32_t point = bytes == 1 ? lead : lead & (0x7fu >> bytes);
  for (std::size_t k = 1; k < bytes; ++k)
    point = point << 6 | (static_cast<unsigned char>(text[at + k]) & 0x3fu);
  return {point, bytes};
}

const char* hiddenName(std::uint32_t point) {
  for (const HiddenCharacters& row : kHidden)
    if (point >= row.first && point <= row.last) return row.name;
  return nullptr;
}

struct HiddenAt {
  std::size_t at = 0;
  Character character;
  const char* name = nullptr;
};

/// The hidden characters of valid UTF-8, in order.
std::vector<HiddenAt> hiddenIn(std::string_view text) {
  std::vector<HiddenAt> found;
  std::uint32_t before = 0;
  for (std::size_t at = 0; at < text.size();) {
    const Character now = characterAt(text, at);
    const char* name = hiddenName(now.point);
    if (name != nullptr && (now.point == 0x200c || now.point == 0x200d)) {
      const std::uint32_t behind = characterAt(text, at + now.bytes).point;
      const auto joins = [](std::uint32_t point) {
        return point >= kFirstJoined && hiddenName(point) == nullptr;
      };
      if (joins(before) && joins(behind)) name = nullptr;
    }
    if (name != nullptr) found.push_back({at, now, name});
    before = now.point;
    at += now.bytes;
  }
  return found;
}

Error invalid(std::string_view field, const std::string& why) {
  return {ErrorCode::kInvalidInput, std::string(field) + ": " + why};
}

Status check(std::string_view field, std::string_view value, std::size_t min, std::size_t max, bool lines) {
  if (value.size() < min || value.size() > max) {
    return invalid(field, fmt::format("has {} bytes, allowed are {} to {}", value.size(), min, max));
  }
  if (!isUtf8(value)) return invalid(field, "is not valid UTF-8 text");
  for (std::size_t at = 0; at < value.size();) {
    const auto [point, bytes] = characterAt(value, at);
    at += bytes;
    if (lines && (point == '\n' || point == '\r' || point == '\t')) continue;
    // U+0080 to U+009F are control characters, too: a terminal reads U+009B as ESC [
    if (point < 0x20 || (point >= 0x7f && point < 0xa0))
      return invalid(field, fmt::format("holds a control character (U+{:04X})", point));
  }
  return {};
}

}  // namespace

std::string_view withoutMark(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  return text;
}

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

std::size_t countCharacters(std::string_view text) {
  // all bytes but those that continue a character
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
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
  return utf8 ? showHidden(out) : out;
}

std::string showHidden(std::string_view text) {
  if (!isUtf8(text)) return std::string(text);
  std::string shown;
  std::size_t from = 0;
  for (const HiddenAt& hidden : hiddenIn(text)) {
    shown += text.substr(from, hidden.at - from);
    shown += fmt::format("[U+{:04X}]", hidden.character.point);
    from = hidden.at + hidden.character.bytes;
  }
  shown += text.substr(from);
  return shown;
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

std::string wordsOfName(std::string_view name) {
  std::string words = lowerCase(name);
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

bool beforeNaturally(std::string_view a, std::string_view b) {
  const auto isDigit = [](char c) { return c >= '0' && c <= '9'; };
  // the digits from `at` on, without leading zeros
  const auto digits = [&](std::string_view text, std::size_t& at) {
    while (at < text.size() && text[at] == '0') ++at;
    const std::size_t from = at;
    while (at < text.size() && isDigit(text[at])) ++at;
    return text.substr(from, at - from);
  };
  std::size_t i = 0, k = 0;
  while (i < a.size() && k < b.size()) {
    if (isDigit(a[i]) && isDigit(b[k])) {
      const std::string_view x = digits(a, i), y = digits(b, k);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
      continue;
    }
    const char x = lowerCase(a[i++]), y = lowerCase(b[k++]);
    if (x != y) return static_cast<unsigned char>(x) < static_cast<unsigned char>(y);
  }
  if (i == a.size() && k == b.size()) return a < b;
  return i == a.size();
}

std::string hexDigitsOf(std::string_view bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

Result<std::string> bytesOfHex(std::string_view hex) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
  };
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    const int high = digit(hex[i]), low = digit(hex[i + 1]);
    if (high < 0 || low < 0) break;
    bytes += static_cast<char>(high * 16 + low);
  }
  if (2 * bytes.size() == hex.size()) return bytes;
  return Error{ErrorCode::kInvalidInput, "is not an even number of digits 0-9, a-f"};
}

Status checkText(std::string_view field, std::string_view value, std::size_t min, std::size_t max) {
  return check(field, value, min, max, false);
}

Status checkName(std::string_view field, std::string_view value) {
  RETURN_IF_ERROR(check(field, value, 1, kMaxNameBytes, false));
  if (value.front() == ' ' || value.back() == ' ') return invalid(field, "begins or ends with a space");
  return {};
}

Status checkVisible(std::string_view field, std::string_view value) {
  if (!isUtf8(value)) return invalid(field, "is not valid UTF-8 text");
  if (value.find("\xef\xbf\xbd") != std::string_view::npos)
    return invalid(field, "holds U+FFFD, which stands for a letter that was lost: type that letter again");
  const auto hidden = hiddenIn(value);
  if (hidden.empty()) return {};
  const HiddenAt& first = hidden.front();
  return invalid(field, fmt::format("contains the invisible character U+{:04X} ({}) at byte {}, which can "
                                    "make a name look like another: type it again without that character",
                                    first.character.point, first.name, first.at + 1));
}

Status checkNewText(std::string_view field, std::string_view value, std::size_t min, std::size_t max) {
  RETURN_IF_ERROR(checkText(field, value, min, max));
  return checkVisible(field, value);
}

Status checkNewName(std::string_view field, std::string_view value) {
  RETURN_IF_ERROR(checkName(field, value));
  RETURN_IF_ERROR(checkVisible(field, value));
  if (value.find('/') != std::string_view::npos)
    return invalid(field, "holds a '/', which separates the parts of a web address: use '-' or a space");
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
                 fmt::format("code: has a character that is not printable ASCII: allowed are {} to {} "
                             "letters without accents, digits, and signs",
                             kMinCodeBytes, kMaxCodeBytes)};
  return {};
}

std::string asciiDigits(std::string_view text) {
  // the zeros of the scripts; nine digits follow each (Unicode, category Nd, below U+10000)
  constexpr std::uint32_t kZeros[] = {0x0660, 0x06f0, 0x07c0, 0x0966, 0x09e6, 0x0a66, 0x0ae6,
                                      0x0b66, 0x0be6, 0x0c66, 0x0ce6, 0x0d66, 0x0e50, 0x0ed0,
                                      0x0f20, 0x1040, 0x17e0, 0x1810, 0xff10};
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t at) {
      return at < text.size() ? std::uint32_t{static_cast<unsigned char>(text[at])} : 0U;
    };
    const std::size_t bytes = (byte(i) & 0xe0U) == 0xc0U ? 2 : (byte(i) & 0xf0U) == 0xe0U ? 3 : 1;
    const std::uint32_t code =
        bytes == 2   ? (byte(i) & 0x1fU) << 6U | (byte(i + 1) & 0x3fU)
        : bytes == 3 ? (byte(i) & 0x0fU) << 12U | (byte(i + 1) & 0x3fU) << 6U | (byte(i + 2) & 0x3fU)
                     : 0;
    const auto* const zero =
        std::ranges::find_if(kZeros, [&](std::uint32_t z) { return code >= z && code < z + 10; });
    if (zero != std::end(kZeros))
      out += static_cast<char>('0' + (code - *zero));
    else
      out += text.substr(i, bytes);
    i += bytes;
  }
  return out;
}

std::string padded(std::string_view text, std::size_t width) {
  return std::string(text) + std::string(width - std::min(width, countCharacters(text)), ' ');
}

std::string wrapped(std::string_view text, std::size_t indent, std::size_t width) {
  std::string out, line(indent, ' ');
  bool empty = true;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (word.empty()) continue;
    if (!empty && countCharacters(line) + 1 + countCharacters(word) > width) {
      out += line + "\n";
      line.assign(indent, ' ');
      empty = true;
    }
    line += (empty ? "" : " ") + std::string(word);
    empty = false;
  }
  return empty ? out : out + line + "\n";
}

namespace {

/// One number per character, made of its bytes (at most four in valid UTF-8).
std::vector<std::uint32_t> charactersOf(std::string_view text) {
  std::vector<std::uint32_t> characters;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool continues = (byte & 0xC0U) == 0x80U && !characters.empty();
    if (continues) {
      characters.back() = characters.back() << 8U | byte;
    } else {
      characters.push_back(static_cast<unsigned char>(lowerCase(c)));
    }
  }
  return characters;
}

}  // namespace

std::optional<std::size_t> editDistance(std::string_view a, std::string_view b, std::size_t most) {
  if (a.size() > kMaxComparedBytes || b.size() > kMaxComparedBytes) return std::nullopt;
  const auto from = charactersOf(a), to = charactersOf(b);
  const std::size_t longer = std::max(from.size(), to.size()), shorter = std::min(from.size(), to.size());
  if (longer - shorter > most) return std::nullopt;
  // row i: the distances of the first i characters of `from` to each beginning of `to`
  std::vector<std::size_t> two_before, before(to.size() + 1), row(to.size() + 1);
  std::iota(before.begin(), before.end(), std::size_t{0});
  for (std::size_t i = 1; i <= from.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t replaced = before[j - 1] + (from[i - 1] == to[j - 1] ? 0 : 1);
      row[j] = std::min({before[j] + 1, row[j - 1] + 1, replaced});
      const bool swapped = i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1];
      if (swapped) row[j] = std::min(row[j], two_before[j - 2] + 1);
    }
    two_before = std::exchange(before, row);
  }
  return before.back() <= most ? std::optional(before.back()) : std::nullopt;
}

std::vector<KnownName> nearNames(std::string_view typed, std::span<const KnownName> known,
                                 std::size_t count) {
  if (typed.size() > kMaxComparedBytes) return {};
  const std::size_t characters = charactersOf(typed).size();
  const std::size_t most = characters <= 4 ? 1 : characters <= 8 ? 2 : 3;
  std::vector<std::pair<std::size_t, const KnownName*>> near;
  for (const KnownName& person : known) {
    const auto by_name = editDistance(typed, person.name, most);
    const auto by_full_name =
        person.full_name.empty() ? std::nullopt : editDistance(typed, person.full_name, most);
    if (by_name || by_full_name)
      near.emplace_back(std::min(by_name.value_or(most), by_full_name.value_or(most)), &person);
  }
  std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) {
    return std::tie(a.first, a.second->name) < std::tie(b.first, b.second->name);
  });
  std::vector<KnownName> names;
  for (const auto& [distance, person] : near)
    if (names.size() < count) names.push_back(*person);
  return names;
}

}  // namespace needlelab
