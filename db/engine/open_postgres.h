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
  /// Who else may work on the database while this connection exists; enforced again after each reconnection.
  enum class Others {
    kAll,     ///< this connection excludes no one
    kShared,  ///< excludes all but other kShared connections; the first one is alone until admitOthers()
    kNone,
  };
  Others others = Others::kAll;
  /// A name that only one connection at a time may have: letters, digits, '-'. Empty: none.
  std::string only_one_named = {};
  std::chrono::milliseconds connect_timeout{5000};
  /// If the answer to a statement takes longer, the connection counts as lost: the server may be stopped, or
  /// the network gone.
  std::chrono::milliseconds answer_timeout{30'000};
  /// PostgreSQL ends a connection that is idle within a transaction for this long: its program may be stopped
  /// while others wait for its locks. Shorter: they wait less; longer: a slow step between two statements
  /// does not lose the transaction.
  std::chrono::milliseconds max_idle{30'000};
  /// If the peer's TCP acknowledges nothing for this long, the connection is lost (tcp_user_timeout): the
  /// network is gone. A server that merely hangs still acknowledges. TCP's own retries become ever rarer, so
  /// that data sent during an outage would arrive only seconds after it ends.
  std::chrono::milliseconds tcp_patience{10'000};
  /// Refuses write transactions with kUnavailable while an ack would survive less than this.
  Durability least = Durability::kNothing;
  /// COMMIT waits for the primary's disk only, not for a standby: for data that may be lost when a standby is
  /// promoted and must not wait for an absent one.
  bool local_commits = false;
  /// Value of `needlelab.server` in this connection (current_setting), for triggers: letters, digits and '-'.
  std::string server = {};
  /// Like EngineConnection::stayWith(), from the first connection on.
  std::optional<LabIdentity> lab = {};
  /// Called with the text of each statement before it is sent, including BEGIN and COMMIT; may block; may be
  /// empty. For tests that control the order of two connections. Thread: the connection's.
  std::function<void(std::string_view sql)> before_statement = {};
};

/// Checks an address that someone gives to a running server: connecting uses this machine's files and
/// environment, including passwords. kInvalidInput: it has more than user, host, port, dbname and sslmode
/// (such as hostaddr, to which libpq would send the password of `host`); it names another machine without
/// sslmode=verify-full; and the cases of openPostgres(). Does not connect.
Status checkAddressFromOutside(const std::string& url);

/// Errors: kInvalidInput (not a PostgreSQL URL; contains a password; no such database, user or host),
/// kVersion (PostgreSQL before version 15), kDenied (user or password, pg_hba.conf), kUnavailable (no answer,
/// or refused for now; `others` or `only_one_named` excludes a connection that exists; not the database of
/// `lab`). A connection that is lost later and cannot be restored always gives kUnavailable. Messages never
/// contain a password.
Result<std::unique_ptr<EngineConnection>> openPostgres(const PostgresOptions& options);

}  // namespace needlelab
