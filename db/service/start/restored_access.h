/// Access that had been withdrawn and is valid again after a restore.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/service/start/bootstrap.h"

namespace needlelab {

/// A person or station whose access is valid again.
struct RestoredAccess {
  std::string name, ref;  ///< for a station both are its name
  bool station = false;
  std::string text;  ///< "user tom: was disabled since the backup, and can log in again"
};

/// Compares people and stations of the replaced database `kept` with the restored one, after its first start,
/// which repeats erasures. Finds accounts that were disabled, passwords and roles that were changed, and keys
/// that were revoked or renewed since the backup and are back in their earlier state. Adds an audit line for
/// each. Errors: a database cannot be read.
Result<std::vector<RestoredAccess>> noteAccessValidAgain(Store& store, const std::filesystem::path& kept);

}  // namespace needlelab
