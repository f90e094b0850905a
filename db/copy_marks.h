/// What `meta` says of a copy of the whole store (store_copy.h): in the copy, that it is not finished; in its
/// source, which copy was begun. So nobody works with half a copy, and a copy goes on only while its source
/// is as it was.
#pragma once

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

/// Nothing: no copy, or a finished one, or no schema yet. kCorrupt: it has something else.
Result<std::optional<CopyMark>> readCopyMark(Connection& connection);
/// Writes it. Writer's connection.
Status writeCopyMark(Connection& connection, const CopyMark& mark);

/// The id of the copy that was begun of this store since somebody last worked with it.
Result<std::optional<std::string>> copyBegunOf(Connection& connection);

/// Before anybody works with a store: kInvalidInput for an unfinished copy, with what to do. Any version of
/// the schema, also none.
Status refuseUnfinishedCopy(Connection& connection);
/// Takes the mark of a compared copy away, and that of a source: what is changed from now on is in no copy.
/// Writer's connection.
Status leaveCopyMarks(Connection& connection);

}  // namespace needlelab
