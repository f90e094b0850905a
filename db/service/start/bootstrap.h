/// The server's folder: created at the first start, locked by one process, opened with writer, readers and
/// service.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/login/access_numbers.h"
#include "db/login/shared_logins.h"
#include "db/service/folder/data_folder.h"
#include "db/service/service.h"
#include "db/sessions/acknowledged.h"
#include "db/sessions/db_writer.h"
#include "db/store/store_address.h"

namespace needlelab {

/// The open database of DIR: DIR/needlelab.db, or one on PostgreSQL (store_address.h). The destructor drains
/// the writer and releases the lock. Thread: open and destroy on one thread; its parts as documented there.
class Store {
 public:
  struct Options {
    std::string holder = "needlelab-server";  ///< the lock's holder, for other processes' error messages
    bool create = true;                       ///< false: kNotFound if DIR has no database
    /// PostgreSQL URL of the database; DIR then holds only keys and lists. Empty: the one named by DIR/store,
    /// else DIR/needlelab.db.
    std::string store_url = {};
    Durability min_durability = Durability::kNothing;  ///< what an ack must survive; else nothing is stored
    /// Other servers with this option may work on the database at the same time, each with its own folder;
    /// the database holds their common log-in state. PostgreSQL only.
    bool together = false;
    DbWriter::Options writer = {};
    DbWriter::OnFatal on_fatal = {};
    /// Returns why the database must not be written; empty: it may be. Called on the opening thread, after a
    /// killed program's leftovers were removed.
    std::function<std::string()> read_only_because = {};
    TimeSource* time = &machineTime();      ///< the service's; must outlive the store
    std::filesystem::path backup_key = {};  ///< the key file for encrypting backups; empty: none
  };
  /// Creates DIR (0700) and the database (0600) if missing, removes what a killed program left, runs the
  /// migrations, loads the samples into a new database, completes and repeats erasures, empties the log. An
  /// existing database whose disk is full, or which must not be written, is opened read-only: nothing is
  /// written into it or beside it. Errors: kUnavailable (locked; others work on the database and it is not
  /// `together`, or its schema is older), kNoRoom (the disk is full, and the database is new, has an older
  /// schema or has pending erasures), kInvalidInput (backup_key; together on SQLite; a pipe, device, socket
  /// or folder in a file's place; addressOf() and claimStore(); wrongStore()), kCorrupt, kFailed, and others
  /// of openPostgres().
  static Result<std::unique_ptr<Store>> open(const std::filesystem::path& folder, const Options& options);

  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;
  ~Store();

  /// Saves in DIR/audit.head how far the audit log has come (db/audit/audit_head.h). Later lines are not
  /// covered until the next call, or the store's end. One thread at a time.
  Status storeAuditHead();

  /// Saves in DIR/acknowledged how far the acknowledgements have come (db/sessions/acknowledged.h), as of
  /// about the previous call: call it about once a second. Blocks on the disk only. One thread at a time.
  Status keepAcknowledged();
  /// Acknowledged data that the database lacked when this store was opened; empty: none.
  [[nodiscard]] std::string acknowledgedMissing() const { return acknowledged_ ? acknowledged_->lack() : ""; }

  /// Ends the writer; the two functions above must no longer be called. Also saves what it commits.
  void stopWriting();

  /// The name of this folder's server among those that work together (serverNameOf); empty: it is alone.
  [[nodiscard]] const std::string& sharedServerName() const { return shared_server_name_; }

  /// Why nothing can be written until the folder is reopened; nothing: the writer works.
  [[nodiscard]] const std::optional<Error>& readOnly() const { return read_only_; }

  [[nodiscard]] DbWriter& writer() { return *writer_; }
  [[nodiscard]] ReaderPool& readers() { return *readers_; }
  [[nodiscard]] Service& service() { return *service_; }
  /// Log-in state shared by the servers on this database; null: this one is alone.
  [[nodiscard]] SharedLogins* logins() { return logins_.get(); }
  /// For such a store: receives other servers' changes of access (access_numbers.h).
  [[nodiscard]] std::unique_ptr<AccessFeed> accessFeed() const;
  [[nodiscard]] const std::filesystem::path& databasePath() const { return readers_->path(); }
  /// Leftovers of a killed program that opening this store removed (removeFolderLeftovers).
  [[nodiscard]] const std::vector<std::filesystem::path>& leftoversRemoved() const { return leftovers_; }
  /// Number of erasures repeated when this store was opened, because it is a restored backup.
  [[nodiscard]] std::size_t erasuresRepeated() const { return erasures_repeated_; }
  /// A warning if the clock was behind when this store was opened (seen_time.h); else empty.
  [[nodiscard]] const std::string& clockBehind() const { return clock_behind_; }
  /// Same if it was ahead.
  [[nodiscard]] const std::string& clockAhead() const { return clock_ahead_; }

 private:
  explicit Store(FolderLock lock) : lock_(std::move(lock)) {}
  Status shareLogins(Connection& writer, const StoreAddress& address);
  /// open(), with the parts' own error codes.
  static Result<std::unique_ptr<Store>> openUnlessWrong(const std::filesystem::path& folder,
                                                        const Options& options);
  FolderLock lock_;  // destroyed last
  std::optional<Error> read_only_;
  std::optional<StoreAddress> address_;   ///< for a store that works together with others
  std::unique_ptr<SharedLogins> logins_;  ///< its key is used by the writer's items
  std::unique_ptr<ReaderPool> readers_;
  std::unique_ptr<DbWriter> writer_;
  std::unique_ptr<Service> service_;
  std::size_t erasures_repeated_ = 0;
  std::string clock_behind_, clock_ahead_, shared_server_name_;
  std::vector<std::filesystem::path> leftovers_;
  std::optional<AcknowledgedMark> acknowledged_;  ///< PostgreSQL only
};

// --- access that had been withdrawn and is valid again after a restore

/// A person or station whose access is valid again.
struct RestoredAccess {
  std::string name, ref;  ///< for a station both are its name
  bool station = false;
  std::string text;  ///< "user tom: was disabled since the backup, and can log in again"
};

/// Compares people and stations of the replaced database `kept` with the restored one, after its first start,
/// which repeats erasures. Finds accounts that were disabled, passwords and roles that were changed, and keys
/// that were revoked or renewed since the backup and are back in their earlier state. Adds an audit line for
/// each. Errors: a database cannot be read.
Result<std::vector<RestoredAccess>> noteAccessValidAgain(Store& store, const std::filesystem::path& kept);

}  // namespace needlelab
