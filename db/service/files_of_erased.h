/// Files that still hold an erased person: backups and replaced databases. Private to this folder.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "common/base/time_source.h"
#include "db/erasure.h"
#include "db/foreign_database.h"
#include "db/service/folder_walk.h"

namespace needlelab {

/// For reading in all files together that one erasure looks into. Less: more backups are listed unread; more:
/// whoever fills the folder of backups with hostile files delays the erasure's reply for longer.
inline constexpr std::chrono::seconds kMostTimeOfFiles{60};

/// For one turn of it. Others' slow requests (imports, backups) wait for one turn, not for the look.
inline constexpr std::chrono::milliseconds kTurnOfFiles{500};

/// Files and folders that one erasure names, databases that it reads, and folders of which it counts the
/// others: whoever may write beside the backups can make any number. What is above is counted, and neither
/// kept nor read.
inline constexpr std::size_t kMostFilesNamed = 100, kMostFilesRead = 5000, kMostFoldersCounted = 10;

struct FilesFound {
  /// First those that were read and have the person, then databases of which nobody can tell, logs,
  /// unfinished copies, folders that could not be read, and files that are no databases; of each the server's
  /// own first, then by path.
  std::vector<std::filesystem::path> named;
  /// How many more, by folder; one that was read again may count its files again. Where there are many
  /// folders, by the one that was looked through.
  std::map<std::filesystem::path, std::uint64_t> others;
};

class RowsOfFile;

/// A look, in turns, at databases below the folder of the one in use, and in `backups`, where the last backup
/// was put: which of them name the person in any text but those of documents (profiles, courses), by any of
/// the names that the erasure replaced, or have one of the erased sessions. Also found is each of which this
/// cannot be told: it is encrypted, has a log beside it, is no database of needlelab, somebody changed its
/// schema, a text in it is longer than needlelab stores, or kMostTimeOfForeign is up; what is left when
/// `most_time` was used for reading; a path is too long to open; logs; unfinished copies of backups; folders
/// that cannot be read, go on changing while they are read again (FolderWalk), or lie more than 16 levels
/// below; and each file that is no database (a compressed copy, a text), but those of
/// isOwnFile() and kErasuresCopy. Not found: what a link below these folders leads to, and folders in
/// `backups` where this lies elsewhere. Files are read as openForeign() does, one that has several names
/// (hard links) once; the server's own come first. Memory: for kMostFilesRead paths, whatever lies there.
/// `newest_unix_ns`: leaves out what was changed later, and folders that cannot be read. Without `most_time`
/// all are listed unread. Takes no lock. `erased`, `cancelled` (may be null) and `time` must outlive it.
/// Thread: one at a time.
class LookAtFiles {
 public:
  LookAtFiles(const std::filesystem::path& folder, const std::filesystem::path& backups,
              const ErasedRows& erased, const std::atomic<bool>* cancelled,
              std::chrono::nanoseconds most_time = kMostTimeOfFiles, TimeSource& time = machineTime(),
              std::int64_t newest_unix_ns = INT64_MAX);
  LookAtFiles(const LookAtFiles&) = delete;
  LookAtFiles& operator=(const LookAtFiles&) = delete;
  ~LookAtFiles();

  /// One turn: up to kTurnOfFiles, and at most one database. True: the look is complete.
  bool goOn();
  [[nodiscard]] FilesFound found() const;
  /// Databases that were opened.
  [[nodiscard]] std::uint64_t opened() const { return opened_; }

 private:
  /// Device and number of a file, its length, when its contents and when itself was changed last, in ns.
  using Identity = std::tuple<dev_t, ino_t, std::int64_t, std::int64_t, std::int64_t>;
  static std::optional<Identity> identityOf(const std::filesystem::path& path);
  /// In the order in which they are named.
  enum class Kind { kHasPerson, kUntold, kLog, kUnfinished, kUnread, kOther, kWithout };
  /// Whether another user owns it, who may have made any number of them; its path.
  using File = std::pair<bool, std::filesystem::path>;

  /// Goes through the folders. False: there is more, and it is past `until_ns`.
  bool listOn(std::int64_t until_ns);
  /// Whether only what is from before some time is wanted.
  [[nodiscard]] bool isForOldOnes() const { return newest_unix_ns_ != INT64_MAX; }
  /// Puts a file where it belongs.
  void sortIn(const File& file);
  /// What it is; nothing: it is to be read on in another turn.
  std::optional<Kind> read(const std::filesystem::path& path, std::int64_t until_ns);
  void name(Kind kind, const File& file);
  void countOther(const std::filesystem::path& path);

  const ErasedRows& erased_;
  const std::atomic<bool>* cancelled_;
  TimeSource& time_;
  std::filesystem::path in_use_;
  std::int64_t newest_unix_ns_;
  std::vector<FolderWalk::Root> roots_;
  std::optional<FolderWalk> walk_;    ///< through all of them
  bool is_listed_ = false;            ///< it has ended
  std::set<File> files_;              ///< databases of which nothing is known yet
  std::unique_ptr<RowsOfFile> rows_;  ///< of the first of them; null: it is not opened
  std::optional<Identity> identity_;  ///< of that one
  std::int64_t left_ns_;              ///< of `most_time`
  std::int64_t left_of_file_ns_ = 0;  ///< of kMostTimeOfForeign
  std::map<Identity, Kind> known_;    ///< files that were read
  std::set<std::pair<Kind, File>> named_;
  std::map<std::filesystem::path, std::uint64_t> others_;
  std::uint64_t opened_ = 0;
};

}  // namespace needlelab
