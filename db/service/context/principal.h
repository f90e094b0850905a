/// The requester: a person or a station, its role, and whether its access is still valid.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/audit/audit.h"
#include "db/store/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// The requester: a person or a station.
struct Principal {
  std::string name;  ///< a person's ref; a station's name
  pb::Role role = pb::ROLE_UNSPECIFIED;
  /// Came from a log-in. The account may be disabled, or its role changed, while its requests are queued:
  /// each is refused unless the account is still valid then, and again when a change is written.
  bool logged_in = false;
  /// If servers work together: the number of the account's last change of access (access_numbers.h) at
  /// log-in. The access is invalid once the number differs. Nothing: not compared.
  std::optional<std::int64_t> access_number{};
  std::string called{};  ///< a person's name at log-in
  [[nodiscard]] const std::string& shown() const { return called.empty() ? name : called; }
  [[nodiscard]] Doer doer() const { return {name, called}; }
};

/// "curriculum-manager" etc.
std::string_view roleName(pb::Role role);
/// The inverse; ROLE_UNSPECIFIED for any other text.
pb::Role roleOfName(std::string_view name);

/// Whether the person exists, is not disabled and still has this role and the access it logged in with; or
/// the station exists and is not revoked.
Result<bool> isAccessValid(Connection& connection, const Principal& who);
/// Same for several, in a few statements in total: for a server's connections.
Result<std::vector<bool>> areAccessesValid(Connection& connection, std::span<const Principal> all);
/// kDenied if `who` came from a log-in and its access is no longer valid.
Status checkAccess(Connection& connection, const Principal& who);

}  // namespace needlelab
