/// Reads the rows of a table a page at a time, so that neither memory nor a view of the database grows with
/// the table. For an erasure, which looks at all texts; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// A page ends at either. More: fewer commits of an erasure; each holds up the other commits for longer: 1
/// MiB of texts that are all written anew, or so many short ones, take some 50 ms.
inline constexpr std::size_t kRowsOfPage = 2048, kBytesOfPage = 1 << 20;

/// The next page of the rows whose numbers are above `after` and up to `last`; empty: there are no more.
/// `sql` takes both numbers (?1, ?2) and gives the rows by number. `make` makes of a row what has its number,
/// `id`, and tells the length of its texts, bytes(). Each page is a read of its own.
template <typename Make>
Result<std::vector<MadeBy<Make>>> pageOf(Connection& connection, std::string_view sql, std::int64_t after,
                                         std::int64_t last, const Make& make) {
  connection.noteShortRead();
  std::vector<MadeBy<Make>> page;
  auto rows = connection.query(sql, after, last);
  for (std::size_t bytes = 0; page.size() < kRowsOfPage && bytes < kBytesOfPage;) {
    ASSIGN_OR_RETURN(auto row, rows.first(make));
    if (!row) break;
    bytes += row->bytes();
    page.push_back(*std::move(row));
  }
  return page;
}

/// Calls `take` with each row.
template <typename Make, typename Take>
Status eachRow(Connection& connection, std::string_view sql, std::int64_t after, std::int64_t last,
               const Make& make, const Take& take) {
  for (;;) {
    ASSIGN_OR_RETURN(const auto page, pageOf(connection, sql, after, last, make));
    if (page.empty()) return {};
    for (const auto& row : page) RETURN_IF_ERROR(take(row));
    after = page.back().id;
  }
}

}  // namespace needlelab
