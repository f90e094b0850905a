/// Who changed what, when. Only ever appended to, in the same transaction as the change.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

struct AuditRow {
  std::uint64_t id = 0;
  std::int64_t unix_ns = 0;
  std::string who;
  std::string action;   ///< e.g. "user add"
  std::string subject;  ///< e.g. the user's name
  std::string detail;   ///< never a secret
};

/// Functions on a connection, which it does not own. Thread: as its Connection; add() needs the writer's.
class AuditStore {
 public:
  explicit AuditStore(Connection& connection) : connection_(connection) {}

  /// `row.id` is not read. Texts beyond 1,000 bytes are cut, with a mark.
  Status add(const AuditRow& row);
  /// Newest first; limit 0: 1000, at most 1000. Empty `who` and `action`: all; an action as its first words,
  /// "user" is "user add", too.
  Result<std::vector<AuditRow>> list(std::uint32_t limit, std::uint64_t before_id = 0,
                                     std::string_view who = {}, std::string_view action = {});

 private:
  Connection& connection_;
};

}  // namespace needlelab
