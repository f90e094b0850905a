/// The log-in state of several servers on one database, and the connections that are for nothing else.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "db/login_store.h"
#include "db/reader_pool.h"

namespace needlelab {

/// Connections beside the writer's: a log-in waits neither for a group of chunks nor for a standby that is
/// away. What they commit is on the primary's disk, and lost when a standby without it is promoted: people
/// type their password again, and a guesser has some tries more. Thread: any.
class SharedLogins {
 public:
  /// `server`: as AccessChange. `clock`: for tests, in place of the database's; must outlive it.
  SharedLogins(StoreAddress address, LoginKey key, std::string server, TimeSource* clock = nullptr)
      : connections_(besideWriter(std::move(address)), kMostIdle, Connection::Mode::kWriter),
        key_(std::move(key)),
        server_(std::move(server)),
        clock_(clock) {}

  [[nodiscard]] const LoginKey& key() const { return key_; }
  [[nodiscard]] const std::string& server() const { return server_; }

  /// Runs `work` in a transaction, with the database's time at its beginning. kUnavailable: the database is
  /// away, or does not answer within some seconds.
  template <typename T>
  Result<T> run(const std::function<Result<T>(LoginStore&, std::int64_t now_ns)>& work) {
    ASSIGN_OR_RETURN(auto connection, connections_.borrow());
    ASSIGN_OR_RETURN(auto transaction, Transaction::begin(*connection, Transaction::Kind::kBeside));
    LoginStore store(*connection, key_);
    ASSIGN_OR_RETURN(const std::int64_t now_ns, nowNs(store));
    auto done = work(store, now_ns);
    if (!done) return done;
    RETURN_IF_ERROR(transaction.commit());
    return done;
  }

 private:
  static constexpr std::size_t kMostIdle = 2;
  static StoreAddress besideWriter(StoreAddress address);
  Result<std::int64_t> nowNs(LoginStore& store) {
    if (clock_ != nullptr) return clock_->nowNs();
    return store.nowNs();
  }

  ReaderPool connections_;
  const LoginKey key_;
  const std::string server_;
  TimeSource* const clock_;
};

/// The first server of several on a database notes which pseudonym.key makes its log-ins; each later one
/// must have the same, or it would know nothing of the others' lock-outs. On the writer. kInvalidInput.
Status claimLoginKey(Connection& connection, const LoginKey& key);

/// For a server that is alone, and keeps log-ins in its memory: what several left is over, tokens, too. On
/// the writer.
Status removeSharedLogins(Connection& connection);

}  // namespace needlelab
