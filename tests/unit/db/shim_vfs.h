/// A VFS for tests: wraps the system's VFS, injects faults on command, and tracks the bytes that would
/// survive a power cut.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <vector>

namespace needlelab::test {

/// Registered with SQLite under name() for the lifetime of the process. Thread-safe.
class ShimVfs {
 public:
  enum class Op {
    kWrite,
    kSync,
    kTruncate,
    kHeaderRead,  ///< a checkpoint has just read the log's header, after another connection changed it
  };
  /// Called before each operation on a file. Returns SQLITE_OK to continue, or the error code to fail with.
  /// May use other connections.
  using Hook = std::function<int(Op op, const std::string& path, std::int64_t offset, int size)>;

  static ShimVfs& instance();
  static constexpr const char* kName = "needlelab-shim";
  /// Registers the VFS if it is not registered yet.
  static const char* name() { return instance(), kName; }

  void setHook(Hook hook);

  /// Starts to track the synced bytes.
  void startRecording();
  /// Writes a possible disk state after a power cut at this moment into `folder`: every file as last synced,
  /// plus a random selection of the later writes in random order, torn at sectors of 512 bytes. Keeps the
  /// file names and omits the shared-memory file. May be called while connections are working.
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
    std::int64_t offset = 0;  ///< for a truncation: the new size
    std::string data;
  };
  struct File {
    bool exists =
        false;  ///< whether its directory entry was synced (SQLite syncs it with the file's first sync)
    std::string synced;
    std::vector<Change> since;
  };
  std::mutex mutex_;
  Hook hook_;
  bool recording_ = false;
  std::map<std::string, File> files_;
};

}  // namespace needlelab::test
