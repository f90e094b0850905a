/// Opens database files that others may have written: backups, what lies beside them, replaced databases.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// For everything that is read of one foreign file. Less: names in large backups are not looked for to the
/// end; more: one hostile file keeps its reader for longer.
inline constexpr std::chrono::seconds kMostTimeOfForeign{10};

/// Opens a file that is no database of this process, and of which nothing is believed: it alone is read, no
/// log or journal beside it is applied (SQLite would delete any file that a journal names), nothing is
/// written, no link is followed as its last part. The schema is needlelab's, as schemaFaults() tells. Ends
/// each read that comes after `most_time` from now. Errors: kNotFound; kInvalidInput (a link, or no regular
/// file); kUnavailable (a log or journal that is not empty lies beside it, or time is up); kCorrupt (no
/// needlelab database, or somebody changed its schema); kVersion (newer than this program); kFailed (also
/// when `cancelled`, which may be null and must outlive the connection, became true). Thread: as the
/// connection.
Result<Connection> openForeign(const std::filesystem::path& path,
                               const std::atomic<bool>* cancelled = nullptr,
                               std::chrono::nanoseconds most_time = kMostTimeOfForeign);

}  // namespace needlelab
