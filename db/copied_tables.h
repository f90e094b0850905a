/// The tables of a store as rows that a copy to another engine reads, adds and compares. Private to
/// store_copy.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

struct CopiedTable {
  enum class Type { kInteger, kReal, kText, kBytes };
  struct Column {
    std::string name;
    Type type = Type::kText;
  };
  std::string name;
  std::vector<Column> columns;
  std::vector<std::size_t> key;  ///< the primary key's places in `columns`, in its order; never empty
  /// Whether it has chunks, whose last column has their bytes.
  [[nodiscard]] bool hasChunks() const { return name == "chunks" || name == "derived_chunks"; }
};

/// NULL, a whole number, a number, or a text or bytes: which of these two, the column says.
using CopiedValue = std::variant<std::monostate, std::int64_t, double, std::string>;
using CopiedRow = std::vector<CopiedValue>;

/// Of texts and bytes of at most 1 MiB each, as messages bring them: a page stays below some 64 MiB.
inline constexpr std::size_t kMostRowsOfPage = 64;

/// All tables of this program's schema, as SQLite describes them, but SQLite's own: in the order in which
/// they are made, so that each is behind those that its foreign keys name; `meta` last.
Result<std::vector<CopiedTable>> copiedTables();

/// The rows behind the key `after` (empty: from the first) in the order of the key, at most `most_rows` and
/// kMostRowsOfPage.
Result<std::vector<CopiedRow>> rowsBehind(Connection& connection, const CopiedTable& table,
                                          const CopiedRow& after, std::size_t most_rows);

/// The greatest key; empty: the table has no row.
Result<CopiedRow> lastKeyOf(Connection& connection, const CopiedTable& table);

/// Adds them by one statement; `rows` is not empty.
Status addRows(Connection& connection, const CopiedTable& table, std::span<const CopiedRow> rows);

CopiedRow keyOf(const CopiedTable& table, const CopiedRow& row);
/// "chunks, session 3, seq 5": for messages. Texts are cut after 64 bytes.
std::string rowText(const CopiedTable& table, const CopiedRow& row);

/// The greatest number that each numbered table (AUTOINCREMENT) ever had.
using LastNumbers = std::map<std::string, std::int64_t>;
Result<LastNumbers> lastNumbersOf(Connection& connection);
/// In the place of all that are there. Within a transaction.
Status setLastNumbers(Connection& connection, const LastNumbers& numbers);

}  // namespace needlelab
