/// Text in columns and lines, for a terminal or a picture. Widths count characters (countCharacters).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace needlelab {

/// Pads `text` with blanks to at least `width`.
std::string padded(std::string_view text, std::size_t width);
/// Wraps `text` at blanks into lines of at most `width`. Each line begins with `indent` blanks and ends with
/// a newline. A wider word gets its own line.
std::string wrapped(std::string_view text, std::size_t indent, std::size_t width = 100);

}  // namespace needlelab
