/// The audit log: who changed what, and when. Append-only; written in the same transaction as the change,
/// with its proof (audit_chain.h).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Who does something: a person, a station or a program.
struct Doer {
  std::string name;     ///< a person's ref; a station's or a program's name
  std::string shown{};  ///< what a person is called; empty: as `name`
};

struct AuditRow {
  std::uint64_t id = 0;
  std::int64_t unix_ns = 0;
  std::string who;
  std::string action;   ///< e.g. "user add"
  std::string subject;  ///< e.g. a person's ref
  std::string detail;   ///< never a secret; says who by refs
};

/// Does not own the connection. Thread: as its Connection; add() needs the writer's.
class AuditStore {
 public:
  explicit AuditStore(Connection& connection) : connection_(connection) {}

  /// Ignores `line.id`. Truncates texts beyond 1,000 bytes, with a mark.
  Status add(const AuditRow& line);
  /// Newest first; limit 0: 1000, at most 1000. Empty `who` and `action`: all. `action` also matches as a
  /// prefix of words: "user" matches "user add".
  Result<std::vector<AuditRow>> list(std::uint32_t limit, std::uint64_t before_id = 0,
                                     std::string_view who = {}, std::string_view action = {});

 private:
  Connection& connection_;
};

}  // namespace needlelab
