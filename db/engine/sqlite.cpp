#include "db/engine/sqlite.h"

#include <fmt/core.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/base/planted_bug.h"

namespace needlelab {
namespace {

/// Whether the failure puts the data on disk in doubt.
bool isDamage(int rc) {
  switch (rc & 0xff) {
    case SQLITE_IOERR:
    case SQLITE_FULL:
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PROTOCOL:
      return true;
    default:
      return false;
  }
}

ErrorCode codeOf(int rc) {
  switch (rc & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_NOMEM:
      return ErrorCode::kUnavailable;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return ErrorCode::kCorrupt;
    case SQLITE_CONSTRAINT:
      if (rc == SQLITE_CONSTRAINT_UNIQUE || rc == SQLITE_CONSTRAINT_PRIMARYKEY)
        return ErrorCode::kAlreadyExists;
      return rc == SQLITE_CONSTRAINT_FOREIGNKEY ? ErrorCode::kNotFound : ErrorCode::kInvalidInput;
    case SQLITE_TOOBIG:
      return ErrorCode::kInvalidInput;
    case SQLITE_FULL:
      return ErrorCode::kNoRoom;
    default:
      return ErrorCode::kFailed;
  }
}

class SqliteStatement final : public EngineStatement {
 public:
  SqliteStatement(SqliteConnection& connection, sqlite3_stmt* handle)
      : connection_(connection), handle_(handle) {}
  ~SqliteStatement() override { sqlite3_finalize(handle_); }

