#include "db/transaction.h"

#include <utility>

namespace needlelab {

Result<Transaction> Transaction::begin(Connection& connection, Kind kind) {
  if (auto done = connection.run(kind == Kind::kWrite ? "BEGIN IMMEDIATE" : "BEGIN"); !done)
    return done.error();
  Transaction transaction(connection);
  if (kind == Kind::kRead) {
    // BEGIN alone reads nothing yet; this fixes what is seen
    if (auto done = connection.run("SELECT count(*) FROM sqlite_schema"); !done) return done.error();
  }
  return transaction;
}

Result<std::optional<Transaction>> Transaction::view(Connection& connection) {
  if (connection.inTransaction()) return std::optional<Transaction>();
  auto begun = begin(connection, Kind::kRead);
  if (!begun) return begun.error();
  return std::optional<Transaction>(std::move(*begun));
}

Transaction::Transaction(Transaction&& other) noexcept
    : connection_(std::exchange(other.connection_, nullptr)) {}

Transaction::~Transaction() {
  // SQLite rolls back by itself on some errors; then there is nothing left to do
  if (connection_ != nullptr && connection_->inTransaction()) (void)connection_->run("ROLLBACK");
}

Status Transaction::commit() {
  if (auto done = connection_->run("COMMIT"); !done) return done;
  connection_ = nullptr;
  return {};
}

Result<Savepoint> Savepoint::begin(Connection& connection) {
  if (auto done = connection.run("SAVEPOINT item"); !done) return done.error();
  return Savepoint(connection);
}

Savepoint::Savepoint(Savepoint&& other) noexcept : connection_(std::exchange(other.connection_, nullptr)) {}

Savepoint::~Savepoint() {
  if (connection_ == nullptr || !connection_->inTransaction()) return;
  (void)connection_->run("ROLLBACK TO item");
  (void)connection_->run("RELEASE item");
}

Status Savepoint::release() {
  if (auto done = connection_->run("RELEASE item"); !done) return done;
  connection_ = nullptr;
  return {};
}

}  // namespace needlelab
