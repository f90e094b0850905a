/// Runs two pieces of work of two servers on one database of PostgreSQL in a forced order: the first is held
/// before one of its statements while the second goes as far as it can.
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

#include "db/connection.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "db/service/service.h"
#include "db/store_address.h"

namespace needlelab::test {

/// Counts the statements of one server, and holds it before one of them. Thread: any.
class StatementGate {
 public:
  /// Counts from 0 on. `held_before`: the number, from 0, of the statement before which it is held until
  /// release(); nothing: none.
  void arm(std::optional<std::size_t> held_before);
  /// Before each statement: see StoreAddress::before_statement.
  void pass(std::string_view sql);
  /// Its work is done.
  void end();
  /// Waits until it is held, or done. False: neither within the time.
  bool waitForHoldOrEnd();
  /// Waits until it is done, or a millisecond is over; returns whether it is done.
  bool waitForEnd();
  void release();
  /// Statements since arm().
  [[nodiscard]] std::size_t count() const;
  /// Numbers of those that begin or commit a transaction.
  [[nodiscard]] std::vector<std::size_t> edges() const;

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<std::size_t> held_before_;
  std::size_t count_ = 0;
  std::vector<std::size_t> edges_;
  bool held_ = false, ended_ = false;
};

/// One of two servers: a writer, readers, and the service on both, as Store has them, without its claim to be
/// alone. Thread: one at a time.
class OneServer {
 public:
  /// `address`: of PostgreSQL. Throws when it cannot be opened.
  explicit OneServer(StoreAddress address);

  /// As after a start: nothing is remembered from work before.
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

/// A request, or what a station has stored; returns what the asker is told, as text.
using ServerWork = std::function<std::string(OneServer&)>;

/// What two pieces of work were answered.
struct TwoAnswers {
  std::string first, second;
  /// The first one was held before a statement, so there was one of that number.
  bool was_held = false;
  /// Meanwhile the second one waited for a lock of the first one.
  bool second_waited = false;
};

/// `first` to its end, `between`, then `second`. Both gates have counted their statements afterwards.
TwoAnswers runInTurn(OneServer& first_on, const ServerWork& first, OneServer& second_on,
                     const ServerWork& second, const std::function<void()>& between);

/// `first` up to its statement `held_before`; then `second` to its end, or until it waits for a lock, as
/// `control`, another connection to the database, sees it; then both to their ends. Throws when either does
/// neither within 20 s.
TwoAnswers runInterleaved(OneServer& first_on, const ServerWork& first, OneServer& second_on,
                          const ServerWork& second, std::size_t held_before, Connection& control);

}  // namespace needlelab::test
