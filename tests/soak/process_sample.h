/// Current resource use of a process, from /proc.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>

namespace needlelab::test {

struct ProcessSample {
  std::uint64_t rss_KiB = 0;   ///< VmRSS: all that is in memory, mapped files included
  std::uint64_t anon_KiB = 0;  ///< … of it heap and stacks
  std::uint64_t handles = 0;   ///< open file descriptors, without the database's
  std::uint64_t threads = 0;
  double cpu_s = 0;  ///< user and system, since it began
  /// Of the database and its log: two a connection. The pool of readers grows when reads overlap.
  std::uint64_t database_handles = 0;
};

/// Empty when the process no longer exists.
std::optional<ProcessSample> sampleProcess(pid_t pid);

/// Bytes of all regular files below `folder`.
std::uint64_t bytesBelow(const std::filesystem::path& folder);

}  // namespace needlelab::test
