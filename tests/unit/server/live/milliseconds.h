/// Steps of the manual clock in tests of the server's parts.
#pragma once

#include <cstdint>

namespace needlelab {

inline constexpr std::int64_t kMs = 1'000'000;  ///< in ns

}  // namespace needlelab
