/// How stores read many rows and check edits: a list of texts as one parameter, a table page by page, the
/// revision that an edit was made from. Private to db.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

// --- a list of texts as one parameter of a statement, however many there are

/// SQL for "is among the texts of parameter `parameter`" (from 1), to be appended to an expression: "name" +
/// amongTexts(…).
std::string amongTexts(Connection& connection, int parameter);
/// Binds such a list to the next parameter of `statement`, which must belong to this connection. Copies the
/// texts.
Statement& bindTexts(Connection& connection, Statement& statement, std::span<const std::string> texts);

/// A page ends at either limit. Greater: fewer commits per erasure, but each delays other commits for longer:
/// rewriting 1 MiB of texts, or that many short ones, takes about 50 ms.
inline constexpr std::size_t kRowsOfPage = 2048, kBytesOfPage = 1 << 20;

/// How many rows to ask for in a statement (LIMIT) whose reader wants `most_bytes`: an engine may read its
/// whole result before the first row. Starts small, then follows the average row size, at most doubling each
/// time.
class RowsAtOnce {
 public:
  explicit RowsAtOnce(std::size_t most_bytes) : max_bytes_(most_bytes) {}
  [[nodiscard]] std::int64_t count() const { return static_cast<std::int64_t>(count_); }
  /// Call before each statement of a reader that continues after reaching `most_bytes`: extends the budget by
  /// that much. Otherwise it would ask for the next rows one by one.
  void goOn() {
    if (bytes_ < max_bytes_) return;
    bytes_ = rows_ = 0;
    count_ = kFewRows;
  }
  /// Counts a row. True: it was the last requested one; ask for count() more.
  bool took(std::size_t bytes) {
    bytes_ += bytes;
    ++rows_;
    if (++of_count_ < count_) return false;
    of_count_ = 0;
    const std::size_t each = bytes_ / rows_ + 1, left = max_bytes_ - std::min(max_bytes_, bytes_);
    count_ = std::clamp<std::size_t>(left / each + 1, 1, std::min(2 * count_, kRowsOfPage));
    return true;
  }

 private:
  static constexpr std::size_t kFewRows = 16;
  const std::size_t max_bytes_;
  std::size_t count_ = kFewRows, of_count_ = 0, rows_ = 0, bytes_ = 0;
};

/// The next page of rows with numbers above `after` and up to `last`; empty at the end. `sql` takes both
/// numbers (?1, ?2) and ends with the order by number. `make` converts a row into an object with its number
/// `id` and the length of its texts, bytes(). Each page is a separate read.
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

// --- edits of documents: each names the revision that it was made from

/// A document's newest revision, with its author and time.
struct NewestRevision {
  std::uint32_t revision = 0;  ///< 0: no revision exists
  std::string by;
  std::int64_t unix_ns = 0;
};

/// kConflict, with `current_revision`, unless `base` is the newest revision. Without `base` any revision is
/// accepted. `what`: e.g. "profile 'knee'".
Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest);

}  // namespace needlelab
