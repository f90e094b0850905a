/// The location of the lab's database, the file DIR/store, which points a folder to a database elsewhere, and
/// a pool of readers.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/engine/engine.h"
#include "db/store/connection.h"

namespace needlelab {

struct StoreAddress {
  /// DIR/needlelab.db. The lab's keys and lists are next to it, even if the database is elsewhere.
  std::filesystem::path path;
  std::string url = {};  ///< PostgreSQL URL; empty: the database is the SQLite file `path`
  /// Like PostgresOptions::lab. Not set for the connection that creates or migrates the database.
  std::optional<LabIdentity> lab = {};
  /// For log-in state (shared_logins.h): connections wait for no standby, and only briefly for anything else.
  bool is_side_connection = false;
  /// The server's name (serverNameOf), if it works with others on the database; PostgresOptions::server of
  /// connections that write.
  std::string server = {};
  /// Like PostgresOptions::before_statement. Thread: that of any connection, several at a time.
  std::function<void(std::string_view sql)> before_statement = {};

  // a path alone is the address of an SQLite file
  StoreAddress(std::filesystem::path file) : path(std::move(file)) {}  // NOLINT(google-explicit-constructor)
  StoreAddress(std::filesystem::path file, std::string postgres_url)
      : path(std::move(file)), url(std::move(postgres_url)) {}
  [[nodiscard]] bool isPostgres() const { return !url.empty(); }
};

/// At start-up: turns errors that a retry cannot fix - user, password, rights (kDenied), schema or server
/// version (kVersion) - into kInvalidInput, whose exit code stops systemd from retrying.
Error wrongStore(Error error);
/// In a running server: turns the same errors, and kInvalidInput, into kUnavailable. kDenied would look like
/// a wrong password at log-in.
Error storeAway(Error error);

/// Opens the database. Modes other than kWriter only read. `create`: for SQLite files. Errors: as
/// Connection::open() and openPostgres().
Result<Connection> openAt(const StoreAddress& address, Connection::Mode mode, bool create = false);

/// Opens `url`, given by someone to a running server, for reading only. `path`: as Connection::path().
/// `before` is called once the address is accepted, before connecting; its error is returned. Errors:
/// kInvalidInput (checkAddressFromOutside() in engine/open_postgres.h), those of openPostgres().
Result<Connection> openFromOutside(const std::filesystem::path& path, const std::string& url,
                                   const std::function<Status()>& before);

/// Opens the database for a program that writes; creates an SQLite file. On PostgreSQL only one program may
/// do so at a time, unless both have a name in `server` (Connection::isAlone). `least`: what an ack must
/// survive. Errors: as openAt(); kInvalidInput if an ack survives less.
Result<Connection> openToServe(const StoreAddress& address, Durability least);

/// Contents of DIR/store.
struct StoreFile {
  std::string url;
  std::string lab;  ///< the id of the lab whose database is there
  /// The new name of DIR/needlelab.db after it was copied there (service/store_move.h); empty: none.
  std::string kept = {};
};
inline constexpr const char* kStoreFile = "store";

/// Nothing: the folder has no such file. kInvalidInput: unexpected contents; names the line.
Result<std::optional<StoreFile>> readStoreFile(const std::filesystem::path& folder,
                                               const char* name = kStoreFile);
Status writeStoreFile(const std::filesystem::path& folder, const StoreFile& file);

/// Distinguishes the servers on one database: DIR/server, written by `needlelab-admin server join`.
inline constexpr const char* kServerFile = "server";
/// Name of the server whose folder created the database and has no such file.
inline constexpr const char* kFirstServer = "first";
/// kInvalidInput: unexpected file contents.
Result<std::string> serverNameOf(const std::filesystem::path& folder);
/// File contents for a server of this name: letters, digits, '-', at most 64.
std::string serverFileText(const std::string& name);

/// The location of `folder`'s database. `url`: from --store; empty: from DIR/store, or the folder itself.
/// Errors: kInvalidInput (--store is given and the folder has a database of its own; DIR/store is invalid).
Result<StoreAddress> addressOf(const std::filesystem::path& folder, const std::string& url);

/// Each lab's database contains an id, which DIR/store repeats: compares the two. Writes DIR/store if it is
/// missing and the database is new, or if the URL has changed. For a connection to PostgreSQL that may write.
/// Returns the id. kInvalidInput: another lab's database.
Result<std::string> claimStore(Connection& connection, const StoreAddress& address);

// --- a pool of query-only connections, borrowed for a short time

/// Opens a connection if none is idle, and keeps at most `max_idle`. Thread: borrow() may be called from any
/// thread; a Lease is used by one thread at a time. The pool must outlive its leases.
class ReaderPool {
 public:
  /// A borrowed connection; the destructor returns it.
  class Lease {
   public:
    Lease(Lease&&) noexcept = default;
    Lease& operator=(Lease&&) = delete;
    ~Lease();
    Connection& operator*() { return *connection_; }
    Connection* operator->() { return connection_.get(); }

   private:
    friend class ReaderPool;
    Lease(ReaderPool& pool, std::unique_ptr<Connection> connection)
        : pool_(&pool), connection_(std::move(connection)) {}
    ReaderPool* pool_;
    std::unique_ptr<Connection> connection_;  ///< null after a move
  };

  /// `mode`: kReader, or kFrozen if there is no writer.
  explicit ReaderPool(StoreAddress address, std::size_t max_idle = 8,
                      Connection::Mode mode = Connection::Mode::kReader)
      : address_(std::move(address)), max_idle_(max_idle), mode_(mode) {}

  Result<Lease> borrow();
  [[nodiscard]] const std::filesystem::path& path() const { return address_.path; }

 private:
  const StoreAddress address_;
  const std::size_t max_idle_;
  const Connection::Mode mode_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Connection>> idle_;  ///< guarded by mutex_
};

}  // namespace needlelab
