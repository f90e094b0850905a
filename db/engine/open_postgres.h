/// Connects to PostgreSQL.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/engine/engine.h"

namespace needlelab {

struct PostgresOptions {
  std::string url;         ///< postgresql://user@host:port/database?parameters, or "host=… user=…"
  bool read_only = false;  ///< refuses changes
  /// Who else may work on the database until this connection ends; held again after each reconnection.
  enum class Others {
    kAll,       ///< this connection keeps nobody out
    kTogether,  ///< those that say so, too; the first to come is alone until letOthersIn()
    kNone,
  };
  Others others = Others::kAll;
  /// A name that one connection at a time has, of those that give one: letters, digits, '-'. Empty: none.
  std::string only_one_named = {};
  std::chrono::milliseconds connect_timeout{5000};
  /// A statement whose answer does not come within this time loses the connection: the server may be stopped,
  /// or the network gone.
  std::chrono::milliseconds answer_timeout{30'000};
  /// PostgreSQL ends a connection that asks nothing for this long within a transaction: its program may be
  /// stopped, and others wait for its locks. Shorter: they wait less; longer: a slow step between two
  /// statements loses no transaction.
  std::chrono::milliseconds most_idle{30'000};
  /// What the other machine's TCP has not confirmed for this long loses the connection (tcp_user_timeout):
  /// the network is gone. A server that only stands still confirms. TCP by itself tries again ever more
  /// rarely, so that what was sent into a cut comes some seconds after its end.
  std::chrono::milliseconds tcp_patience{10'000};
  /// Write transactions are refused with kUnavailable while an ack would survive less than this.
  Durability least = Durability::kNothing;
  /// A COMMIT waits for the disk of the server of PostgreSQL that took it and for no standby: for what may be
  /// lost when a standby is promoted, and must not wait for one that is away.
  bool local_commits = false;
  /// What `needlelab.server` is in this connection (current_setting), for triggers: letters, digits and '-'.
  std::string server = {};
  /// As EngineConnection::stayWith(), from the first connection on.
  std::optional<LabIdentity> lab = {};
  /// Called with its text before each statement is sent, BEGIN and COMMIT too; may block; may be empty. For
  /// tests that decide in which order two connections go on. Thread: the connection's.
  std::function<void(std::string_view sql)> before_statement = {};
};

/// Of an address that somebody gives to a running server: connecting uses this machine's files and
/// environment, also passwords. kInvalidInput: it has more than user, host, port, dbname and sslmode (such as
/// hostaddr, to which libpq would send the password of `host`); a host that is not this machine, without
/// sslmode=verify-full; and as openPostgres(). Connects to nothing.
Status checkAddressFromOutside(const std::string& url);

/// Errors: kInvalidInput (not a URL of PostgreSQL; it has a password; no such database, user or host),
/// kVersion (an engine before version 15), kDenied (user or password, pg_hba.conf), kUnavailable (nobody
/// answers, or refuses for now; somebody works there who `others` or `only_one_named` do not let work beside
/// it; it is not the database of `lab`). A connection that is lost later and cannot be made again is always
/// kUnavailable. No message has a password.
Result<std::unique_ptr<EngineConnection>> openPostgres(const PostgresOptions& options);

}  // namespace needlelab
