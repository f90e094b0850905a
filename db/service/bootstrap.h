/// The server's folder: created on the first start, locked by one process, opened with writer, readers and
/// service.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "db/access_feed.h"
#include "db/acknowledged.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/service/service.h"
#include "db/shared_logins.h"
#include "db/store_address.h"

namespace needlelab {

/// An exclusive lock on DIR/lock (flock), held until destruction. The kernel releases it when the process
/// dies.
class FolderLock {
 public:
  /// kUnavailable: "a server is running on DIR: use --server", with the holder's name and process id.
  static Result<FolderLock> take(const std::filesystem::path& folder, const std::string& holder);
  FolderLock(FolderLock&& other) noexcept;
  FolderLock& operator=(FolderLock&&) = delete;
  ~FolderLock();

 private:
  explicit FolderLock(int fd) : fd_(fd) {}
  int fd_;
};

/// The open database of DIR: DIR/needlelab.db, or one on PostgreSQL (store_address.h). The destructor drains
/// the writer and releases the lock. Thread: open and destroy on one thread; its parts as each says.
class Store {
 public:
  struct Options {
    std::string holder = "needlelab-server";  ///< the lock's holder, for other processes' error messages
    bool create = true;                       ///< false: kNotFound when DIR has no database
    /// The database is there, on PostgreSQL, and DIR has only the keys and lists; empty: it is where
    /// DIR/store says, else DIR/needlelab.db.
    std::string store_url = {};
    Durability least_durability = Durability::kNothing;  ///< what an ack must survive; else nothing is stored
    /// Other servers that say so, too, may work on the database at the same time, each with a folder of its
    /// own; what they know of log-ins is in it. On PostgreSQL only.
    bool together = false;
    DbWriter::Options writer = {};
    DbWriter::OnFatal on_fatal = {};
    /// Says why the database must not be written to; empty: it may be. Called on the thread that opens, after
    /// what a killed program left was removed.
    std::function<std::string()> read_only_because = {};
    TimeSource* time = &machineTime();      ///< the service's; must outlive the store
    std::filesystem::path backup_key = {};  ///< the file of the key that encrypts backups; empty: none
  };
  /// Creates DIR (0700) and the database (0600) when they are missing, removes what a killed program left,
  /// runs the migrations, loads the samples into a new database, completes and repeats erasures, empties the
  /// log. An existing database whose disk is full, or which must not be written to, is opened read-only:
  /// nothing is written, neither into it nor beside it. Errors: kUnavailable (locked; others work on the
  /// database, and it is not `together`, or its schema is older), kNoRoom (the disk is full, and the database
  /// is new, has an older schema, or waits for erasures), kInvalidInput (backup_key; together on SQLite; a
  /// pipe, device, socket or folder in a file's place; addressOf() and claimStore(); wrongStore()), kCorrupt,
  /// kFailed, and the others of openPostgres().
  static Result<std::unique_ptr<Store>> open(const std::filesystem::path& folder, const Options& options);

  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;
  ~Store();

  /// Keeps in DIR/audit.head how far the audit log has come (db/audit_head.h); what is written later is not
  /// held until the next call, or the store's end. One thread at a time.
  Status keepAuditHead();

  /// Keeps in DIR/acknowledged how far the acknowledgements have come (db/acknowledged.h), up to some of the
  /// last call: call it about once a second. Waits for the disk, and for nothing else. One thread at a time.
  Status keepAcknowledged();
  /// What the database lacks of what was acknowledged before this store was opened; empty: nothing.
  [[nodiscard]] std::string acknowledgedMissing() const { return acknowledged_ ? acknowledged_->lack() : ""; }

  /// Ends the writer, once the two above are not called any more. What it commits is kept, too.
  void stopWriting();

  /// The name of this folder's server among those that work together (serverNameOf); empty: it is alone.
  [[nodiscard]] const std::string& togetherAs() const { return together_as_; }

  /// Why nothing can be written, until the folder is opened again; nothing: the writer works.
  [[nodiscard]] const std::optional<Error>& readOnly() const { return read_only_; }

  [[nodiscard]] DbWriter& writer() { return *writer_; }
  [[nodiscard]] ReaderPool& readers() { return *readers_; }
  [[nodiscard]] Service& service() { return *service_; }
  /// What servers on this database know of each other's log-ins; null: this one is alone.
  [[nodiscard]] SharedLogins* logins() { return logins_.get(); }
  /// Of such a store: what hears of the others' changes of access (access_feed.h).
  [[nodiscard]] std::unique_ptr<AccessFeed> accessFeed() const;
  [[nodiscard]] const std::filesystem::path& databasePath() const { return readers_->path(); }
  /// What a killed program had left, and opening this store removed (removeFolderLeftovers).
  [[nodiscard]] const std::vector<std::filesystem::path>& leftoversRemoved() const { return leftovers_; }
  /// How many erasures were repeated when this store was opened, because it is a restored backup.
  [[nodiscard]] std::size_t erasuresRepeated() const { return erasures_repeated_; }
  /// What a person should know if the clock was behind when this store was opened (seen_time.h); else empty.
  [[nodiscard]] const std::string& clockBehind() const { return clock_behind_; }
  /// The same if it was ahead.
  [[nodiscard]] const std::string& clockAhead() const { return clock_ahead_; }

 private:
  explicit Store(FolderLock lock) : lock_(std::move(lock)) {}
  Status shareLogins(Connection& writer, const StoreAddress& address);
  /// open(), with the errors as the parts have them.
  static Result<std::unique_ptr<Store>> openUnlessWrong(const std::filesystem::path& folder,
                                                        const Options& options);
  FolderLock lock_;  // destroyed last
  std::optional<Error> read_only_;
  std::optional<StoreAddress> address_;   ///< of a store that works together with others
  std::unique_ptr<SharedLogins> logins_;  ///< the writer's items have its key
  std::unique_ptr<ReaderPool> readers_;
  std::unique_ptr<DbWriter> writer_;
  std::unique_ptr<Service> service_;
  std::size_t erasures_repeated_ = 0;
  std::string clock_behind_, clock_ahead_, together_as_;
  std::vector<std::filesystem::path> leftovers_;
  std::optional<AcknowledgedMark> acknowledged_;  ///< of a database on PostgreSQL
};

}  // namespace needlelab
