/// SQLite, owned: Connection, Statement (statement.h), Transaction (transaction.h). Errors are values.
#pragma once

#include <sqlite3.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <unordered_map>

#include "common/base/result.h"
#include "db/statement.h"

namespace needlelab {

/// An open database with the settings of DESIGN §8: WAL, synchronous=FULL, foreign keys on,
/// wal_autocheckpoint=0, and no checkpoint when it closes. Only the writer calls checkpointPassive(): SQLite
/// before 3.51.3 can destroy the database when one connection checkpoints while another commits. Thread: not
/// thread-safe; one thread at a time (SQLite runs without its own mutex). Statements must not outlive it.
class Connection {
 public:
  enum class Mode {
    kWriter,  ///< reads, writes, checkpoints; there is one in a process, and one process (bootstrap.h holds a
              ///< lock)
    kReader,  ///< query_only
  };
  struct Options {
    Mode mode = Mode::kReader;
    bool create = false;        ///< writer only: make the file when it is missing
    const char* vfs = nullptr;  ///< a VFS registered by a test; null = the system's
    int busy_timeout_ms = 5000;
  };

  /// Opens and sets it up. Errors: kNotFound (no file), kCorrupt (not a database), kFailed.
  static Result<Connection> open(const std::filesystem::path& path, const Options& options);

  Connection(Connection&& other) noexcept;
  Connection& operator=(Connection&& other) noexcept;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection();

  /// A statement of this SQL, from the cache where it has been used before. `sql` is one statement.
  Statement prepare(std::string_view sql);
  /// Prepares and binds the values in order.
  template <typename... Values>
  Statement query(std::string_view sql, const Values&... values) {
    Statement statement = prepare(sql);
    (statement.bind(values), ...);
    return statement;
  }
  /// Prepares, binds, runs to the end.
  template <typename... Values>
  Status run(std::string_view sql, const Values&... values) {
    return query(sql, values...).run();
  }
  /// Several statements without parameters, e.g. a migration.
  Status script(const std::string& sql);

  [[nodiscard]] std::int64_t lastRowId() const;
  /// Rows that the last INSERT, UPDATE or DELETE touched.
  [[nodiscard]] std::int64_t changes() const;
  [[nodiscard]] bool inTransaction() const;

  /// What a checkpoint found: pages in the log, and how many of them are in the database now. 0 when the
  /// database was busy.
  struct WalProgress {
    std::uint64_t pages = 0, moved = 0;
  };
  /// Moves what readers allow from the WAL into the database. Writer only, outside a transaction. A busy
  /// database is no error.
  Status checkpointPassive(WalProgress* progress = nullptr);

  /// Size of the write-ahead log's file; 0 when there is none (yet).
  [[nodiscard]] std::uint64_t walBytes();

  /// True once a call failed in a way that puts stored data in doubt: disk full, I/O error, corrupt file,
  /// memory. Sticky: the writer stops for good on it.
  [[nodiscard]] bool damaged() const { return damaged_; }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] sqlite3* handle() { return handle_; }

 private:
  friend class Statement;
  Connection(std::filesystem::path path, sqlite3* handle);
  void close();
  void giveBack(sqlite3_stmt* statement);
  /// The error of the last call, and `damaged_` where it says so.
  Error errorOf(int rc, std::string_view what);

  std::filesystem::path path_;
  sqlite3* handle_ = nullptr;
  bool damaged_ = false;
  std::unordered_map<std::string, sqlite3_stmt*>
      idle_;  ///< prepared statements nobody uses now, by their SQL
};

}  // namespace needlelab
