/// The audit log: who changed what, and when. Append-only; written in the same transaction as the change,
/// with its proof (audit_chain.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Who does something: a person, a station or a program.
struct Doer {
  std::string name;
  /// When the person's account was made: the name alone may be another person's later. 0: it is no person,
  /// or whoever has the name.
  std::int64_t account_unix_ns = 0;
};

struct AuditRow {
  std::uint64_t id = 0;
  std::int64_t unix_ns = 0;
  std::string who;
  std::string action;                ///< e.g. "user add"
  std::string subject;               ///< e.g. the user's name
  std::string detail;                ///< never a secret
  std::string imported_by{};         ///< who imported the line; empty: it was written here
  std::string imported_from{};       ///< the import, and the line's number there
  std::int64_t account_unix_ns = 0;  ///< of `who`, as Doer has it; not stored
};

/// Does not own the connection. Thread: as its Connection; add() needs the writer's.
class AuditStore {
 public:
  explicit AuditStore(Connection& connection) : connection_(connection) {}

  /// Ignores `line.id` and the import. Truncates texts beyond 1,000 bytes, with a mark. Whoever was erased
  /// since the line was begun stands in it under the pseudonym (ErasureStore::withoutErased).
  Status add(const AuditRow& line);
  /// Newest first; limit 0: 1000, at most 1000. Empty `who` and `action`: all. `action` also matches as a
  /// prefix of words: "user" matches "user add".
  Result<std::vector<AuditRow>> list(std::uint32_t limit, std::uint64_t before_id = 0,
                                     std::string_view who = {}, std::string_view action = {});

 private:
  Connection& connection_;
};

/// Numbers many lines of one transaction. On PostgreSQL a trigger notes the log's last number in one row with
/// each line, and each note walks through what those before left (as SumsOfManySessions says): it rests, and
/// the number is noted once. On SQLite the table numbers its lines. Without finish() the transaction, or the
/// savepoint around all of it, must be rolled back. Does not own the connection. Thread: the writer's.
class NumbersOfManyLines {
 public:
  explicit NumbersOfManyLines(Connection& writer) : writer_(writer) {}

  /// The number to store the next line with: `wanted`, or the next one; nothing: the table gives it.
  Result<std::optional<std::int64_t>> next(std::optional<std::int64_t> wanted);
  /// The trigger numbers lines from now on.
  Status finish();

 private:
  Connection& writer_;
  std::optional<std::int64_t> last_;  ///< the greatest that the log ever had; nothing: the trigger works
};

}  // namespace needlelab
