/// The log-in state shared by several servers on one database, and the connections reserved for it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/login/login_store.h"
#include "db/store/store_address.h"

namespace needlelab {

/// Connections beside the writer's: a log-in waits neither for a group of chunks nor for an absent standby.
/// Their commits are on the primary's disk only, and lost if a standby is promoted without them: people type
/// their password again, and a guesser gets some more attempts. Thread: any.
class SharedLogins {
 public:
  /// `server`: as in AccessChange. `clock`: replaces the database's in tests; must outlive this object.
  SharedLogins(StoreAddress address, LoginKey key, std::string server, TimeSource* clock = nullptr)
      : connections_(sideAddress(std::move(address)), kMostIdle, Connection::Mode::kWriter),
        key_(std::move(key)),
        server_(std::move(server)),
        clock_(clock) {}

  [[nodiscard]] const LoginKey& key() const { return key_; }
  [[nodiscard]] const std::string& server() const { return server_; }

  /// Runs `work` in a transaction, with the database's time at its start. kUnavailable: the database is away,
  /// or does not answer within some seconds.
  template <typename T>
  Result<T> run(const std::function<Result<T>(LoginStore&, std::int64_t now_ns)>& work) {
    ASSIGN_OR_RETURN(auto connection, connections_.borrow());
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(*connection, Transaction::Kind::kSide));
    LoginStore store(*connection, key_);
    ASSIGN_OR_RETURN(const std::int64_t now_ns, nowNs(store));
    auto done = work(store, now_ns);
    if (!done) return done;
    RETURN_IF_ERROR(transaction.commit());
    return done;
  }

 private:
  static constexpr std::size_t kMostIdle = 2;
  static StoreAddress sideAddress(StoreAddress address);
  Result<std::int64_t> nowNs(LoginStore& store) {
    if (clock_ != nullptr) return clock_->nowNs();
    return store.nowNs();
  }

  ReaderPool connections_;
  const LoginKey key_;
  const std::string server_;
  TimeSource* const clock_;
};

/// The first of several servers on a database records which pseudonym.key makes its log-ins. Each later one
/// must have the same key, or it would not see the others' lock-outs. Call on the writer. kInvalidInput.
Status claimLoginKey(Connection& connection, const LoginKey& key);

/// For a single server that keeps log-ins in memory: removes everything that several servers left, including
/// tokens. Call on the writer.
Status removeSharedLogins(Connection& connection);

}  // namespace needlelab
