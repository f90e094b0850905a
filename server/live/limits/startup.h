/// Checks before the server starts. Each error message names the remedy.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// Checks that the clock is not before 2020: clients would reject certificates made then, and sessions would
/// have wrong dates. kFailed.
Status checkClock(std::int64_t now_unix_s);

/// Checks that this user can write to the folder, or to its nearest existing parent. kFailed, with the owner,
/// the mode and the remedy.
Status checkFolderRights(const std::filesystem::path& folder);

/// Checks that a new folder's disk has `min_free_bytes` for this user. kUnavailable.
Status checkRoom(const std::filesystem::path& folder, std::uint64_t min_free_bytes);

/// Why an existing database must not be opened for writing: less than an eighth of `min_free_bytes`
/// (DiskRoom::kDiskShare) is free, so the first write could fail, which would end the server. Empty: it may
/// be opened. `free_bytes`: nothing if unknown.
std::string readOnlyBecause(const std::filesystem::path& folder, std::optional<std::uint64_t> free_bytes,
                            std::uint64_t min_free_bytes);

/// A message if this process may open fewer files than `connections` need, with the limit, the number needed
/// and the remedy. Empty: the limit is sufficient.
std::string tooFewFiles(std::size_t connections);

}  // namespace needlelab
