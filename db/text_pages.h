/// Reads the rows of a table a page at a time, so that neither memory nor a view of the database grows with
/// the table. Private to db.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// A page ends at either. More: fewer commits of an erasure; each holds up the other commits for longer: 1
/// MiB of texts that are all written anew, or so many short ones, take some 50 ms.
inline constexpr std::size_t kRowsOfPage = 2048, kBytesOfPage = 1 << 20;

/// How many rows a statement asks for (LIMIT) whose reader wants `most_bytes`: an engine may read its result
/// whole before the first row. Few at first; then by what the rows so far had, at most twice as many as
/// before.
class RowsAtOnce {
 public:
  explicit RowsAtOnce(std::size_t most_bytes) : most_bytes_(most_bytes) {}
  [[nodiscard]] std::int64_t count() const { return static_cast<std::int64_t>(count_); }
  /// Before each statement of a reader that goes on when it has `most_bytes`: as much again. Else it would
  /// ask for its next rows one by one.
  void goOn() {
    if (bytes_ < most_bytes_) return;
    bytes_ = rows_ = 0;
    count_ = kFewRows;
  }
  /// Takes note of a row. True: it was the last of those asked for, ask for count() more.
  bool took(std::size_t bytes) {
    bytes_ += bytes;
    ++rows_;
    if (++of_count_ < count_) return false;
    of_count_ = 0;
    const std::size_t each = bytes_ / rows_ + 1, left = most_bytes_ - std::min(most_bytes_, bytes_);
    count_ = std::clamp<std::size_t>(left / each + 1, 1, std::min(2 * count_, kRowsOfPage));
    return true;
  }

 private:
  static constexpr std::size_t kFewRows = 16;
  const std::size_t most_bytes_;
  std::size_t count_ = kFewRows, of_count_ = 0, rows_ = 0, bytes_ = 0;
};

/// The next page of the rows whose numbers are above `after` and up to `last`; empty: there are no more.
/// `sql` takes both numbers (?1, ?2) and ends with the rows' order, by number. `make` makes of a row what has
/// its number, `id`, and tells the length of its texts, bytes(). Each page is a read of its own.
template <typename Make>
Result<std::vector<MadeBy<Make>>> pageOf(Connection& connection, std::string_view sql, std::int64_t after,
                                         std::int64_t last, const Make& make) {
  connection.noteShortRead();
  std::vector<MadeBy<Make>> page;
  RowsAtOnce at_once(kBytesOfPage);
  const std::string some = std::string(sql) + " LIMIT ?3";
  for (std::size_t bytes = 0; page.size() < kRowsOfPage && bytes < kBytesOfPage;) {
    auto rows = connection.query(some, after, last, at_once.count());
    for (bool all = false; !all && page.size() < kRowsOfPage && bytes < kBytesOfPage;) {
      ASSIGN_OR_RETURN(auto row, rows.first(make));
      if (!row) return page;
      bytes += row->bytes();
      after = row->id;
      all = at_once.took(row->bytes());
      page.push_back(*std::move(row));
    }
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
