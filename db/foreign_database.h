/// Opens database files that others may have written: backups, what lies beside them, replaced databases.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>

#include "common/base/result.h"
#include "common/base/time_source.h"
#include "db/connection.h"

namespace needlelab {

/// For everything that is read of one foreign file. Less: names in large backups are not looked for to the
/// end; more: one hostile file keeps its reader for longer.
inline constexpr std::chrono::seconds kMostTimeOfForeign{10};

/// What is read of a foreign file before its schema is known to be needlelab's: SQLite makes up to some 80
/// bytes of memory of each byte of a definition. A backup's own schema has a tenth of this.
struct ForeignSchemaBounds {
  static constexpr int kMostTextBytes = 64 << 10;
  static constexpr int kMostColumns = 100;
  static constexpr std::uint64_t kMostBytes = 512 << 10;  ///< of all rows
  static constexpr std::uint64_t kMostRows = 2000;        ///< a page of 64 KiB each stays in memory at worst
};

/// Of one text or BLOB behind the schema; a longer one is an error. What needlelab stores came in a message
/// of 1 MiB.
inline constexpr int kMostForeignTextBytes = 4 << 20;

/// kNotFound; kInvalidInput: a link, or no regular file; kUnavailable: a log or journal that is not empty
/// lies beside it.
Status requireAlone(const std::filesystem::path& path);

/// Opens a file of which nothing is believed: it alone is read, no log or journal beside it is applied
/// (SQLite would delete any file that a journal names), nothing is written, no link is followed as its last
/// part, no pipe in its place is waited for. The schema is needlelab's (schemaFaults()), and stays so: the
/// connection is in a transaction until it is closed. Ends each read that comes after `most_time` from now.
/// Errors: those of requireAlone(); kInvalidInput (later: a text that is too long); kUnavailable (time is
/// up); kCorrupt (no needlelab database, or its schema was changed); kVersion (newer than this program);
/// kFailed (also when `cancelled`, which may be null, became true). `cancelled` and `time` must outlive the
/// connection. Thread: as the connection.
Result<Connection> openForeign(const std::filesystem::path& path,
                               const std::atomic<bool>* cancelled = nullptr,
                               std::chrono::nanoseconds most_time = kMostTimeOfForeign,
                               TimeSource& time = machineTime());

}  // namespace needlelab
