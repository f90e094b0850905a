/// Texts: which names and notes may be stored (stations check before they record, servers before it reaches
/// SQL), what may be printed, and numbers within sentences.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kMaxNameBytes = 64;    ///< people, stations, ids of profiles and exercises
inline constexpr std::size_t kMaxNoteBytes = 4096;  ///< annotations, messages
inline constexpr std::size_t kMaxJsonBytes =
    900'000;  ///< a profile or curriculum must fit into a message of 1 MiB

/// UTF-8 without overlong forms, surrogates or NUL.
bool isUtf8(std::string_view text);

/// Somebody else's text, safe for a terminal and for a message: control characters become '?', and so does
/// what is no UTF-8.
std::string printable(std::string_view text);

/// `min` to `max` bytes of UTF-8 without control characters. kInvalidInput names field, length and allowed
/// range.
Status checkText(std::string_view field, std::string_view value, std::size_t min, std::size_t max);
/// As checkText, 1 to kMaxNameBytes, not beginning or ending with a space. What may be said of a name that is
/// there already.
Status checkName(std::string_view field, std::string_view value);
/// What may become a name: as checkName, and no '/', nor "." or "..", which mean something else in addresses
/// of the web.
Status checkNewName(std::string_view field, std::string_view value);
/// As checkText, but line ends and tabs are allowed.
Status checkNote(std::string_view field, std::string_view value, std::size_t min, std::size_t max);

/// printf into a string, however long.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace needlelab
