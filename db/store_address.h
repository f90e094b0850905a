/// Where the lab's database is, and the file DIR/store, by which a folder knows a database elsewhere.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/engine/lab_identity.h"

namespace needlelab {

struct StoreAddress {
  /// DIR/needlelab.db. Beside it are the lab's keys and lists, also where the database is elsewhere.
  std::filesystem::path path;
  std::string url = {};  ///< of PostgreSQL; empty: the database is the SQLite file `path`
  /// As PostgresOptions::lab. Not of the connection that makes or migrates the database.
  std::optional<LabIdentity> lab = {};
  /// Connections for log-in state (shared_logins.h): they wait for no standby, and not long for anything.
  bool beside_writer = false;
  /// Of a server that works together with others on the database: its name (serverNameOf); of connections
  /// that write, PostgresOptions::server.
  std::string server = {};
  /// As PostgresOptions::before_statement. Thread: any connection's, several at a time.
  std::function<void(std::string_view sql)> before_statement = {};

  // a path alone is an SQLite file's address
  StoreAddress(std::filesystem::path file) : path(std::move(file)) {}  // NOLINT(google-explicit-constructor)
  StoreAddress(std::filesystem::path file, std::string postgres_url)
      : path(std::move(file)), url(std::move(postgres_url)) {}
  [[nodiscard]] bool isPostgres() const { return !url.empty(); }
};

/// At a start: what stays wrong however often it is tried - user, password, rights (kDenied), a version of
/// schema or server (kVersion) - as kInvalidInput, whose exit code makes systemd try no more.
Error wrongStore(Error error);
/// In a program that serves: the same, and kInvalidInput, as kUnavailable. kDenied would be a log-in's wrong
/// password.
Error storeAway(Error error);

/// Opens it. Modes other than kWriter only read. `create`: of an SQLite file. Errors: as Connection::open()
/// and openPostgres().
Result<Connection> openAt(const StoreAddress& address, Connection::Mode mode, bool create = false);

/// Opens `url`, which somebody gives to a running server, only to read. `path`: as Connection::path().
/// `before`: called when the address is one that is taken, before anything connects; its error is returned.
/// Errors: kInvalidInput (checkAddressFromOutside() in engine/open_postgres.h), those of openPostgres().
Result<Connection> openFromOutside(const std::filesystem::path& path, const std::string& url,
                                   const std::function<Status()>& before);

/// Opens it for a program that writes: makes an SQLite file. No other program opens a database of PostgreSQL
/// so, unless both have a name in `server` (Connection::isAlone). `least`: what an ack must survive. Errors:
/// as openAt(); kInvalidInput when it survives less.
Result<Connection> openToServe(const StoreAddress& address, Durability least);

/// What DIR/store says.
struct StoreFile {
  std::string url;
  std::string lab;  ///< the id of the lab whose database is there
  /// The name that DIR/needlelab.db gets, whose copy is there (service/store_move.h); empty: none.
  std::string kept = {};
};
inline constexpr const char* kStoreFile = "store";

/// Nothing: the folder has no such file. kInvalidInput: it has something else; names the line.
Result<std::optional<StoreFile>> readStoreFile(const std::filesystem::path& folder,
                                               const char* name = kStoreFile);
Status writeStoreFile(const std::filesystem::path& folder, const StoreFile& file);

/// By what servers on one database are told apart: DIR/server, which `needlelab-admin server join` writes.
inline constexpr const char* kServerFile = "server";
/// Of the folder that made the database, which has no such file.
inline constexpr const char* kFirstServer = "first";
/// kInvalidInput: the file has something else.
Result<std::string> serverNameOf(const std::filesystem::path& folder);
/// What the file says of a server of this name: letters, digits, '-', at most 64.
std::string serverFileText(const std::string& name);

/// Where the database of `folder` is. `url`: what --store says; empty: what DIR/store says, or the folder
/// itself. Errors: kInvalidInput (--store, and the folder has a database of its own; DIR/store).
Result<StoreAddress> addressOf(const std::filesystem::path& folder, const std::string& url);

/// Each lab has an id in its database, which DIR/store repeats: compares the two, and writes DIR/store where
/// it is not there and the database is new, or has another URL now. For a connection that may write, to a
/// database on PostgreSQL. Returns the id. kInvalidInput: it is another lab's.
Result<std::string> claimStore(Connection& connection, const StoreAddress& address);

}  // namespace needlelab
