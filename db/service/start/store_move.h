/// Moves a lab's database between SQLite (needlelab.db in its data folder) and PostgreSQL: copies it,
/// compares the copy, and switches the folder to it. The folder's keys, lists and certificates stay in place.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "db/backup/store_copy.h"

namespace needlelab {

struct StoreMove {
  std::filesystem::path folder = {};  ///< the lab's data folder
  std::string url = {};               ///< the PostgreSQL database, as in openPostgres()
  bool to_postgres = true;            ///< false: from there into the folder
  std::string by = {};                ///< the user, for the audit log
  bool begin_again = false;           ///< empties an unfinished copy instead of resuming it
  std::int64_t now_unix_ns = 0;
  CopyOptions copy = {};
};

struct StoreMoved {
  bool was_done = false;  ///< the folder already uses that database; nothing was done
  bool went_on = false;   ///< resumed an unfinished copy
  CopiedRows copied, compared;
  std::filesystem::path kept;  ///< the replaced database, or the replaced DIR/store
};

/// Opens the source like a server (migrations run, erasures are repeated), adds a line `store copy` to its
/// audit log, and locks both source and copy until the end. Otherwise changes only two facts in the source's
/// `meta` (the lab's id, kCopiedToKey). A call after a killed or failed one resumes; if a program worked with
/// the source in between, it is refused unless `begin_again`. Errors: kInvalidInput (no such folder; not this
/// lab's folder; the copy's place is not empty, or has an unfinished copy of something else), kUnavailable (a
/// server or another command uses one of the two; PostgreSQL), kCorrupt (the comparison, by table and row),
/// kNoRoom, and those of Store::open().
Result<StoreMoved> moveStore(const StoreMove& move);

}  // namespace needlelab
