/// Runs two pieces of work by two servers on one PostgreSQL database in a forced order: the first is held
/// before one of its statements while the second runs as far as it can.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "db/service/service.h"
#include "db/sessions/db_writer.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"

namespace needlelab::test {

/// Counts one server's statements, and holds it before one of them. Thread: any.
class StatementGate {
 public:
  /// Counts from 0. `held_before`: the number, from 0, of the statement before which it is held until
  /// release(); nothing: never.
  void arm(std::optional<std::size_t> held_before);
  /// Called before each statement: see StoreAddress::before_statement.
  void pass(std::string_view sql);
  /// The work is done.
  void end();
  /// Waits until it is held or done. False: neither in time.
  bool waitForHoldOrEnd();
  /// Waits until it is done or a millisecond has passed; returns whether it is done.
  bool waitForEnd();
  void release();
  /// Statements since arm().
  [[nodiscard]] std::size_t count() const;
  /// Numbers of the statements that begin or commit a transaction.
  [[nodiscard]] std::vector<std::size_t> edges() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<std::size_t> held_before_;
  std::size_t count_ = 0;
  std::vector<std::size_t> edges_;
  bool held_ = false, ended_ = false;
};

/// One of two servers: a writer, readers, and the service on both, like Store, but without its exclusive
/// claim. Thread: one at a time.
class OneServer {
 public:
  /// `address`: of PostgreSQL. Throws if it cannot be opened.
  explicit OneServer(StoreAddress address);

  /// As after a restart: nothing is remembered from earlier work.
  void startAnew();
  [[nodiscard]] Service& service() { return *service_; }
  [[nodiscard]] DbWriter& writer() { return *writer_; }
  [[nodiscard]] StatementGate& gate() { return gate_; }

 private:
  StatementGate gate_;
  StoreAddress address_;
  std::unique_ptr<DbWriter> writer_;
  std::unique_ptr<ReaderPool> readers_;
  std::unique_ptr<Service> service_;
};

/// A request, or storing what a station sent; returns the answer as text.
using ServerWork = std::function<std::string(OneServer&)>;

/// The answers of two pieces of work.
struct TwoAnswers {
  std::string first, second;
  /// The first one was held, so it had a statement with that number.
  bool was_held = false;
  /// Meanwhile the second one waited for a lock held by the first.
  bool second_waited = false;
};

/// Runs `first` to its end, `between`, then `second`. Afterwards both gates have counted their statements.
TwoAnswers runInTurn(OneServer& first_on, const ServerWork& first, OneServer& second_on,
                     const ServerWork& second, const std::function<void()>& between);

/// Runs `first` up to its statement `held_before`; then `second` to its end, or until it waits for a lock, as
/// seen by `control`, another connection to the database; then both to their ends. Throws if one of them does
/// neither within 20 s.
TwoAnswers runInterleaved(OneServer& first_on, const ServerWork& first, OneServer& second_on,
                          const ServerWork& second, std::size_t held_before, Connection& control);

}  // namespace needlelab::test
