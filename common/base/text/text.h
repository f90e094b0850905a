/// Checks of names and notes (stations check before they record, servers before SQL), text that is safe to
/// print, the case of letters, hexadecimal digits, columns, and names that are near.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kMaxNameBytes = 64;    ///< people, stations, ids of profiles and exercises
inline constexpr std::size_t kMaxNoteBytes = 4096;  ///< annotations, messages
inline constexpr std::size_t kMinCodeBytes = 4, kMaxCodeBytes = 64;  ///< a trainee's code: PIN or badge
inline constexpr std::size_t kMaxJsonBytes =
    900'000;  ///< a profile or curriculum must fit into a message of 1 MiB

/// The trainee name of sessions without a trainee; needs no account.
inline constexpr std::string_view kGuestName = "guest";

/// Returns the text without the UTF-8 byte order mark that some editors put first.
std::string_view withoutMark(std::string_view text);
/// Returns whether the text is UTF-8 without overlong forms, surrogates or NUL.
bool isUtf8(std::string_view text);
/// Counts the characters of UTF-8 text, for column widths: "µm" has two, in three bytes. Combining characters
/// count as characters.
std::size_t countCharacters(std::string_view text);

/// Makes untrusted text safe for a terminal and for a message: replaces control characters and invalid UTF-8
/// by '?', and writes hidden characters as showHidden does.
std::string printable(std::string_view text);
/// Writes each hidden character as "[U+202E]". Hidden characters are invisible and change the direction of
/// the text after them or make two names look alike (the table in text.cpp): marks, embeddings, overrides and
/// isolates of direction, and zero-width characters. A joiner (U+200C, U+200D) between two characters from
/// U+0590 on does not count: Persian and Indian names need it. Invalid UTF-8 stays unchanged.
std::string showHidden(std::string_view text);

enum class Sign : std::uint8_t { kMinus, kBoth };
/// A number for people, with `decimals` decimals; `kBoth` also writes a plus. A value that rounds to zero has
/// no sign: "0.00", never "-0.00".
std::string fixedText(double value, int decimals, Sign sign = Sign::kMinus);

/// Turns 'A' to 'Z' into lower case in every locale; leaves every other byte, and so UTF-8, unchanged.
constexpr char lowerCase(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}
std::string lowerCase(std::string_view text);
/// Turns "ENHANCED_TRACKING_WALL" into "enhanced tracking wall".
std::string wordsOfName(std::string_view name);
/// Turns 'a' to 'z' into capitals, as lowerCase.
constexpr char upperCase(char c) {
  return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
}
/// True for the letters and digits of ASCII.
constexpr bool isLetterOrDigit(char c) {
  return (c >= '0' && c <= '9') || (lowerCase(c) >= 'a' && lowerCase(c) <= 'z');
}
/// 0 to 15 for '0' to '9', 'a' to 'f' and 'A' to 'F'; -1 if `c` is not a hexadecimal digit.
constexpr int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char small = lowerCase(c);
  return small >= 'a' && small <= 'f' ? small - 'a' + 10 : -1;
}

/// The order in which people list names: digits by their number, "station-2" before "station-10"; equal names
/// by their bytes.
bool beforeNaturally(std::string_view a, std::string_view b);
struct BeforeNaturally {
  using is_transparent = void;
  bool operator()(std::string_view a, std::string_view b) const { return beforeNaturally(a, b); }
};

/// The bytes as lower-case hexadecimal digits.
std::string hexDigitsOf(std::string_view bytes);
/// The inverse of hexDigitsOf. Errors: kInvalidInput, for capitals, too.
Result<std::string> bytesOfHex(std::string_view hex);

/// Requires `min` to `max` bytes of UTF-8 without control characters. Errors: kInvalidInput, naming field,
/// length and allowed range.
Status checkText(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// As checkText, 1 to kMaxNameBytes bytes, without a space at the start or end. For names that already exist.
Status checkName(std::string_view field, std::string_view value);
/// Requires text without hidden characters (showHidden). Errors: kInvalidInput, naming field, character and
/// place. For new text that people choose by or trust: names of people, groups, stations, profiles, courses
/// and exercises. Text that is already stored stays valid and is displayed with showHidden.
Status checkVisible(std::string_view field, std::string_view value);
/// As checkText and checkVisible.
Status checkNewText(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// For new names: as checkName and checkVisible, and the name contains no '/' and is not "." or "..", which
/// have a meaning in URLs.
Status checkNewName(std::string_view field, std::string_view value);
/// As checkText, but line ends and tabs are allowed.
Status checkNote(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// Requires kMinCodeBytes to kMaxCodeBytes printable ASCII characters (a trainee's code). No message contains
/// the code.
Status checkCode(std::string_view code);
/// Turns digits of other scripts (Arabic, Persian, Devanagari, full width …) into 0 to 9; keeps everything
/// else.
std::string asciiDigits(std::string_view text);

// --- columns and lines, for a terminal or a picture; widths count characters (countCharacters)

/// Pads `text` with blanks to at least `width`.
std::string padded(std::string_view text, std::size_t width);
/// Wraps `text` at blanks into lines of at most `width`. Each line begins with `indent` blanks and ends with
/// a newline. A wider word gets its own line.
std::string wrapped(std::string_view text, std::size_t indent, std::size_t width = 100);

// --- names that a person may have meant by a mistyped one

/// Longer texts have no distance: the work grows with the product of both lengths.
inline constexpr std::size_t kMaxComparedBytes = 200;

/// The least number of insertions, deletions, replacements, and swaps of two neighbours that turns `a` into
/// `b`; a swapped pair is not edited again (optimal string alignment). Counts UTF-8 characters, ignoring the
/// case of A-Z. Returns nothing if the distance is more than `most`, or if a text has more than
/// kMaxComparedBytes.
std::optional<std::size_t> editDistance(std::string_view a, std::string_view b, std::size_t most);

struct KnownName {
  std::string name;
  std::string full_name;  ///< may be empty
  friend bool operator==(const KnownName&, const KnownName&) = default;
};

/// Returns the people in `known` whose name or full name is near `typed`, nearest first, then by name; at
/// most `count`. Near: at most 1 edit for up to 4 characters of `typed`, 2 for up to 8, else 3.
std::vector<KnownName> nearNames(std::string_view typed, std::span<const KnownName> known,
                                 std::size_t count = 3);

}  // namespace needlelab
