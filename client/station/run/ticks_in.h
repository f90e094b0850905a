/// Times in ticks of the loop.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace needlelab {

/// The ticks that last at least `seconds` (>= 0) at `rate_hz` (> 0): one at least.
inline std::uint64_t ticksIn(double seconds, double rate_hz) {
  return static_cast<std::uint64_t>(std::max(1.0, std::ceil(seconds * rate_hz)));
}

}  // namespace needlelab
