/// Transactions and savepoints that roll back unless they were committed.
#pragma once

#include <optional>
#include <string>

#include "db/connection.h"

namespace needlelab {

/// BEGIN … COMMIT. Rolls back on destruction unless commit() returned success.
/// Thread: as its Connection, which must outlive it.
class Transaction {
 public:
  enum class Kind {
    kRead,   ///< one unchanging view of the database
    kWrite,  ///< takes the write lock at once
  };
  static Result<Transaction> begin(Connection& connection, Kind kind);
  /// A kRead of one's own, or nothing when a transaction is on already: its view serves as well. For
  /// functions that are called on their own and within others' transactions.
  static Result<std::optional<Transaction>> view(Connection& connection);
  Transaction(Transaction&& other) noexcept;
  Transaction& operator=(Transaction&&) = delete;
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction();
  /// Returns after the data is on the disk (synchronous=FULL).
  Status commit();

 private:
  explicit Transaction(Connection& connection) : connection_(&connection) {}
  Connection* connection_;
};

/// A part of a transaction that can fail alone.
/// Thread: as its Connection, which must outlive it.
class Savepoint {
 public:
  static Result<Savepoint> begin(Connection& connection);
  Savepoint(Savepoint&& other) noexcept;
  Savepoint& operator=(Savepoint&&) = delete;
  Savepoint(const Savepoint&) = delete;
  Savepoint& operator=(const Savepoint&) = delete;
  ~Savepoint();
  Status release();

 private:
  explicit Savepoint(Connection& connection) : connection_(&connection) {}
  Connection* connection_;
};

}  // namespace needlelab
