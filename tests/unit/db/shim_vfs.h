/// A VFS for tests: the system's, with faults on command, and with a memory of what a power cut would leave.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <vector>

namespace needlelab::test {

/// Registered with SQLite under name() for as long as the process lives. Thread-safe.
class ShimVfs {
 public:
  enum class Op {
    kWrite,
    kSync,
    kTruncate,
    kHeaderRead,  ///< a checkpoint has just read the log's header, which another connection had changed
  };
  /// Asked before each operation on a file: SQLITE_OK to go on, or the code to fail with. May use other
  /// connections.
  using Hook = std::function<int(Op op, const std::string& path, std::int64_t offset, int size)>;

  static ShimVfs& instance();
  static constexpr const char* kName = "needlelab-shim";
  /// Registers it where that has not been done.
  static const char* name() { return instance(), kName; }

  void setHook(Hook hook);

  /// From now on notes which bytes have been synced.
  void startRecording();
  /// What the disk may hold after a power cut at this instant: every file as last synced, plus a random part
  /// of what was written since, in random order of survival, torn at sectors of 512 bytes. Written into
  /// `folder`, file names kept; the shared-memory file is left out. May be called while connections are at
  /// work.
  void writeAfterPowerCut(const std::string& folder, std::mt19937_64& random);

  // for the C callbacks
  int ask(Op op, const std::string& path, std::int64_t offset, int size);
  void noteWrite(const std::string& path, std::int64_t offset, const void* data, int size);
  void noteTruncate(const std::string& path, std::int64_t size);
  void noteSync(const std::string& path);
  void noteDelete(const std::string& path);

 private:
  ShimVfs();
  struct Change {
    bool truncate = false;
    std::int64_t offset = 0;  ///< of a truncation: the new size
    std::string data;
  };
  struct File {
    bool exists =
        false;  ///< its directory entry has been synced (SQLite syncs it with the file's first sync)
    std::string synced;
    std::vector<Change> since;
  };
  std::mutex mutex_;
  Hook hook_;
  bool recording_ = false;
  std::map<std::string, File> files_;
};

}  // namespace needlelab::test
