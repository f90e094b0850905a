/// Overwrites what SQLite leaves in the free parts of pages.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// The key in `meta` that stands while the free parts of pages may have what an erasure overwrote: set in its
/// transaction to its pseudonym, removed when FreeParts has done and no other erasure has set it.
inline constexpr std::string_view kFreePartsKey = "free_parts_pending";

/// Overwrites them in a copy that nobody else has open and that has no log, as a backup makes while
/// kFreePartsKey stands, and syncs it. `copy`: its open database, outside a transaction; nothing is read by
/// it afterwards. Errors: kFailed, kCorrupt, as FreeParts::clearSome().
Status clearFreePartsOfCopy(sqlite3* copy, const std::filesystem::path& path);

/// SQLite overwrites deleted rows (`secure_delete`), but not the copies that it leaves in the free part of a
/// page when rows move to a neighbour page. This overwrites those bytes in the file, through SQLite's own
/// handle: the space between a page's list of cells and its first cell, and its free blocks without their
/// heads. No byte that SQLite reads is changed, so neither a power cut nor a reader meanwhile sees a
/// difference. It needs no room on the disk, and memory for a bit per page. Tables of recordings, which name
/// nobody, are left alone.
class FreeParts {
 public:
  /// Clears up to `most_pages` pages that earlier calls have not cleared, and syncs the file. True: all are
  /// cleared. Writer's connection, outside a transaction, right after Connection::emptyLog(): while the log
  /// has pages, it clears nothing. Commits between two calls are allowed. Errors: kUnavailable (another
  /// program writes), kFailed (the disk), kCorrupt (a page is not what the tree says; it is left as it is).
  Result<bool> clearSome(Connection& writer, std::size_t most_pages);

 private:
  std::vector<bool> cleared_;  ///< by page number: lowest pages of a tree
};

}  // namespace needlelab
