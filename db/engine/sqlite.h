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
#include "common/base/time_source.h"
#include "db/engine/engine.h"

namespace needlelab {

/// A log beside the database above this has long reads given up, because they keep it from being emptied. It
/// is some ten minutes of a thousand stations: smaller, no check of a large database would end; greater, it
/// takes room that others lack.
inline constexpr std::uint64_t kMostLogBytesOfReaders = std::uint64_t{4} << 30;

/// An open file with the settings of db/README.md: WAL, synchronous=FULL, foreign keys on,
/// wal_autocheckpoint=0, no checkpoint on close. Only the writer checkpoints: SQLite before 3.51.3 can
/// destroy the database when one connection checkpoints while another commits. Thread: not thread-safe; one
/// thread at a time (SQLite runs without its own mutex).
class SqliteConnection final : public EngineConnection {
 public:
  enum class Mode {
    kWriter,   ///< reads, writes, checkpoints; one per process, and one process per database (lock in
               ///< bootstrap.h)
    kReader,   ///< query_only
    kFrozen,   ///< query_only, of a file that nobody writes to: writes nothing itself, no lock and no
               ///< shared memory beside the file, so that it opens on a full disk; includes the log
    kForeign,  ///< for openForeign() (foreign_database.h): query_only, the file alone, as it is: without what
               ///< a log or a journal beside it says
  };
  struct Options {
    Mode mode = Mode::kReader;
    bool create = false;        ///< writer only: create a missing file
    const char* vfs = nullptr;  ///< a VFS registered by a test; null = the system's
    int busy_timeout_ms = 5000;
    /// Readers only: above this a long read fails with kUnavailable (noteShortRead()).
    std::uint64_t most_log_bytes = kMostLogBytesOfReaders;
    std::filesystem::path copy_of = {};  ///< the file that `path` is a copy of, which messages about its
                                         ///< contents name; empty: none
    /// Foreign files only: reads fail with kUnavailable once `time` is past `until_ns`. `time` may be null:
    /// no bound; it must outlive the connection.
    TimeSource* time = nullptr;
    std::int64_t until_ns = 0;
    /// Foreign files only: as CancelScope, from the opening on. May be null; must outlive the connection.
    const std::atomic<bool>* cancelled = nullptr;
  };

  /// Opens and configures the database. Errors: kNotFound (no file), kInvalidInput (a pipe, device, socket or
  /// folder in its place, or in that of its log or journal), kCorrupt (not a database), kFailed.
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

  /// The result of a checkpoint: pages in the log, and how many of them are already in the database. 0 when
  /// the database was busy.
  struct WalProgress {
    std::uint64_t pages = 0, moved = 0;
  };
  /// As Connection's.
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
  /// What interrupts statements that run, by SQLite's progress handler.
  struct Limits {
    sqlite3* handle = nullptr;
    const std::atomic<bool>* cancelled = nullptr;  ///< null: nothing cancels
    std::uint64_t most_log_bytes = 0;              ///< 0: any size
    std::uint64_t looks = 0;                       ///< calls of the handler since noteShortRead()
    std::uint64_t log_bytes = 0;                   ///< for which the last interruption was; 0: cancelled
    TimeSource* time = nullptr;                    ///< null: no bound of time
    std::int64_t until_ns = 0;
    bool is_late = false;  ///< the last interruption was because of `until_ns`
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
  static int goesOn(void* limits);
  SqliteConnection(std::filesystem::path path, std::filesystem::path origin, sqlite3* handle);

  std::filesystem::path path_, origin_;
  sqlite3* handle_ = nullptr;
  bool damaged_ = false;
  int busy_timeout_ms_ = 0;
  Limits limits_;
  std::array<std::unique_ptr<EngineStatement>, kFixedCount> fixed_;  ///< null: not used yet
};

}  // namespace needlelab
