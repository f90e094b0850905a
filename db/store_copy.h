/// Copies all rows of a store into an empty one on another engine, page by page in the order of their keys,
/// and compares the two. A copy that was killed goes on behind the last row that was committed. The folder's
/// files, locks and decisions are service/store_move's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/copy_marks.h"

namespace needlelab {

struct CopyProgress {
  bool comparing = false;   ///< else: copying
  std::string_view table;   ///< valid during the call
  std::uint64_t rows = 0;   ///< of the table, in this run
  std::uint64_t of = 0;     ///< of `chunks` some so many; 0: unknown
  std::uint64_t bytes = 0;  ///< of chunks, in this step of this run
  bool table_ended = false;
};

struct CopyOptions {
  /// After each page that was committed or compared. Its error ends the copy, which can go on later.
  std::function<Status(const CopyProgress&)> on_progress = {};
  std::size_t most_rows = SIZE_MAX;  ///< of a page, besides the bounds of db/copied_tables.h
};

/// Whether it has nothing but what its migrations made. Any connection, with the newest schema.
Result<bool> isEmptyStore(Connection& connection);

/// Makes an empty store a copy that is under way: mark.compared is false. On PostgreSQL the triggers of all
/// tables are off until endCopy(), because what they would add is copied, too: its user must own the tables,
/// as whoever made the schema does. Errors: kDenied (it does not).
Status beginCopy(Connection& to, const CopyMark& mark);

/// Copies what the copy lacks; `from` must be as it was when the copy began. Needs as much memory as two
/// pages. Errors name table and row that `to` does not take, and those of either database.
struct CopiedRows {
  std::uint64_t rows = 0, bytes = 0;  ///< in this run; bytes of chunks
};
Result<CopiedRows> copyRows(Connection& from, Connection& to, const CopyOptions& options);

/// What comparing found of chunks that are the same in both stores.
struct ComparedRows {
  std::uint64_t rows = 0, chunks = 0, bytes = 0;
  std::uint64_t damaged_chunks = 0;
  std::vector<std::string> damaged;  ///< by session and number, at most kMostDamagedNamed
  std::uint64_t known_damaged = 0;   ///< others, in `quarantined_chunks`
};
inline constexpr std::size_t kMostDamagedNamed = 100;

/// Compares each row of each table, value by value, and computes each chunk's CRC. kCorrupt: the first row
/// that differs, or that one of the two lacks, by table, key and column. Changes neither. A chunk that is
/// damaged in both is a finding: the copy is as good as its source.
Result<ComparedRows> compareRows(Connection& from, Connection& to, const CopyOptions& options);

/// The copy was compared: its triggers are on again, and its mark says so.
Status endCopy(Connection& to, CopyMark mark);

/// Empties an unfinished copy on PostgreSQL. An SQLite file is removed instead.
Status emptyCopy(Connection& to);

}  // namespace needlelab
