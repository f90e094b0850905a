/// Copies all rows of a store into an empty one on another engine, page by page in key order, and compares
/// the two. A killed copy resumes after the last committed row. `meta` marks the copy as unfinished, and in
/// the source records which copy was begun: no program works with half a copy, and a copy resumes only while
/// its source is unchanged. Files and locks of the folder: service/store_move.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// Keys of `meta`; not themselves copied.
inline constexpr std::string_view kCopyMarkKey = "copy_under_way", kCopiedToKey = "copied_to";

struct CopyMark {
  std::string id;         ///< the copy's id, also stored in its source
  bool compared = false;  ///< all rows are there and match the source's
};

/// Nothing: not a copy, a finished one, or no schema yet.
Result<std::optional<CopyMark>> readCopyMark(Connection& connection);
/// Needs the writer's connection.
Status writeCopyMark(Connection& connection, const CopyMark& mark);
/// The id of the copy begun from this store, if no program has worked with it since.
Result<std::optional<std::string>> copyBegunOf(Connection& connection);
/// To be called before a program works with a store. kInvalidInput: an unfinished copy; the message says what
/// to do.
Status refuseUnfinishedCopy(Connection& connection);
/// Removes the mark of a compared copy, or of a source: later changes are in no copy. Needs the writer's
/// connection.
Status leaveCopyMarks(Connection& connection);

struct CopyProgress {
  bool comparing = false;   ///< false: copying
  std::string_view table;   ///< valid during the call
  std::uint64_t rows = 0;   ///< of this table, in this run
  std::uint64_t bytes = 0;  ///< of chunks, in this step of this run
  bool table_ended = false;
};

struct CopyOptions {
  /// Called after each page that was committed or compared. An error ends the copy, which can be resumed
  /// later.
  std::function<Status(const CopyProgress&)> on_progress = {};
  std::size_t max_rows = SIZE_MAX;  ///< per page, besides kMaxRowsOfPage
};

/// Whether it contains only what its migrations made. Any connection with the newest schema.
Result<bool> isEmptyStore(Connection& connection);

/// Marks an empty store as a copy in progress. Until endCopy(), all triggers are off, because the rows they
/// would add are copied. On SQLite this applies to the connection, so each run starts with this call. On
/// PostgreSQL the user must own the tables: kDenied.
Status beginCopy(Connection& to, const CopyMark& mark);

struct CopiedRows {
  std::uint64_t rows = 0, chunks = 0, bytes = 0;  ///< in this run; `bytes` counts chunks
};

/// Copies the missing rows; `from` must be unchanged since the copy began. Errors: those of either database;
/// a row that `to` rejects is named by table and key.
Result<CopiedRows> copyRows(Connection& from, Connection& to, const CopyOptions& options);

/// Compares all rows value by value. kCorrupt: names the first row that differs or that one side lacks, by
/// table, key and column. Changes neither.
Result<CopiedRows> compareRows(Connection& from, Connection& to, const CopyOptions& options);

/// Ends a compared copy: turns its triggers on again and marks it as compared.
Status endCopy(Connection& to, CopyMark mark);

/// Empties an unfinished copy on PostgreSQL. An SQLite file is removed instead.
Status emptyCopy(Connection& to);

}  // namespace needlelab
