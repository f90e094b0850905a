/// Database files that backups, restores and moves create, keep and replace; those in a data folder only
/// under its lock. The databases must not be open.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

inline constexpr const char* kDatabaseFile = "needlelab.db";
/// Prefix of the names of replaced databases; the time follows.
inline constexpr const char* kReplacedDatabase = "needlelab.db.replaced-";

/// Creates an empty file that only its owner may read, unless it exists. The log beside it inherits the
/// permissions.
Status makeDatabaseFile(const std::filesystem::path& path);
/// Removes a database and the files that SQLite leaves beside it.
Status removeDatabase(const std::filesystem::path& path);
/// Removes a database on construction, and on destruction unless it is kept or was renamed.
class UnfinishedDatabase {
 public:
  explicit UnfinishedDatabase(std::filesystem::path path) : path_(std::move(path)) {
    (void)removeDatabase(path_);
  }
  ~UnfinishedDatabase() {
    if (!is_kept_) (void)removeDatabase(path_);
  }
  UnfinishedDatabase(const UnfinishedDatabase&) = delete;
  UnfinishedDatabase& operator=(const UnfinishedDatabase&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  void keep() { is_kept_ = true; }

 private:
  const std::filesystem::path path_;
  bool is_kept_ = false;
};
/// Closes an SQLite database that is about to be renamed: all data ends up in its one file, synced.
Status closeIntoOneFile(Connection database);

/// "20260101T023000Z"
std::string timeForNames(std::int64_t unix_ns);
/// A name that is not used in the folder: `base` and the time.
std::string freeNameIn(const std::filesystem::path& folder, std::string_view base, std::int64_t now_unix_ns);
/// A missing `from` means that it was renamed earlier. kFailed: the new name is taken.
Status renameInFolder(const std::filesystem::path& from, const std::filesystem::path& to);
/// Renames DIR/needlelab.db and its log to `kept`. Resumes after a kill. `named_in`: the file that contains
/// the name, for messages. kInvalidInput: not a name that this program writes.
Status keepReplacedDatabase(const std::filesystem::path& folder, const std::string& kept,
                            const std::filesystem::path& named_in);

}  // namespace needlelab