  [[nodiscard]] std::string_view sql() const override { return sqlite3_sql(handle_); }
  Status bind(int parameter, std::int64_t value) override {
    return statusOf(sqlite3_bind_int64(handle_, parameter, value));
  }
  Status bind(int parameter, double value) override {
    return statusOf(sqlite3_bind_double(handle_, parameter, value));
  }
  Status bind(int parameter, std::string_view value) override {
    // an empty view may have a null address, which SQLite would bind as NULL
    const char* text = value.data() == nullptr ? "" : value.data();
    return statusOf(
        sqlite3_bind_text64(handle_, parameter, text, value.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  Status bind(int parameter, ByteView value) override {
    const void* data = value.data() == nullptr ? static_cast<const void*>("") : value.data();
    return statusOf(sqlite3_bind_blob64(handle_, parameter, data, value.size(), SQLITE_TRANSIENT));
  }
  Status bindNull(int parameter) override { return statusOf(sqlite3_bind_null(handle_, parameter)); }

  Result<bool> step() override {
    const int rc = sqlite3_step(handle_);
    if (rc == SQLITE_ROW) return true;
    if (rc == SQLITE_DONE) return false;
    return connection_.errorOf(rc, sqlite3_sql(handle_));
  }
  void reset() override {
    sqlite3_reset(handle_);
    sqlite3_clear_bindings(handle_);
  }

  [[nodiscard]] std::int64_t integer(int column) const override {
    return sqlite3_column_int64(handle_, column);
  }
  [[nodiscard]] double real(int column) const override { return sqlite3_column_double(handle_, column); }
  [[nodiscard]] ByteView bytes(int column) const override {
    // read the address first: this may convert the value and change its length
    const auto* data = static_cast<const std::uint8_t*>(sqlite3_column_blob(handle_, column));
    const int size = sqlite3_column_bytes(handle_, column);
    return data == nullptr ? ByteView{} : ByteView{data, static_cast<std::size_t>(size)};
  }
  [[nodiscard]] bool isNull(int column) const override {
    return sqlite3_column_type(handle_, column) == SQLITE_NULL;
  }

 private:
  Status statusOf(int rc) {
    if (rc == SQLITE_OK) return {};
    return connection_.errorOf(rc, "bind a value");
  }

  SqliteConnection& connection_;
  sqlite3_stmt* handle_;
};

}  // namespace

Result<std::unique_ptr<SqliteConnection>> SqliteConnection::open(const std::filesystem::path& path,
                                                                 const Options& options) {
  const bool writer = options.mode == Mode::kWriter;
  struct stat info {};
  if (!options.create && options.vfs == nullptr && ::stat(path.c_str(), &info) != 0) {
    return Error{ErrorCode::kNotFound, path.string() + ": there is no database here"};
  }
  // SQLite reads any journal it finds; a pipe of that name would never answer
  for (const char* suffix : {"", "-wal", "-shm", "-journal"})
    if (options.vfs == nullptr) RETURN_IF_ERROR(requireFileOrNothing(path.string() + suffix));
  const bool foreign = options.mode == Mode::kForeign;
  // readers also open for writing, because WAL needs its shared memory; query_only below forbids changes
  const int flags =
      SQLITE_OPEN_NOMUTEX |
      (foreign ? SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOFOLLOW : SQLITE_OPEN_READWRITE) |
      (writer && options.create ? SQLITE_OPEN_CREATE : 0);
  const bool frozen = options.mode == Mode::kFrozen;
  sqlite3* handle = nullptr;
  const int rc = openDatabaseFile(foreign ? immutableName(path) : path.string(), &handle, flags,
                                  frozen && options.vfs == nullptr ? "unix-none" : options.vfs);
  // `new`: the constructor is private
  std::unique_ptr<SqliteConnection> connection(
      new SqliteConnection(path, options.copy_of.empty() ? path : options.copy_of, handle));
  if (rc != SQLITE_OK) return connection->errorOf(rc, "open the database");
  // the log of a frozen database is never emptied
  if (options.mode == Mode::kReader) connection->limits_.max_log_bytes = options.max_log_bytes;
  if (foreign) {
    connection->limits_.cancelled = options.cancelled;
    connection->limits_.time = options.time;
    connection->limits_.until_ns = options.until_ns;
  }
  // every 1000 steps of SQLite's virtual machine: well under a millisecond apart; a step in a foreign file
  // may read much
  sqlite3_progress_handler(handle, foreign ? 50 : 1000, &SqliteConnection::onProgress, &connection->limits_);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, options.busy_timeout_ms);
  connection->busy_timeout_ms_ = options.busy_timeout_ms;
  // by default the last connection checkpoints on close; only the writer may, and does so itself
  sqlite3_db_config(handle, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  // a hostile file's schema must not execute functions
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);

  // before anything else: disables automatic checkpoints
  RETURN_IF_ERROR(connection->script("PRAGMA wal_autocheckpoint=0"));
  // the log's index is then on each connection's heap; without locks, several connections may do this
  if (frozen) RETURN_IF_ERROR(connection->script("PRAGMA locking_mode=EXCLUSIVE"));
  if (writer) {
    ASSIGN_OR_RETURN(const auto mode, connection->prepare("PRAGMA journal_mode=WAL"));
    RETURN_IF_ERROR(mode->step());
    if (const std::string found(textOf(mode->bytes(0))); found != "wal") {
      return Error{ErrorCode::kFailed, path.string() +
                                           ": cannot use a write-ahead log here, SQLite stays in mode '" +
                                           found + "'; use a local file system"};
    }
  }
  std::string settings =
      "PRAGMA foreign_keys=ON; PRAGMA trusted_schema=OFF; PRAGMA temp_store=MEMORY;"
      "PRAGMA cell_size_check=ON;";
  // the cache holds the pages that the next chunks of a thousand open sessions touch: about 1,500, where
  // SQLite's default is 500; secure_delete overwrites deleted rows, so that an erased person cannot be read
  // from free pages
  settings += writer ? "PRAGMA cache_size=-16384; PRAGMA secure_delete=ON;" : "PRAGMA query_only=ON;";
  // makes SQLite read the schema: for a foreign file only within the limits of openForeign()
  if (!foreign)
    settings +=
        planted(PlantedBug::kSynchronousNormal) ? "PRAGMA synchronous=NORMAL;" : "PRAGMA synchronous=FULL;";
  RETURN_IF_ERROR(connection->script(settings));
  return connection;
}

SqliteConnection::SqliteConnection(std::filesystem::path path, std::filesystem::path origin, sqlite3* handle)
    : path_(std::move(path)), origin_(std::move(origin)), handle_(handle) {
  limits_.handle = handle;
}

SqliteConnection::~SqliteConnection() {
  for (auto& statement : fixed_) statement.reset();
  sqlite3_close_v2(handle_);
}

Result<std::unique_ptr<EngineStatement>> SqliteConnection::prepare(const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  const int rc = sqlite3_prepare_v3(handle_, sql.c_str(), static_cast<int>(sql.size() + 1),
                                    SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (rc != SQLITE_OK) return errorOf(rc, sql);
  return std::unique_ptr<EngineStatement>(std::make_unique<SqliteStatement>(*this, statement));
}

Status SqliteConnection::script(const std::string& sql) {
  const int rc = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (rc != SQLITE_OK) return errorOf(rc, sql);
  return {};
}

std::int64_t SqliteConnection::changes() const {
  return sqlite3_changes64(handle_);
}

bool SqliteConnection::inTransaction() const {
  return sqlite3_get_autocommit(handle_) == 0;
}

Status SqliteConnection::run(Fixed fixed) {
  constexpr std::array<const char*, kFixedCount> kTexts = {
      "BEGIN IMMEDIATE", "BEGIN",           "SELECT count(*) FROM sqlite_schema",
      "COMMIT",          "ROLLBACK",        "SAVEPOINT item",
      "RELEASE item",    "ROLLBACK TO item"};
  std::unique_ptr<EngineStatement>& statement = fixed_[fixed];
  if (!statement) {
    ASSIGN_OR_RETURN(statement, prepare(kTexts[fixed]));
  }
  const auto stepped = statement->step();
  statement->reset();
  return stepped ? Status() : Status(stepped.error());
}

Status SqliteConnection::begin(Begin kind) {
  if (kind != Begin::kView) return run(kBeginWrite);
  RETURN_IF_ERROR(run(kBegin));
  noteShortRead();
  // BEGIN alone does not read; this query fixes the view
  Status read = run(kFixView);
  if (!read) rollback();
  return read;
}

Status SqliteConnection::commit() {
  noteShortRead();
  return run(kCommit);
}

void SqliteConnection::rollback() {
  // after some errors SQLite has already rolled back
  if (!inTransaction()) return;
  noteShortRead();  // an aborted read must end
  (void)run(kRollback);
}

Status SqliteConnection::savepoint() {
  return run(kSavepoint);
}

Status SqliteConnection::releaseSavepoint() {
  return run(kRelease);
}

Status SqliteConnection::undoSavepoint() {
  if (!inTransaction()) return {};
  Status undone = run(kUndo);
  (void)run(kRelease);
  return undone;
}

const std::atomic<bool>* SqliteConnection::setCancelled(const std::atomic<bool>* cancelled) {
  return std::exchange(limits_.cancelled, cancelled);
}

Status SqliteConnection::checkpointPassive(WalProgress* progress) {
  int pages = 0, moved = 0;
  const int rc = sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_PASSIVE, &pages, &moved);
  // SQLite returns −1 if it does not know
  if (progress != nullptr)
    *progress = {static_cast<std::uint64_t>(std::max(pages, 0)),
                 static_cast<std::uint64_t>(std::max(moved, 0))};
  if (rc != SQLITE_OK && (rc & 0xff) != SQLITE_BUSY && (rc & 0xff) != SQLITE_LOCKED) {
    return errorOf(rc, "checkpoint the write-ahead log");
  }
  return {};
}

Result<bool> SqliteConnection::emptyLog(int patience_ms) {
  sqlite3_busy_timeout(handle_, patience_ms);
  const int rc = sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  sqlite3_busy_timeout(handle_, busy_timeout_ms_);
  if (rc == SQLITE_OK) return true;
  if ((rc & 0xff) == SQLITE_BUSY || (rc & 0xff) == SQLITE_LOCKED) return false;
  return errorOf(rc, "empty the write-ahead log");
}

std::uint64_t SqliteConnection::walBytes() {
  return logBytesOf(handle_);
}

int SqliteConnection::onProgress(void* limits) {
  auto& of = *static_cast<Limits*>(limits);
  of.log_bytes = 0;
  if (of.cancelled != nullptr && of.cancelled->load()) return 1;
  of.is_late = of.time != nullptr && of.time->nowNs() > of.until_ns;
  if (of.is_late) return 1;
  constexpr std::uint64_t kShortReadChecks = 1000;
  if (of.max_log_bytes == 0 || ++of.looks <= kShortReadChecks) return 0;
  const std::uint64_t bytes = logBytesOf(of.handle);
  if (bytes <= of.max_log_bytes) return 0;
  of.log_bytes = bytes;
  return 1;
}

Error SqliteConnection::errorOf(int rc, std::string_view what) {
  if ((rc & 0xff) == SQLITE_INTERRUPT && limits_.log_bytes > 0)
    return {
        ErrorCode::kUnavailable,
        fmt::format("a long read was given up: the log beside the database has grown to {} MiB, and can be "
                    "emptied only when such reads have ended: try again when fewer lessons run, or read "
                    "from a backup",
                    limits_.log_bytes >> 20)};
  if ((rc & 0xff) == SQLITE_INTERRUPT && limits_.is_late)
    return {ErrorCode::kUnavailable,
            origin_.string() +
                ": was not read to its end, because that takes too long: it is very large, or "
                "somebody made it so"};
  if (isDamage(rc) && !planted(PlantedBug::kFsyncErrorIgnored)) damaged_ = true;
  constexpr std::size_t kShown = 120;
  const std::string why = handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(rc);
  const int error_number = systemErrorOf(rc, handle_, path_);
  std::string text = (error_number != 0 ? path_ : origin_).string() + ": cannot " +
                     std::string(what.substr(0, kShown)) + (what.size() > kShown ? "…" : "");
  text += fmt::format(": {} (SQLite {})", why, rc);
  if (((rc & 0xff) == SQLITE_IOERR || (rc & 0xff) == SQLITE_CORRUPT) && error_number != 0)
    text += std::string(", ") + std::strerror(error_number);
  text += diskAdvice(error_number, path_);
  const bool full = error_number == ENOSPC || error_number == EDQUOT;
  return {full ? ErrorCode::kNoRoom : codeOf(rc), text};
}

}  // namespace needlelab
