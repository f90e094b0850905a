/// Rewrites tables, so that no page of theirs keeps bytes of rows that are gone.
#pragma once

#include <span>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// SQLite overwrites deleted rows (`secure_delete`), but not the copies that it leaves in the free part of a
/// page when rows move to a neighbour page. This writes all rows of each table, and its indexes, into pages
/// that were overwritten as a whole. It needs memory for one table at a time. For tables whose
/// rows have a key of their own. Writer's connection, in a transaction; no trigger runs and no foreign key is
/// checked meanwhile, because each row comes back as it was. Errors: kFailed, kCorrupt (the rows that came
/// back are not as many), kNoRoom.
Status rewriteTables(Connection& writer, std::span<const std::string_view> tables);

}  // namespace needlelab
