/// A log of a program's disk calls, and the disk states that a power cut may leave.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "tests/support/random.h"

namespace needlelab::test {

/// One call, or a mark that a test set between calls. Files and folders are numbered. Unlike inode numbers,
/// the numbers are never reused.
struct DiskEvent {
  enum class Kind {
    kFile,        ///< a file existed at the start, synced, with the content `data`
    kFolder,      ///< a folder existed at the start: entry `name` of `folder`
    kCreate,      ///< new file `node`, entry `name` of `folder`
    kMkdir,       ///< new folder `node`
    kWrite,       ///< of `data` at `offset` of `node`
    kTruncate,    ///< `node` to `offset` bytes
    kSync,        ///< fsync or fdatasync of the file or folder `node` succeeded
    kSyncFailed,  ///< … failed: unsynced data may or may not be on the disk, and no later sync writes them
    kRename,      ///< entry `name` of `folder` to `to_name` of `to_folder`
    kLink,        ///< `node` also gets the entry `to_name` of `to_folder`
    kRemove,      ///< entry `name` of `folder`
    kMark,        ///< set by the test: `name`, `offset`, `data`
  };
  Kind kind = Kind::kMark;
  std::uint32_t node = 0, folder = 0, to_folder = 0;
  std::uint64_t offset = 0;
  std::string name = {}, to_name = {}, data = {};
};

/// The root folder's number.
inline constexpr std::uint32_t kRootNode = 1;

/// Appended to while a program runs; read afterwards. Thread: any for `add` and `mark`.
class DiskLog {
 public:
  void add(DiskEvent event);
  /// Records, between the calls, a message that the program has just sent, e.g. an acknowledgement.
  void mark(std::string name, std::uint64_t number = 0, std::string data = {});
  [[nodiscard]] const std::vector<DiskEvent>& events() const { return events_; }
  /// Events before this one describe the disk's state at the start.
  [[nodiscard]] std::size_t begin() const;
  /// Writes the log to a file and reads it back, for a run that its seed cannot repeat because threads raced.
  void save(const std::filesystem::path& path) const;
  static DiskLog load(const std::filesystem::path& path);

  DiskLog() = default;
  DiskLog(DiskLog&& other) noexcept : events_(std::move(other.events_)) {}
  DiskLog& operator=(DiskLog&& other) noexcept {
    events_ = std::move(other.events_);
    return *this;
  }

 private:
  std::mutex mutex_;
  std::vector<DiskEvent> events_;
};

/// Which unsynced data survive a power cut.
enum class CutOutcome {
  kNothing,     ///< only synced data
  kEverything,  ///< like after kill −9
  kInOrder,     ///< everything before some instant, the last write torn
  kPerFile,     ///< all data of some files, none of others: reordered between files
  kSectors,     ///< any subset of sectors, sizes and folder entries: reordered and torn
};
inline constexpr int kOutcomes = 5;
const char* nameOf(CutOutcome outcome);

/// Replays a log up to an instant and creates the possible disk states after a power cut there. Rules: a
/// synced file has its bytes and its size, but its name only if its folder was synced afterwards; a rename
/// happens completely or not at all; any sector (512 or 4096, aligned) of unsynced bytes may or may not be
/// there; if only a file's size reached the disk, it holds zeros or garbage; a failed sync guarantees
/// nothing, then or later.
class DiskReplay {
 public:
  explicit DiskReplay(const DiskLog& log) : log_(log) {}

  /// Replays the events before number `instant`. Instants must not decrease.
  void advanceTo(std::size_t instant);

  /// True if files with this name suffix have bytes that are written but not synced at this instant.
  [[nodiscard]] bool hasUnsynced(std::string_view name_end) const;

  /// Writes one of the states as real files into the empty `folder`. All choices come from `random`.
  void cut(CutOutcome outcome, Random& random, const std::filesystem::path& folder) const;

 private:
  struct Change {
    std::size_t event = 0;
    bool doomed = false;  ///< a sync of it failed
    bool sure = false;    ///< synced, but above something doomed
  };
  struct File {
    std::string synced;
    std::vector<Change> since;
    std::string name;  ///< its last name, for hasUnsynced
  };
  struct Folder {
    std::map<std::string, std::uint32_t> synced;
    std::vector<std::size_t> since;  ///< events
  };
  struct Choice;
  void play(std::size_t number);
  void syncFile(File& file);
  void syncFolder(std::uint32_t node);
  void apply(const DiskEvent& event, std::uint32_t folder,
             std::map<std::string, std::uint32_t>& entries) const;
  [[nodiscard]] std::string contentAfter(const File& file, const Choice& choice, Random& random) const;
  void write(std::uint32_t node, const Choice& choice, Random& random,
             const std::filesystem::path& folder) const;

  const DiskLog& log_;
  std::size_t at_ = 0;
  std::map<std::uint32_t, File> files_;
  std::map<std::uint32_t, Folder> folders_{{kRootNode, {}}};
};

}  // namespace needlelab::test
