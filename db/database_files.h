/// Files of databases as backups, restores and moves make, keep and replace them; those in a data folder
/// under its lock. Nobody has these databases open.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

inline constexpr const char* kDatabaseFile = "needlelab.db";
/// How the names of replaced databases begin; behind it stands the time.
inline constexpr const char* kReplacedDatabase = "needlelab.db.replaced-";

/// Makes an empty file that only its owner may read, unless one is there: the log beside it inherits that.
Status makeDatabaseFile(const std::filesystem::path& path);
/// Removes a database with what SQLite leaves beside it.
Status removeDatabase(const std::filesystem::path& path);
/// Removes a database at the beginning, and at the end unless it is kept or was renamed.
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
/// Closes an SQLite database that is about to be renamed: all of it is in its one file, on the disk.
Status closeIntoOneFile(Connection database);

/// "20260101T023000Z"
std::string timeForNames(std::int64_t unix_ns);
/// A name that nothing in the folder has: `base` and the time.
std::string freeNameIn(const std::filesystem::path& folder, std::string_view base, std::int64_t now_unix_ns);
/// What is not there was renamed before. kFailed: something has the new name.
Status renameInFolder(const std::filesystem::path& from, const std::filesystem::path& to);
/// Gives DIR/needlelab.db, with its log, the name `kept`. Goes on where it was killed. `said_by`: the file
/// that says that name, for messages; kInvalidInput: the name is none that this program writes.
Status keepReplacedDatabase(const std::filesystem::path& folder, const std::string& kept,
                            const std::filesystem::path& said_by);

}  // namespace needlelab
