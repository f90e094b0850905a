/// Checks of names and notes (stations check before they record, servers before SQL), and text that is safe
/// to print.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kMaxNameBytes = 64;    ///< people, stations, ids of profiles and exercises
inline constexpr std::size_t kMaxNoteBytes = 4096;  ///< annotations, messages
inline constexpr std::size_t kMaxJsonBytes =
    900'000;  ///< a profile or curriculum must fit into a message of 1 MiB

/// The trainee of sessions that are nobody's: it needs no account.
inline constexpr std::string_view kGuestName = "guest";

/// UTF-8 without overlong forms, surrogates or NUL.
bool isUtf8(std::string_view text);

/// Makes untrusted text safe for a terminal and for a message: replaces control characters and invalid UTF-8
/// by '?'.
std::string printable(std::string_view text);

enum class Sign : std::uint8_t { kMinus, kBoth };
/// A number for people with that many decimals; `kBoth` writes a plus too. What rounds to zero has no sign:
/// "0.00", never "-0.00".
std::string fixedText(double value, int decimals, Sign sign = Sign::kMinus);

/// `min` to `max` bytes of UTF-8 without control characters. kInvalidInput names field, length and allowed
/// range.
Status checkText(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// As checkText, 1 to kMaxNameBytes bytes, without a space at the start or end. For names that already exist.
Status checkName(std::string_view field, std::string_view value);
/// For new names: as checkName, and the name contains no '/' and is not "." or "..", which have a meaning in
/// URLs.
Status checkNewName(std::string_view field, std::string_view value);
/// As checkText, but line ends and tabs are allowed.
Status checkNote(std::string_view field, std::string_view value, std::size_t min, std::size_t max);

}  // namespace needlelab
