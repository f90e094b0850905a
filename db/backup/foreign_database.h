/// Opens database files that others may have written: backups, files next to them, replaced databases.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "db/store/connection.h"

namespace needlelab {

/// Time limit for reading one foreign file. Smaller: names in large backups are not all searched; greater: a
/// hostile file blocks its reader for longer.
inline constexpr std::chrono::seconds kMostTimeOfForeign{10};

/// Limits on reading a foreign file before its schema is known to be needlelab's: SQLite uses up to about 80
/// bytes of memory per byte of a definition. A backup's own schema needs a tenth of this.
struct ForeignSchemaBounds {
  static constexpr int kMostTextBytes = 64 << 10;
  static constexpr int kMostColumns = 100;
  static constexpr std::uint64_t kMostBytes = 512 << 10;  ///< over all rows
  static constexpr std::uint64_t kMostRows = 2000;        ///< each keeps at worst a 64 KiB page in memory
};

/// Limit for one text or BLOB outside the schema; a longer one is an error. What needlelab stores arrived in
/// messages of at most 1 MiB.
inline constexpr int kMostForeignTextBytes = 4 << 20;

/// Errors: kNotFound; kInvalidInput (a link, or not a regular file); kUnavailable (a non-empty log or journal
/// lies beside it).
Status requireAlone(const std::filesystem::path& path);

/// Opens an untrusted file. Reads that file alone: applies no log or journal beside it (SQLite would delete
/// any file that a journal names), writes nothing, does not follow a link as the last path component, and
/// does not block on a pipe. The schema is needlelab's (schemaFaults()) and stays so: the connection is in a
/// transaction until it is closed. Reads later than `most_time` from now are aborted. Errors: those of
/// requireAlone(); kInvalidInput (later: a text is too long); kUnavailable (time is up); kCorrupt (not a
/// needlelab database, or its schema was changed); kVersion (newer than this program); kFailed (also when
/// `cancelled`, which may be null, became true). `cancelled` and `time` must outlive the connection. Thread:
/// as the connection.
Result<Connection> openForeign(const std::filesystem::path& path,
                               const std::atomic<bool>* cancelled = nullptr,
                               std::chrono::nanoseconds most_time = kMostTimeOfForeign,
                               TimeSource& time = machineTime());

}  // namespace needlelab
