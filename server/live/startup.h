/// Checks before the server starts: each error message says what to do.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// Checks that the clock is not before 2020: clients would reject certificates made then, and sessions would
/// have wrong dates. kFailed.
Status checkClock(std::int64_t now_unix_s);

/// Checks that this user can write to the folder, or to its nearest existing parent. kFailed names owner,
/// mode and the remedy.
Status checkFolderRights(const std::filesystem::path& folder);

/// Checks that the folder's disk has `min_free_bytes` for this user. kUnavailable.
Status checkRoom(const std::filesystem::path& folder, std::uint64_t min_free_bytes);

/// A message when this process may open fewer files than `connections` need: the limit, the number needed and
/// the remedy. Empty: the limit is sufficient.
std::string tooFewFiles(std::size_t connections);

}  // namespace needlelab
