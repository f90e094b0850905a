/// Steps of the clock that tests of the server's parts turn by hand.
#pragma once

#include <cstdint>

namespace needlelab {

inline constexpr std::int64_t kMs = 1'000'000;  ///< in ns

}  // namespace needlelab
