/// Copies all rows of a store into an empty one on another engine, page by page in the order of their keys,
/// and compares the two. A copy that was killed goes on behind the last row that was committed. `meta` of the
/// copy says that it is unfinished, and that of its source which copy was begun: so no program works with
/// half a copy, and it goes on only while its source is as it was. The folder's files and locks are
/// service/store_move's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// Keys of `meta`; no copy has either of its source.
inline constexpr std::string_view kCopyMarkKey = "copy_under_way", kCopiedToKey = "copied_to";

struct CopyMark {
  std::string id;         ///< of the copy, also in its source
  bool compared = false;  ///< all rows are there, and were compared with the source's
};

/// Nothing: no copy, or a finished one, or no schema yet.
Result<std::optional<CopyMark>> readCopyMark(Connection& connection);
/// Writer's connection.
Status writeCopyMark(Connection& connection, const CopyMark& mark);
/// The id of the copy that was begun of this store since a program last worked with it.
Result<std::optional<std::string>> copyBegunOf(Connection& connection);
/// Before a program works with a store: kInvalidInput for an unfinished copy, with what to do.
Status refuseUnfinishedCopy(Connection& connection);
/// Takes the mark of a compared copy away, and that of a source: what is changed from now on is in no copy.
/// Writer's connection.
Status leaveCopyMarks(Connection& connection);

struct CopyProgress {
  bool comparing = false;   ///< else: copying
  std::string_view table;   ///< valid during the call
  std::uint64_t rows = 0;   ///< of the table, in this run
  std::uint64_t bytes = 0;  ///< of chunks, in this step of this run
  bool table_ended = false;
};

struct CopyOptions {
  /// After each page that was committed or compared. Its error ends the copy, which can go on later.
  std::function<Status(const CopyProgress&)> on_progress = {};
  std::size_t most_rows = SIZE_MAX;  ///< of a page, besides kMostRowsOfPage
};

/// Whether it has nothing but what its migrations made. Any connection, with the newest schema.
Result<bool> isEmptyStore(Connection& connection);

/// Makes an empty store a copy that is under way. Until endCopy() the triggers of all tables are off, because
/// what they would add is copied, too: on SQLite for this connection, so each run begins with this. On
/// PostgreSQL its user must own the tables: kDenied.
Status beginCopy(Connection& to, const CopyMark& mark);

struct CopiedRows {
  std::uint64_t rows = 0, chunks = 0, bytes = 0;  ///< in this run; bytes of chunks
};

/// Copies what the copy lacks; `from` must be as it was when the copy began. Errors name table and row that
/// `to` does not take, and those of either database.
Result<CopiedRows> copyRows(Connection& from, Connection& to, const CopyOptions& options);

/// Compares each row of each table, value by value. kCorrupt: the first row that differs, or that one of the
/// two lacks, by table, key and column. Changes neither.
Result<CopiedRows> compareRows(Connection& from, Connection& to, const CopyOptions& options);

/// The copy was compared: its triggers are on again, and its mark says so.
Status endCopy(Connection& to, CopyMark mark);

/// Empties an unfinished copy on PostgreSQL. An SQLite file is removed instead.
Status emptyCopy(Connection& to);

}  // namespace needlelab
