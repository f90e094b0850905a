#include "db/backup/foreign_database.h"

#include <sqlite3.h>
#include <sys/stat.h>

#include <cstdint>
#include <string>
#include <system_error>

#include "db/store/schema.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// How much SQLite has read of a foreign schema.
struct SchemaRead {
  sqlite3* handle;
  std::uint64_t rows = 0, bytes = 0;
  bool is_too_much = false;
};

/// Called by SQLite for each row of a statement, including those it runs to read the schema.
int countRow(unsigned /*what*/, void* self, void* statement, void* /*unused*/) {
  auto& read = *static_cast<SchemaRead*>(self);
  auto* const row = static_cast<sqlite3_stmt*>(statement);
  ++read.rows;
  for (int i = 0; i < sqlite3_column_count(row); ++i) {
    const int type = sqlite3_column_type(row, i);
    if (type == SQLITE_TEXT || type == SQLITE_BLOB)
      read.bytes += static_cast<std::uint64_t>(sqlite3_column_bytes(row, i));
  }
  read.is_too_much |=
      read.rows > ForeignSchemaBounds::kMostRows || read.bytes > ForeignSchemaBounds::kMostBytes;
  if (read.is_too_much) sqlite3_interrupt(read.handle);
  return 0;
}

/// Begins the view for all reads and checks whose database it is.
Status checkContents(Connection& opened, const fs::path& path) {
  RETURN_IF_ERROR(opened.run("BEGIN"));
  // reads the first page, which then stays in memory unchanged even if someone writes to the file
  ASSIGN_OR_RETURN(const auto id, opened.prepare("PRAGMA application_id").first([](const Statement& row) {
    return row.integer(0);
  }));
  if (id != kApplicationId)
    return Error{ErrorCode::kCorrupt, path.string() + ": this is not a needlelab database"};
  // otherwise the file's header decides how many of its pages stay in memory
  RETURN_IF_ERROR(opened.script("PRAGMA cache_size=-2000"));
  ASSIGN_OR_RETURN(const auto faults, schemaFaults(opened));
  if (!faults.empty()) return Error{ErrorCode::kCorrupt, path.string() + ": " + faults.front()};
  return {};
}

}  // namespace

Status requireAlone(const fs::path& path) {
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

Result<Connection> openForeign(const fs::path& path, const std::atomic<bool>* cancelled,
                               std::chrono::nanoseconds most_time, TimeSource& time) {
  RETURN_IF_ERROR(requireAlone(path));
  const std::int64_t until_ns = time.nowNs() + most_time.count();
  // SQLite refuses links anywhere in the path, but the folder may be reached through one
  std::error_code error;
  const fs::path folder = fs::canonical(path.has_parent_path() ? path.parent_path() : ".", error);
  if (error) return Error{ErrorCode::kFailed, path.string() + ": cannot find its folder: " + error.message()};
  ASSIGN_OR_RETURN(auto opened,
                   Connection::open(folder / path.filename(), {.mode = Connection::Mode::kForeign,
                                                               .busy_timeout_ms = 0,
                                                               .copy_of = path,
                                                               .time = &time,
                                                               .until_ns = until_ns,
                                                               .cancelled = cancelled}));
  sqlite3* const handle = opened.handle();
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, ForeignSchemaBounds::kMostTextBytes);
  sqlite3_limit(handle, SQLITE_LIMIT_COLUMN, ForeignSchemaBounds::kMostColumns);
  SchemaRead read{handle};
  sqlite3_trace_v2(handle, SQLITE_TRACE_ROW, &countRow, &read);
  const Status checked = checkContents(opened, path);
  sqlite3_trace_v2(handle, 0, nullptr, nullptr);
  sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, kMostForeignTextBytes);
  if (checked) return opened;
  // for over-long texts SQLite itself reports the error
  if (!read.is_too_much && checked.error().code != ErrorCode::kInvalidInput) return checked.error();
  return Error{
      ErrorCode::kCorrupt,
      path.string() +
          ": its schema is much larger than needlelab's, and was not read to its end: it was put in"};
}

}  // namespace needlelab
