/// The two clocks that the programs use. Engine and gate use none: they count ticks.
#pragma once

#include <cstdint>

namespace needlelab {

/// Monotonic time of this machine since some start, in ns (CLOCK_MONOTONIC). No system call through the vDSO.
std::int64_t steadyNowNs() noexcept;

/// Time of day, ns since 1970-01-01 UTC (CLOCK_REALTIME). May jump.
std::int64_t wallNowNs() noexcept;

}  // namespace needlelab
