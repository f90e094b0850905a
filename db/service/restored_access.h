/// Who can log in again because a backup was restored that is older than the end of their access.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// One person or station.
struct RestoredAccess {
  std::string name;
  bool station = false;
  std::string text;  ///< "user tom: was disabled since the backup, and can log in again"
};

/// Compares people and stations of the replaced database with those of the restored one: disabled accounts,
/// changed passwords and roles, revoked and renewed keys that are as they were. Tokens are none of them: they
/// live in a server's memory and end with it. Errors: a database that cannot be read.
Result<std::vector<RestoredAccess>> accessValidAgain(Connection& replaced, Connection& restored);

}  // namespace needlelab
