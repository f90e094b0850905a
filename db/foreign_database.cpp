#include "db/foreign_database.h"

#include <sys/stat.h>

#include <string>
#include <utility>

#include "db/schema.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// An error for what SQLite must not read.
Status checkAlone(const fs::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0)
    return Error{ErrorCode::kNotFound, path.string() + ": there is no database here"};
  if (!S_ISREG(info.st_mode))
    return Error{ErrorCode::kInvalidInput,
                 path.string() + ": is a link or no regular file: give the database's own name"};
  for (const char* suffix : {"-wal", "-journal"}) {
    const fs::path log = path.string() + suffix;
    if (::lstat(log.c_str(), &info) == 0 && (!S_ISREG(info.st_mode) || info.st_size > 0))
      return Error{ErrorCode::kUnavailable,
                   path.string() + ": there is a log beside it (" + log.string() +
                       "): it is a database in use, or somebody put the log there; no file of others "
                       "is read with its log"};
  }
  return {};
}

}  // namespace

Result<Connection> openForeign(const fs::path& path, const std::atomic<bool>* cancelled,
                               std::chrono::nanoseconds most_time) {
  RETURN_IF_ERROR(checkAlone(path));
  // SQLite refuses links in all parts of the path, and the folder may be reached by one
  std::error_code error;
  const fs::path folder = fs::canonical(path.has_parent_path() ? path.parent_path() : ".", error);
  if (error) return Error{ErrorCode::kFailed, path.string() + ": cannot find its folder: " + error.message()};
  ASSIGN_OR_RETURN(auto opened,
                   Connection::open(folder / path.filename(), {.mode = Connection::Mode::kForeign,
                                                               .busy_timeout_ms = 0,
                                                               .copy_of = path,
                                                               .most_time = most_time,
                                                               .cancelled = cancelled}));
  auto id = opened.prepare("PRAGMA application_id");
  ASSIGN_OR_RETURN(const bool row, id.step());
  if (!row || id.integer(0) != kApplicationId)
    return Error{ErrorCode::kCorrupt, path.string() + ": this is no database of needlelab"};
  ASSIGN_OR_RETURN(const auto faults, schemaFaults(opened));
  if (!faults.empty()) return Error{ErrorCode::kCorrupt, path.string() + ": " + faults.front()};
  return opened;
}

}  // namespace needlelab
