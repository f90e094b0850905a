/// The engine SQLite: a database file with a write-ahead log beside it.
#pragma once

#include <sqlite3.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/engine/engine.h"

namespace needlelab {

/// Long reads are aborted when the log beside the database exceeds this, because they keep it from being
/// emptied. It is about ten minutes of a thousand stations. Smaller: no check of a large database would
/// finish; greater: it takes disk space that others need.
inline constexpr std::uint64_t kMaxLogBytesOfReaders = std::uint64_t{4} << 30;

/// An open file with the settings in db/README.md: WAL, synchronous=FULL, foreign keys on,
/// wal_autocheckpoint=0, no checkpoint on close. Only the writer checkpoints: SQLite before 3.51.3 can
/// destroy the database if one connection checkpoints while another commits. Thread: not thread-safe; one
/// thread at a time (SQLite runs without its own mutex).
class SqliteConnection final : public EngineConnection {
 public:
  enum class Mode {
    kWriter,   ///< reads, writes, checkpoints; one per process, and one process per database (lock in
               ///< bootstrap.h)
    kReader,   ///< query_only
    kFrozen,   ///< query_only, for a file that no one writes to: writes nothing itself and uses no lock or
               ///< shared memory beside the file, so that it opens on a full disk; reads the log
    kForeign,  ///< for openForeign() (foreign_database.h): query_only; reads the file alone, ignoring any log
               ///< or journal beside it
  };
  struct Options {
    Mode mode = Mode::kReader;
    bool create = false;        ///< writer only: create a missing file
    const char* vfs = nullptr;  ///< a VFS registered by a test; null = the system's
    int busy_timeout_ms = 5000;
    /// Readers only: a long read fails with kUnavailable above this size (noteShortRead()).
    std::uint64_t max_log_bytes = kMaxLogBytesOfReaders;
    /// The original of which `path` is a copy; named in messages about the contents. Empty: none.
    std::filesystem::path copy_of = {};
    /// Foreign files only: reads fail with kUnavailable once `time` is past `until_ns`. `time` must outlive
    /// the connection; null: no limit.
    TimeSource* time = nullptr;
    std::int64_t until_ns = 0;
    /// Foreign files only: like CancelScope, but also while opening. May be null; must outlive the
    /// connection.
    const std::atomic<bool>* cancelled = nullptr;
  };

  /// Opens and configures the database. Errors: kNotFound (no file), kInvalidInput (it, its log or its
  /// journal is a pipe, device, socket or folder), kCorrupt (not a database), kFailed.
  static Result<std::unique_ptr<SqliteConnection>> open(const std::filesystem::path& path,
                                                        const Options& options);
  ~SqliteConnection() override;

  Result<std::unique_ptr<EngineStatement>> prepare(const std::string& sql) override;
  Status script(const std::string& sql) override;
  [[nodiscard]] std::int64_t changes() const override;
  [[nodiscard]] bool inTransaction() const override;
  [[nodiscard]] bool damaged() const override { return damaged_; }
  void setDamaged() override { damaged_ = true; }
  Status begin(Begin kind) override;
  Status commit() override;
  void rollback() override;
  Status savepoint() override;
  Status releaseSavepoint() override;
  Status undoSavepoint() override;
  const std::atomic<bool>* setCancelled(const std::atomic<bool>* cancelled) override;
  [[nodiscard]] Durability durability() const override { return Durability::kPowerCut; }
  [[nodiscard]] std::string durabilityReason() const override { return "SQLite, synchronous = FULL"; }
  [[nodiscard]] SqliteConnection* sqlite() override { return this; }

  /// Result of a checkpoint: pages in the log, and how many of them are already in the database. Both are 0
  /// if the database was busy.
  struct WalProgress {
    std::uint64_t pages = 0, moved = 0;
  };
  /// As in Connection.
  Status checkpointPassive(WalProgress* progress);
  Result<bool> emptyLog(int patience_ms);
  [[nodiscard]] std::uint64_t walBytes();
  void noteShortRead() { limits_.looks = 0; }
  void readUntil(std::int64_t until_ns) { limits_.until_ns = until_ns; }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] const std::filesystem::path& origin() const { return origin_; }
  [[nodiscard]] sqlite3* handle() { return handle_; }

  /// Converts the last call's error; sets damaged() for failures that put stored data in doubt.
  Error errorOf(int rc, std::string_view what);

 private:
  /// What interrupts running statements, through SQLite's progress handler.
  struct Limits {
    sqlite3* handle = nullptr;
    const std::atomic<bool>* cancelled = nullptr;  ///< null: nothing cancels
    std::uint64_t max_log_bytes = 0;               ///< 0: any size
    std::uint64_t looks = 0;                       ///< handler calls since noteShortRead()
    std::uint64_t log_bytes = 0;  ///< log size that caused the last interruption; 0: cancelled
    TimeSource* time = nullptr;   ///< null: no time limit
    std::int64_t until_ns = 0;
    bool is_late = false;  ///< the last interruption was due to `until_ns`
  };
  /// Statements that are prepared once.
  enum Fixed : std::uint8_t {
    kBeginWrite,
    kBegin,
    kFixView,
    kCommit,
    kRollback,
    kSavepoint,
    kRelease,
    kUndo,
    kFixedCount
  };
  Status run(Fixed fixed);
  static int onProgress(void* limits);
  SqliteConnection(std::filesystem::path path, std::filesystem::path origin, sqlite3* handle);

  std::filesystem::path path_, origin_;
  sqlite3* handle_ = nullptr;
  bool damaged_ = false;
  int busy_timeout_ms_ = 0;
  Limits limits_;
  std::array<std::unique_ptr<EngineStatement>, kFixedCount> fixed_;  ///< null: not used yet
};

// --- SQLite's files: opening without blocking, the system error behind an SQLite error, the log's size

/// Like sqlite3_open_v2(); `handle` must be closed even after an error. From the first call on, SQLite opens
/// all its files with O_NONBLOCK: checking the name first cannot tell what will be there when it is opened,
/// and opening a pipe waits for its other end, perhaps forever. A pipe then fails as "not a database";
/// regular files are unaffected. Thread: any.
int openDatabaseFile(const std::string& name, sqlite3** handle, int flags, const char* vfs);

/// The file's URI with `immutable`: nothing else belongs to it, and no one changes it. For SQLITE_OPEN_URI.
std::string immutableName(const std::filesystem::path& path);

/// The errno behind an SQLite error if it concerns the disk; else 0. `handle` may be null.
int systemErrorOf(int rc, sqlite3* handle, const std::filesystem::path& path);

/// Size of the log file, from SQLite's own file handle, which is correct for every VFS.
std::uint64_t logBytesOf(sqlite3* handle);

}  // namespace needlelab
