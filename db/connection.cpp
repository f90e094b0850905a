#include "db/connection.h"

#include <fmt/core.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "common/base/files.h"
#include "common/base/planted_bug.h"
#include "db/sqlite_files.h"

namespace needlelab {
namespace {

/// Maximum number of cached statements per connection; all stores together use fewer.
constexpr std::size_t kMaxIdle = 128;

/// True for failures that put the data on disk in doubt.
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

}  // namespace

Result<Connection> Connection::open(const std::filesystem::path& path, const Options& options) {
  const bool writer = options.mode == Mode::kWriter;
  struct stat info {};
  if (!options.create && options.vfs == nullptr && ::stat(path.c_str(), &info) != 0) {
    return Error{ErrorCode::kNotFound, path.string() + ": there is no database here"};
  }
  // SQLite reads a journal that it finds; a pipe of that name would never answer
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
  Connection connection(path, options.copy_of.empty() ? path : options.copy_of, handle);
  if (rc != SQLITE_OK) return connection.errorOf(rc, "open the database");
  // nobody empties the log of a frozen one
  if (options.mode == Mode::kReader) connection.limits_->most_log_bytes = options.most_log_bytes;
  if (foreign) {
    connection.limits_->cancelled = options.cancelled;
    connection.limits_->time = options.time;
    connection.limits_->until_ns = options.until_ns;
  }
  // every 1000 steps of SQLite's virtual machine: well under a millisecond apart; a step of a foreign file
  // may read much
  sqlite3_progress_handler(handle, foreign ? 50 : 1000, &Connection::goesOn, connection.limits_.get());
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, options.busy_timeout_ms);
  connection.busy_timeout_ms_ = options.busy_timeout_ms;
  // by default the last connection checkpoints on close; only the writer may checkpoint, and it does so
  // itself
  sqlite3_db_config(handle, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  // a hostile file's schema must not execute functions
  sqlite3_db_config(handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);

  // before anything else: disables automatic checkpoints
  RETURN_IF_ERROR(connection.script("PRAGMA wal_autocheckpoint=0"));
  // the index of the log is then on the heap of each connection; without locks, several may do so
  if (frozen) RETURN_IF_ERROR(connection.script("PRAGMA locking_mode=EXCLUSIVE"));
  if (writer) {
    auto mode = connection.prepare("PRAGMA journal_mode=WAL");
    RETURN_IF_ERROR(mode.step());
    if (const auto found = mode.text(0); found != "wal") {
      return Error{ErrorCode::kFailed, path.string() +
                                           ": cannot use a write-ahead log here, SQLite stays in mode '" +
                                           found + "'; use a local file system"};
    }
  }
  std::string settings =
      "PRAGMA foreign_keys=ON; PRAGMA trusted_schema=OFF; PRAGMA temp_store=MEMORY;"
      "PRAGMA cell_size_check=ON;";
  // a large enough cache for the pages that the next chunks of a thousand open sessions touch: some
  // 1,500, where SQLite's default is 500; overwrite deleted rows, so that an erased person cannot be read
  // from free pages
  settings += writer ? "PRAGMA cache_size=-16384; PRAGMA secure_delete=ON;" : "PRAGMA query_only=ON;";
  // this one has SQLite read the schema: of a foreign file only within the bounds of openForeign()
  if (!foreign)
    settings +=
        planted(PlantedBug::kSynchronousNormal) ? "PRAGMA synchronous=NORMAL;" : "PRAGMA synchronous=FULL;";
  RETURN_IF_ERROR(connection.script(settings));
  return connection;
}

Connection::Connection(std::filesystem::path path, std::filesystem::path origin, sqlite3* handle)
    : path_(std::move(path)),
      origin_(std::move(origin)),
      handle_(handle),
      limits_(std::make_unique<Limits>()) {
  limits_->handle = handle;
}

Connection::Connection(Connection&& other) noexcept
    : path_(std::move(other.path_)),
      origin_(std::move(other.origin_)),
      handle_(std::exchange(other.handle_, nullptr)),
      damaged_(other.damaged_),
      busy_timeout_ms_(other.busy_timeout_ms_),
      limits_(std::move(other.limits_)),
      idle_(std::move(other.idle_)) {}

Connection& Connection::operator=(Connection&& other) noexcept {
  if (this != &other) {
    close();
    path_ = std::move(other.path_);
    origin_ = std::move(other.origin_);
    handle_ = std::exchange(other.handle_, nullptr);
    damaged_ = other.damaged_;
    busy_timeout_ms_ = other.busy_timeout_ms_;
    limits_ = std::move(other.limits_);
    idle_ = std::move(other.idle_);
  }
  return *this;
}

Connection::~Connection() {
  close();
}

void Connection::close() {
  for (const auto& [sql, statement] : idle_) sqlite3_finalize(statement);
  idle_.clear();
  sqlite3_close_v2(std::exchange(handle_, nullptr));
}

Statement Connection::prepare(std::string_view sql) {
  // called five times for each incoming chunk: avoids allocating key and entry again
  thread_local std::string key;
  key.assign(sql);
  if (const auto found = idle_.find(key); found != idle_.end() && found->second != nullptr)
    return {this, std::exchange(found->second, nullptr), std::nullopt};
  sqlite3_stmt* statement = nullptr;
  const int rc = sqlite3_prepare_v3(handle_, key.c_str(), static_cast<int>(key.size() + 1),
                                    SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (rc != SQLITE_OK) return {this, nullptr, errorOf(rc, sql)};
  return {this, statement, std::nullopt};
}

void Connection::giveBack(sqlite3_stmt* statement) {
  sqlite3_reset(statement);
  sqlite3_clear_bindings(statement);
  thread_local std::string key;
  key.assign(sqlite3_sql(statement));
  const auto found = idle_.find(key);
  if (found == idle_.end() && idle_.size() < kMaxIdle) {
    idle_.emplace(key, statement);
  } else if (found != idle_.end() && found->second == nullptr) {
    found->second = statement;
  } else {
    // another statement with the same text was in use at the same time: keep only one
    sqlite3_finalize(statement);
  }
}

Status Connection::script(const std::string& sql) {
  const int rc = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (rc != SQLITE_OK) return errorOf(rc, sql);
  return {};
}

std::int64_t Connection::lastRowId() const {
  return sqlite3_last_insert_rowid(handle_);
}
std::int64_t Connection::changes() const {
  return sqlite3_changes64(handle_);
}
bool Connection::inTransaction() const {
  return sqlite3_get_autocommit(handle_) == 0;
}

Status Connection::checkpointPassive(WalProgress* progress) {
  int pages = 0, moved = 0;
  const int rc = sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_PASSIVE, &pages, &moved);
  // SQLite says −1 when it cannot tell
  if (progress != nullptr)
    *progress = {static_cast<std::uint64_t>(std::max(pages, 0)),
                 static_cast<std::uint64_t>(std::max(moved, 0))};
  if (rc != SQLITE_OK && (rc & 0xff) != SQLITE_BUSY && (rc & 0xff) != SQLITE_LOCKED) {
    return errorOf(rc, "checkpoint the write-ahead log");
  }
  return {};
}

Result<bool> Connection::emptyLog(int patience_ms) {
  sqlite3_busy_timeout(handle_, patience_ms);
  const int rc = sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  sqlite3_busy_timeout(handle_, busy_timeout_ms_);
  if (rc == SQLITE_OK) return true;
  if ((rc & 0xff) == SQLITE_BUSY || (rc & 0xff) == SQLITE_LOCKED) return false;
  return errorOf(rc, "empty the write-ahead log");
}

std::uint64_t Connection::walBytes() {
  return logBytesOf(handle_);
}

int Connection::goesOn(void* limits) {
  auto& of = *static_cast<Limits*>(limits);
  of.log_bytes = 0;
  if (of.cancelled != nullptr && of.cancelled->load()) return 1;
  of.is_late = of.time != nullptr && of.time->nowNs() > of.until_ns;
  if (of.is_late) return 1;
  constexpr std::uint64_t kLooksOfAShortRead = 1000;
  if (of.most_log_bytes == 0 || ++of.looks <= kLooksOfAShortRead) return 0;
  const std::uint64_t bytes = logBytesOf(of.handle);
  if (bytes <= of.most_log_bytes) return 0;
  of.log_bytes = bytes;
  return 1;
}

Error Connection::errorOf(int rc, std::string_view what) {
  if ((rc & 0xff) == SQLITE_INTERRUPT && limits_->log_bytes > 0)
    return {
        ErrorCode::kUnavailable,
        fmt::format("a long read was given up: the log beside the database has grown to {} MiB, and can be "
                    "emptied only when such reads have ended: try again when fewer lessons run, or read "
                    "from a backup",
                    limits_->log_bytes >> 20)};
  if ((rc & 0xff) == SQLITE_INTERRUPT && limits_->is_late)
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

Statement::Statement(Connection* connection, sqlite3_stmt* handle, std::optional<Error> failed)
    : connection_(connection), handle_(handle), failed_(std::move(failed)) {}

Statement::Statement(Statement&& other) noexcept
    : connection_(other.connection_),
      handle_(std::exchange(other.handle_, nullptr)),
      failed_(std::move(other.failed_)),
      bound_(other.bound_) {}

Statement::~Statement() {
  if (handle_ != nullptr) connection_->giveBack(handle_);
}

void Statement::check(int rc) {
  if (rc != SQLITE_OK && !failed_) failed_ = connection_->errorOf(rc, "bind a value");
}

Statement& Statement::bind(std::int64_t value) {
  if (handle_ != nullptr) check(sqlite3_bind_int64(handle_, ++bound_, value));
  return *this;
}

Statement& Statement::bind(std::uint64_t value) {
  constexpr auto kMax = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  if (value > kMax && !failed_) {
    failed_ = Error{ErrorCode::kInvalidInput,
                    fmt::format("the number {} is above {}, the greatest stored", value, kMax)};
  }
  return bind(static_cast<std::int64_t>(value & kMax));
}

Statement& Statement::bind(double value) {
  if (handle_ != nullptr) check(sqlite3_bind_double(handle_, ++bound_, value));
  return *this;
}

Statement& Statement::bind(std::string_view value) {
  // an empty view may have a null address, which SQLite would bind as NULL
  const char* text = value.data() == nullptr ? "" : value.data();
  if (handle_ != nullptr) {
    check(sqlite3_bind_text64(handle_, ++bound_, text, value.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  return *this;
}

Statement& Statement::bind(ByteView value) {
  const void* data = value.data() == nullptr ? static_cast<const void*>("") : value.data();
  if (handle_ != nullptr) check(sqlite3_bind_blob64(handle_, ++bound_, data, value.size(), SQLITE_TRANSIENT));
  return *this;
}

Statement& Statement::bindNull() {
  if (handle_ != nullptr) check(sqlite3_bind_null(handle_, ++bound_));
  return *this;
}

Result<bool> Statement::step() {
  if (failed_) return *failed_;
  const int rc = sqlite3_step(handle_);
  if (rc == SQLITE_ROW) return true;
  if (rc == SQLITE_DONE) return false;
  failed_ = connection_->errorOf(rc, sqlite3_sql(handle_));
  return *failed_;
}

Status Statement::run() {
  for (;;) {
    ASSIGN_OR_RETURN(const auto row, step());
    if (!row) return {};
  }
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(handle_, column);
}

std::uint64_t Statement::natural(int column) const {
  const auto value = integer(column);
  return value < 0 ? 0 : static_cast<std::uint64_t>(value);
}

double Statement::real(int column) const {
  return sqlite3_column_double(handle_, column);
}

std::string Statement::text(int column) const {
  return std::string(textOf(bytes(column)));
}

ByteView Statement::bytes(int column) const {
  // read the address first: this may convert the value and change its length
  const auto* data = static_cast<const std::uint8_t*>(sqlite3_column_blob(handle_, column));
  const int size = sqlite3_column_bytes(handle_, column);
  return data == nullptr ? ByteView{} : ByteView{data, static_cast<std::size_t>(size)};
}

bool Statement::isNull(int column) const {
  return sqlite3_column_type(handle_, column) == SQLITE_NULL;
}

Result<Transaction> Transaction::begin(Connection& connection, Kind kind) {
  RETURN_IF_ERROR(connection.run(kind == Kind::kWrite ? "BEGIN IMMEDIATE" : "BEGIN"));
  Transaction transaction(connection);
  if (kind == Kind::kRead) {
    connection.noteShortRead();
    // BEGIN alone does not read; this query fixes the view
    RETURN_IF_ERROR(connection.run("SELECT count(*) FROM sqlite_schema"));
  }
  return transaction;
}

Result<std::optional<Transaction>> Transaction::view(Connection& connection) {
  if (connection.inTransaction()) return std::optional<Transaction>();
  ASSIGN_OR_RETURN(auto begun, begin(connection, Kind::kRead));
  return std::optional<Transaction>(std::move(begun));
}

Transaction::Transaction(Transaction&& other) noexcept
    : connection_(std::exchange(other.connection_, nullptr)) {}

Transaction::~Transaction() {
  // after some errors SQLite has already rolled back
  if (connection_ == nullptr || !connection_->inTransaction()) return;
  connection_->noteShortRead();  // a read that was given up must end
  (void)connection_->run("ROLLBACK");
}

Status Transaction::commit() {
  connection_->noteShortRead();
  RETURN_IF_ERROR(connection_->run("COMMIT"));
  connection_ = nullptr;
  return {};
}

Result<Savepoint> Savepoint::begin(Connection& connection) {
  RETURN_IF_ERROR(connection.run("SAVEPOINT item"));
  return Savepoint(connection);
}

Savepoint::Savepoint(Savepoint&& other) noexcept : connection_(std::exchange(other.connection_, nullptr)) {}

Savepoint::~Savepoint() {
  if (connection_ == nullptr || !connection_->inTransaction()) return;
  // half an item must not be committed with the others
  if (!connection_->run("ROLLBACK TO item")) connection_->damaged_ = true;
  (void)connection_->run("RELEASE item");
}

Status Savepoint::release() {
  RETURN_IF_ERROR(connection_->run("RELEASE item"));
  connection_ = nullptr;
  return {};
}

Status checkNumbersLeft(Connection& connection, std::string_view table) {
  auto row = connection.query("SELECT seq FROM sqlite_sequence WHERE name = ?", table);
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found || row.integer(0) < std::numeric_limits<std::int64_t>::max()) return {};
  return Error{ErrorCode::kFailed,
               fmt::format("table '{}' takes no new row: its last number is {}, which is SQLite's greatest; "
                           "restore a backup from before the import that brought it",
                           table, row.integer(0))};
}

}  // namespace needlelab
