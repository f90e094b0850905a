/// Paragraphs in lines, for a terminal or a picture.
#pragma once

#include <string>
#include <string_view>

namespace needlelab {

/// `text` in lines of at most `width` letters (UTF-8), each begun with `indent`.
std::string wrapped(std::string_view text, std::size_t width, std::string_view indent);

}  // namespace needlelab
