/// Numbers within sentences.
#pragma once

#include <string>

namespace needlelab {

/// printf into a string, however long.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace needlelab
