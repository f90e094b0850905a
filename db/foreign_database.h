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
/// bytes of memory of each byte of a definition. A backup's schema, which is read twice, has some 25 kB, its
/// longest definition 3 kB, its widest table 32 columns; an ANALYZE adds some 200 kB. Less: a later schema is
/// refused; more: a hostile one takes more memory (40 MB as tried).
struct ForeignSchemaBounds {
  static constexpr int kMostTextBytes = 64 << 10;
  static constexpr int kMostColumns = 100;
  static constexpr std::uint64_t kMostBytes = 512 << 10;  ///< of all rows
  static constexpr std::uint64_t kMostRows = 2000;        ///< a page of 64 KiB each stays in memory at worst
};

/// Of one text or BLOB of a foreign file, behind the schema; a longer one is an error. What needlelab stores
/// came in a message of 1 MiB. Less: a lab's own backups cannot be read; more: names in such a text take more
/// memory (some 15 times its length).
inline constexpr int kMostForeignTextBytes = 4 << 20;

/// kNotFound; kInvalidInput: a link, or no regular file; kUnavailable: a log or journal that is not empty
/// lies beside it.
Status requireAlone(const std::filesystem::path& path);

/// Opens a file that is no database of this process, and of which nothing is believed: it alone is read, no
/// log or journal beside it is applied (SQLite would delete any file that a journal names), nothing is
/// written, no link is followed as its last part, nothing that lies in its place is waited for. The schema is
/// needlelab's, as schemaFaults() tells, and stays the one that was looked at: the connection is in a
/// transaction until it is closed. Memory: the bounds above and 2 MB of pages. Ends each read that comes
/// after `most_time` from now (Connection::readUntil()). Errors: kNotFound; kInvalidInput (a link, or no
/// regular file; later: a text that is too long); kUnavailable (a log or journal that is not empty lies
/// beside it, or time is up); kCorrupt (no needlelab database, or somebody changed its schema); kVersion
/// (newer than this program); kFailed (also when `cancelled`, which may be null and must outlive the
/// connection, became true). `time` must outlive the connection. Thread: as the connection.
Result<Connection> openForeign(const std::filesystem::path& path,
                               const std::atomic<bool>* cancelled = nullptr,
                               std::chrono::nanoseconds most_time = kMostTimeOfForeign,
                               TimeSource& time = machineTime());

}  // namespace needlelab
