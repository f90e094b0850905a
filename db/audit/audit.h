/// The audit log: who changed what, and when. Append-only. Each line is written in the same transaction as
/// the change, together with its proof (audit_chain.h).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// The person, station or program that does something.
struct Doer {
  std::string name;     ///< a person's ref; a station's or a program's name
  std::string shown{};  ///< the person's display name; empty: same as `name`
};

struct AuditRow {
  std::uint64_t id = 0;
  std::int64_t unix_ns = 0;
  std::string who;
  std::string action;   ///< e.g. "user add"
  std::string subject;  ///< e.g. a person's ref
  std::string detail;   ///< never contains a secret; names people by ref
};

/// Does not own the connection. Thread: as its Connection; add() needs the writer's.
class AuditStore {
 public:
  explicit AuditStore(Connection& connection) : connection_(connection) {}

  /// Ignores `line.id`. Truncates texts longer than 1,000 bytes and marks them.
  Status add(const AuditRow& line);
  /// Newest first. `limit`: at most 1000; 0 means 1000. Empty `who` and `action`: all. `action` also matches
  /// as a prefix of words: "user" matches "user add".
  Result<std::vector<AuditRow>> list(std::uint32_t limit, std::uint64_t before_id = 0,
                                     std::string_view who = {}, std::string_view action = {});

 private:
  Connection& connection_;
};

}  // namespace needlelab
