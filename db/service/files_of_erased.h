/// Files that still hold an erased person: backups and replaced databases. Private to this folder.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <vector>

#include "db/erasure.h"
#include "db/foreign_database.h"

namespace needlelab {

/// For all files together that one erasure looks into. Less: more backups are listed unread; more: whoever
/// fills the folder of backups with hostile files holds up slow requests (imports, backups) for longer.
inline constexpr std::chrono::seconds kMostTimeOfFiles{60};

/// Whether the database names the person in any text but those of documents (profiles, courses), by any of
/// the names that the erasure replaced, or has one of the erased sessions. True also when this cannot be
/// told: it is encrypted, has a log beside it, is no database of needlelab, somebody changed its schema, or
/// `most_time` is up. Reads it as openForeign() does.
bool namesErased(const std::filesystem::path& path, const ErasedRows& erased,
                 const std::atomic<bool>* cancelled, std::chrono::nanoseconds most_time = kMostTimeOfForeign);

/// Databases below the folder of the one in use, and in `backups`, where the last backup was put, for which
/// namesErased() holds, each with its log, sorted. Unfinished copies of backups, and logs whose database is
/// gone, are listed unread; so is what is left when `most_time` is up. Takes no lock.
std::vector<std::filesystem::path> filesThatName(const std::filesystem::path& folder,
                                                 const std::filesystem::path& backups,
                                                 const ErasedRows& erased, const std::atomic<bool>* cancelled,
                                                 std::chrono::nanoseconds most_time = kMostTimeOfFiles);

}  // namespace needlelab
