/// Erased people by name or UUID, to recognise their data in late stations or restored backups.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"

namespace needlelab {

/// How long an erased person's typed name waits for a manager instead of counting for a namesake: longer than
/// any station keeps its recordings.
inline constexpr std::int64_t kErasedNamesKept_ns = std::int64_t{400} * 86'400'000'000'000;

/// Whether a person with this name was erased after `started_unix_ns`, within the last kErasedNamesKept_ns: a
/// session that began then may be that person's, so it waits. Thread: as the connection; also for the next
/// function.
Result<bool> wasErased(Connection& connection, std::string_view name, std::int64_t started_unix_ns,
                       std::int64_t now_unix_ns);
/// Whether this is the UUID of an erased person.
Result<bool> isErased(Connection& connection, const Uuid& person);

}  // namespace needlelab
