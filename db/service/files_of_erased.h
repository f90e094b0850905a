/// Files that still hold an erased person: backups and replaced databases. Private to this folder.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "common/base/time_source.h"
#include "db/erasure.h"
#include "db/foreign_database.h"

namespace needlelab {

/// For reading in all files together that one erasure looks into. Less: more backups are listed unread; more:
/// whoever fills the folder of backups with hostile files delays the erasure's reply for longer.
inline constexpr std::chrono::seconds kMostTimeOfFiles{60};

/// For one turn of it. Others' slow requests (imports, backups) wait for one turn, not for the look.
inline constexpr std::chrono::milliseconds kTurnOfFiles{500};

class RowsOfFile;

/// A look, in turns, at databases below the folder of the one in use, and in `backups`, where the last backup
/// was put: which of them name the person in any text but those of documents (profiles, courses), by any of
/// the names that the erasure replaced, or have one of the erased sessions. Also found is each of which this
/// cannot be told: it is encrypted, has a log beside it, is no database of needlelab, somebody changed its
/// schema, a text in it is longer than needlelab stores, or kMostTimeOfForeign is up; what is left when
/// `most_time` was used for reading; unfinished copies of backups; and logs of what is found, or whose
/// database is gone. Files are read as openForeign() does, one that has several names (hard links) once.
/// Takes no lock. `erased`, `cancelled` (may be null) and `time` must outlive it. Thread: one at a time.
class LookAtFiles {
 public:
  LookAtFiles(const std::filesystem::path& folder, const std::filesystem::path& backups,
              const ErasedRows& erased, const std::atomic<bool>* cancelled,
              std::chrono::nanoseconds most_time = kMostTimeOfFiles, TimeSource& time = machineTime());
  LookAtFiles(const LookAtFiles&) = delete;
  LookAtFiles& operator=(const LookAtFiles&) = delete;
  ~LookAtFiles();

  /// One turn: up to kTurnOfFiles, and at most one database. True: the look is complete.
  bool goOn();
  /// What was found, sorted.
  [[nodiscard]] std::vector<std::filesystem::path> found() const;
  /// Databases that were opened.
  [[nodiscard]] std::uint64_t opened() const { return opened_; }

 private:
  /// Device and number of a file, its length, when its contents and when itself was changed last, in ns.
  using Identity = std::tuple<dev_t, ino_t, std::int64_t, std::int64_t, std::int64_t>;
  static std::optional<Identity> identityOf(const std::filesystem::path& path);
  /// Whether the file is a database to read; puts it where it belongs if not.
  bool isToRead(const std::filesystem::path& path);
  /// Whether it names the person; nothing: it is to be read on in another turn.
  std::optional<bool> read(const std::filesystem::path& path, std::int64_t until_ns);
  void addLogs();

  const ErasedRows& erased_;
  const std::atomic<bool>* cancelled_;
  TimeSource& time_;
  std::filesystem::path in_use_;
  std::deque<std::filesystem::path> files_;  ///< of which nothing is known yet
  std::unique_ptr<RowsOfFile> rows_;         ///< of the first of them; null: it is not opened
  std::optional<Identity> identity_;         ///< of that one
  std::int64_t left_ns_;                     ///< of `most_time`
  std::int64_t left_of_file_ns_ = 0;         ///< of kMostTimeOfForeign
  std::map<Identity, bool> known_;           ///< whether files that were read name the person
  std::set<std::filesystem::path> naming_, logs_;
  std::uint64_t opened_ = 0;
};

}  // namespace needlelab
