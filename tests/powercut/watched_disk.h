/// This program's own calls to the disk, noted for a simulated power cut, and failing on command. They are
/// taken below everything: SQLite's own VFS, std::filesystem and our code all come through here, because
/// watched_disk.cpp defines libc's functions in the test's program.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "tests/powercut/disk_log.h"

namespace needlelab::test {

enum class DiskCall { kRead, kWrite, kSync, kCreate, kTruncate, kRename, kOpenToWrite };

/// The whole program has one. Real syncs are left out everywhere in it: what survives is told by the log, and
/// the real disk need not be waited for.
class WatchedDisk {
 public:
  /// From now on what happens below `folder` goes to `log`, after what is there now (taken as synced). Both
  /// must last until the next `stop`. Shared-memory files (`-shm`) are left out: they are no disk's.
  static void watch(const std::filesystem::path& folder, DiskLog& log);
  static void stop();

  /// Asked before each call on a file below `folder`: 0 to go on, or the errno to fail with. It is called
  /// under a lock: no calls to the disk from there. Empty: no faults.
  using Fault = std::function<int(DiskCall call, const std::string& path)>;
  static void setFault(const std::filesystem::path& folder, Fault fault);
  static void clearFault() { setFault({}, {}); }
};

/// Watches in a scope.
class Watching {
 public:
  Watching(const std::filesystem::path& folder, DiskLog& log) { WatchedDisk::watch(folder, log); }
  ~Watching() { WatchedDisk::stop(); }
  Watching(const Watching&) = delete;
  Watching& operator=(const Watching&) = delete;
};

}  // namespace needlelab::test
