/// Which of two databases a data folder works with, when one is a copy of the other: the old one, or from one
/// instant on the copy. Under the folder's lock.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// In the data folder: a copy of a database on PostgreSQL, until it is complete (store_move.h).
inline constexpr const char* kCopyingDatabase = "needlelab.db.copying";
/// How the names of kept files DIR/store begin.
inline constexpr const char* kReplacedStoreFile = "store.replaced-";

/// The folder's database is on PostgreSQL from now on: writes DIR/store, and keeps needlelab.db, with its
/// log, as needlelab.db.replaced-TIME, which is returned. A crash leaves the one or the other, or what
/// finishStoreSwitch() completes. Nobody has the database open.
Result<std::filesystem::path> switchToPostgres(const std::filesystem::path& folder, const std::string& url,
                                               const std::string& lab, std::int64_t now_unix_ns);

/// The folder's database is its compared copy needlelab.db.copying from now on, under the name needlelab.db.
/// Keeps DIR/store as store.replaced-TIME, which is returned. Nobody has the copy open; no log is beside it.
Result<std::filesystem::path> switchToSqlite(const std::filesystem::path& folder, std::int64_t now_unix_ns);

/// Completes what was decided before a crash. Before the database is opened. Errors: kInvalidInput
/// (DIR/store), kFailed.
Status finishStoreSwitch(const std::filesystem::path& folder);

}  // namespace needlelab
