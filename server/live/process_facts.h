/// What the kernel says of this process.
#pragma once

#include <cstdint>

namespace needlelab {

struct ProcessFacts {
  double cpu_s = 0;  ///< user and system
  double started_unix_s = 0;
  std::uint64_t rss_bytes = 0;
  std::uint64_t threads = 0;
  std::uint64_t open_files = 0, most_files = 0;
};

/// Reads /proc/self; what cannot be read stays 0. Thread: any.
ProcessFacts processFacts();

}  // namespace needlelab
