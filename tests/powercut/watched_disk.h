/// Records this program's disk calls for a simulated power cut, and makes them fail on command. It is below
/// everything: watched_disk.cpp defines libc's functions in the test program, so the calls of SQLite's own
/// VFS, std::filesystem and our code all arrive here.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "tests/powercut/disk_log.h"

namespace needlelab::test {

enum class DiskCall { kRead, kWrite, kSync, kCreate, kTruncate, kRename, kOpenToWrite };

/// One per program. It skips every real sync: the log decides which data survive, so the test need not wait
/// for the real disk.
class WatchedDisk {
 public:
  /// Logs the current content of `folder` (as synced), then every call below it. Both must exist until the
  /// next `stop`. Shared-memory files (`-shm`) are omitted: they do not reach a disk.
  static void watch(const std::filesystem::path& folder, DiskLog& log);
  static void stop();

  /// Called before each call on a file below `folder`: returns 0 to continue, or the errno to fail with. It
  /// runs under a lock and must not access the disk. Empty: no faults.
  using Fault = std::function<int(DiskCall call, const std::string& path)>;
  static void setFault(const std::filesystem::path& folder, Fault fault);
  static void clearFault() { setFault({}, {}); }
};

/// Watches for the scope's duration.
class Watching {
 public:
  Watching(const std::filesystem::path& folder, DiskLog& log) { WatchedDisk::watch(folder, log); }
  ~Watching() { WatchedDisk::stop(); }
  Watching(const Watching&) = delete;
  Watching& operator=(const Watching&) = delete;
};

}  // namespace needlelab::test
