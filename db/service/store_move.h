/// Moves a lab's database between SQLite (needlelab.db in its data folder) and PostgreSQL: copies it,
/// compares the copy, and has the folder work with that. The folder's keys, lists and certificates stay where
/// they are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "db/store_copy.h"

namespace needlelab {

/// In the data folder: a copy of a database on PostgreSQL, until it is complete.
inline constexpr const char* kCopyingDatabase = "needlelab.db.copying";
/// How the names of kept files DIR/store begin.
inline constexpr const char* kReplacedStoreFile = "store.replaced-";

struct StoreMove {
  std::filesystem::path folder = {};  ///< the lab's data folder
  std::string url = {};               ///< the database on PostgreSQL, as openPostgres()
  bool to_postgres = true;            ///< else from there into the folder
  std::string by = {};                ///< who does it, for the audit log
  bool begin_again = false;           ///< empties an unfinished copy instead of going on with it
  std::int64_t now_unix_ns = 0;
  CopyOptions copy = {};
};

struct StoreMoved {
  bool was_done = false;  ///< the folder works with that database already; nothing was done
  bool went_on = false;   ///< with an unfinished copy
  CopiedRows copied, compared;
  std::filesystem::path kept;  ///< the replaced database, or the replaced DIR/store
};

/// The source is opened as a server does (its migrations run, erasures are repeated), gets a line `store
/// copy` in its audit log, and is then locked until the end, as the copy is; nothing is changed in it but two
/// facts in `meta` (the lab's id, kCopiedToKey). A call after one that was killed or has failed goes on; if a
/// program worked with the source in between, the next call is refused, unless `begin_again`. Errors:
/// kInvalidInput (no such folder; the folder is not this lab's; the copy's place is not empty, or is the
/// unfinished copy of something else), kUnavailable (a server or another command has one of the two;
/// PostgreSQL), kCorrupt (the comparison, by table and row), kNoRoom, and those of Store::open().
Result<StoreMoved> moveStore(const StoreMove& move);

/// Completes what a move had decided before a crash: DIR/store and the databases get their names. Under the
/// folder's lock, before the database is opened. Errors: kInvalidInput (DIR/store), kFailed.
Status finishStoreSwitch(const std::filesystem::path& folder);

}  // namespace needlelab
