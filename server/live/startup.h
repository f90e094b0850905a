/// Checks before the server starts: each error message says what to do.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// A clock before 2020 makes certificates that nobody accepts, and sessions of another time. kFailed.
Status checkClock(std::int64_t now_unix_s);

/// The folder, or the nearest one above it that is there, can be written to by this user. kFailed names
/// owner, mode and the way out.
Status checkFolderRights(const std::filesystem::path& folder);

/// The folder's disk has `min_free_bytes` for this user. kUnavailable.
Status checkRoom(const std::filesystem::path& folder, std::uint64_t min_free_bytes);

/// In words, when this process may open fewer files than `connections` need: how many it may, how many are
/// needed and what to do. Empty: there are enough.
std::string tooFewFiles(std::size_t connections);

}  // namespace needlelab
