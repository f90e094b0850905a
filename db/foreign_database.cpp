#include "db/foreign_database.h"

#include <sqlite3.h>
#include <sys/stat.h>

#include <cstdint>
#include <string>
#include <system_error>

#include "db/schema.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

/// Holds the bounds of ForeignSchemaBounds during its lifetime, over all that SQLite itself reads, too.
class SchemaBound {
 public:
  explicit SchemaBound(sqlite3* handle)
      : handle_(handle),
        text_bytes_(sqlite3_limit(handle, SQLITE_LIMIT_LENGTH, ForeignSchemaBounds::kMostTextBytes)),
        columns_(sqlite3_limit(handle, SQLITE_LIMIT_COLUMN, ForeignSchemaBounds::kMostColumns)) {
    sqlite3_trace_v2(handle, SQLITE_TRACE_ROW, &SchemaBound::count, this);
  }
  ~SchemaBound() {
    sqlite3_trace_v2(handle_, 0, nullptr, nullptr);
    sqlite3_limit(handle_, SQLITE_LIMIT_LENGTH, text_bytes_);
    sqlite3_limit(handle_, SQLITE_LIMIT_COLUMN, columns_);
  }
  SchemaBound(const SchemaBound&) = delete;
  SchemaBound& operator=(const SchemaBound&) = delete;

  /// Whether a bound was the reason of a read's error: of a text's length SQLite itself says it.
  [[nodiscard]] bool isReasonOf(const Error& error) const {
    return is_exceeded_ || error.code == ErrorCode::kInvalidInput;
  }

 private:
  /// SQLite calls it for each row that a statement gives, those by which it reads the schema included.
  static int count(unsigned /*what*/, void* self, void* statement, void* /*unused*/) {
    auto& bound = *static_cast<SchemaBound*>(self);
    auto* const row = static_cast<sqlite3_stmt*>(statement);
    ++bound.rows_;
    for (int i = 0; i < sqlite3_column_count(row); ++i) {
      const int type = sqlite3_column_type(row, i);
      if (type == SQLITE_TEXT || type == SQLITE_BLOB)
        bound.bytes_ += static_cast<std::uint64_t>(sqlite3_column_bytes(row, i));
    }
    if (bound.rows_ <= ForeignSchemaBounds::kMostRows && bound.bytes_ <= ForeignSchemaBounds::kMostBytes)
      return 0;
    bound.is_exceeded_ = true;
    sqlite3_interrupt(bound.handle_);
    return 0;
  }

  sqlite3* handle_;
  int text_bytes_, columns_;
  std::uint64_t rows_ = 0, bytes_ = 0;
  bool is_exceeded_ = false;
};

/// Begins the view that all is read in, and looks whose database it is.
Status checkContents(Connection& opened, const fs::path& path) {
  RETURN_IF_ERROR(opened.run("BEGIN"));
  // reads the first page, which stays in memory as it is now: somebody may write to the file meanwhile
  ASSIGN_OR_RETURN(const auto id, opened.prepare("PRAGMA application_id").first([](const Statement& row) {
    return row.integer(0);
  }));
  if (id != kApplicationId)
    return Error{ErrorCode::kCorrupt, path.string() + ": this is no database of needlelab"};
  // the file's header says otherwise how many of its pages stay in memory
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
  // SQLite refuses links in all parts of the path, and the folder may be reached by one
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
  sqlite3_limit(opened.handle(), SQLITE_LIMIT_LENGTH, kMostForeignTextBytes);
  SchemaBound bound(opened.handle());
  if (const Status checked = checkContents(opened, path); !checked)
    return bound.isReasonOf(checked.error())
               ? Error{ErrorCode::kCorrupt, path.string() +
                                                ": its schema is much larger than needlelab's, and was not "
                                                "read to its end: somebody put it in"}
               : checked.error();
  return opened;
}

}  // namespace needlelab
