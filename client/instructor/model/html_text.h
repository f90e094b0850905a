/// Text within HTML.
#pragma once

#include <string>
#include <string_view>

namespace needlelab {

/// Somebody else's text as it may stand between tags and in quoted attributes: & < > " ' become entities,
/// control characters and what is no UTF-8 become '?'.
std::string htmlText(std::string_view text);

}  // namespace needlelab
