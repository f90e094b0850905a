/// Checks of names and notes (stations check before they record, servers before SQL), text that is safe to
/// print, and the case of letters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kMaxNameBytes = 64;    ///< people, stations, ids of profiles and exercises
inline constexpr std::size_t kMaxNoteBytes = 4096;  ///< annotations, messages
inline constexpr std::size_t kMinCodeBytes = 4, kMaxCodeBytes = 64;  ///< a trainee's code: PIN or badge
inline constexpr std::size_t kMaxJsonBytes =
    900'000;  ///< a profile or curriculum must fit into a message of 1 MiB

/// The trainee of sessions that are nobody's: it needs no account.
inline constexpr std::string_view kGuestName = "guest";

/// Without the UTF-8 byte order mark that some editors put before a text.
std::string_view withoutMark(std::string_view text);
/// UTF-8 without overlong forms, surrogates or NUL.
bool isUtf8(std::string_view text);
/// The characters of UTF-8 text, for the width of columns: "µm" has two, in three bytes. Combining characters
/// count as others.
std::size_t countCharacters(std::string_view text);

/// Makes untrusted text safe for a terminal and for a message: replaces control characters and invalid UTF-8
/// by '?', and writes hidden characters as showHidden does.
std::string printable(std::string_view text);
/// Writes each hidden character as "[U+202E]". Hidden are characters that nobody sees and that turn the
/// direction of the text behind them or make two names look alike (the table in text.cpp): marks, embeddings,
/// overrides and isolates of direction, characters without width. A joiner (U+200C, U+200D) between two
/// characters from U+0590 on is not hidden: Persian and Indian names are spelt with it. What is no UTF-8
/// stays as it is.
std::string showHidden(std::string_view text);

enum class Sign : std::uint8_t { kMinus, kBoth };
/// A number for people with that many decimals; `kBoth` writes a plus too. What rounds to zero has no sign:
/// "0.00", never "-0.00".
std::string fixedText(double value, int decimals, Sign sign = Sign::kMinus);

/// 'A' to 'Z' become small letters, in every locale; every other byte stays as it is, so UTF-8 does, too.
constexpr char lowerCase(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}
std::string lowerCase(std::string_view text);
/// "ENHANCED_TRACKING_WALL" as words: "enhanced tracking wall".
std::string wordsOfName(std::string_view name);
/// 'a' to 'z' become capitals; as lowerCase.
constexpr char upperCase(char c) {
  return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
}
/// True for the letters and digits of ASCII.
constexpr bool isLetterOrDigit(char c) {
  return (c >= '0' && c <= '9') || (lowerCase(c) >= 'a' && lowerCase(c) <= 'z');
}
/// 0 to 15, of '0' to '9', 'a' to 'f' and 'A' to 'F'; -1: `c` is no hexadecimal digit.
constexpr int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char small = lowerCase(c);
  return small >= 'a' && small <= 'f' ? small - 'a' + 10 : -1;
}

/// `min` to `max` bytes of UTF-8 without control characters. kInvalidInput names field, length and allowed
/// range.
Status checkText(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// As checkText, 1 to kMaxNameBytes bytes, without a space at the start or end. For names that already exist.
Status checkName(std::string_view field, std::string_view value);
/// `value` has no hidden character (showHidden). kInvalidInput names field, character and place. For new text
/// that people choose by or trust: names of people, groups, stations, profiles, courses and exercises. What
/// is stored already stays valid, and is shown by showHidden.
Status checkVisible(std::string_view field, std::string_view value);
/// As checkText and checkVisible.
Status checkNewText(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// For new names: as checkName and checkVisible, and the name contains no '/' and is not "." or "..", which
/// have a meaning in URLs.
Status checkNewName(std::string_view field, std::string_view value);
/// As checkText, but line ends and tabs are allowed.
Status checkNote(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// A trainee's code: kMinCodeBytes to kMaxCodeBytes printable ASCII characters. No message contains it.
Status checkCode(std::string_view code);

}  // namespace needlelab
