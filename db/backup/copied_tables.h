/// A store's tables as rows that a copy to another engine reads, adds and compares. Private to
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
#include "db/store/connection.h"

namespace needlelab {

struct CopiedTable {
  enum class Type { kInteger, kReal, kText, kBytes };
  struct Column {
    std::string name;
    Type type = Type::kText;
  };
  std::string name;
  std::vector<Column> columns;
  std::vector<std::size_t> key;  ///< positions of the primary key in `columns`, in key order; never empty
  /// Whether the table holds chunks; their bytes are in its last column.
  [[nodiscard]] bool hasChunks() const { return name == "chunks" || name == "derived_chunks"; }
};

/// NULL, integer, real, or text/bytes; the column tells which of the last two.
using CopiedValue = std::variant<std::monostate, std::int64_t, double, std::string>;
using CopiedRow = std::vector<CopiedValue>;

/// Texts and bytes are at most 1 MiB each (the message limit), so a page stays below about 64 MiB.
inline constexpr std::size_t kMaxRowsOfPage = 64;

/// All tables of this program's schema as SQLite describes them, without SQLite's own, in order of creation:
/// each follows the tables that its foreign keys reference. `meta` comes last.
Result<std::vector<CopiedTable>> copiedTables();

/// The rows after the key `after` (empty: from the first), in key order; at most `max_rows` and
/// kMaxRowsOfPage.
Result<std::vector<CopiedRow>> rowsBehind(Connection& connection, const CopiedTable& table,
                                          const CopiedRow& after, std::size_t max_rows);

/// The greatest key; empty if the table has no rows.
Result<CopiedRow> lastKeyOf(Connection& connection, const CopiedTable& table);

/// Adds the rows with one statement; `rows` must not be empty.
Status addRows(Connection& connection, const CopiedTable& table, std::span<const CopiedRow> rows);

CopiedRow keyOf(const CopiedTable& table, const CopiedRow& row);
/// For messages, e.g. "chunks, session 3, seq 5". Texts are truncated to 64 bytes.
std::string rowText(const CopiedTable& table, const CopiedRow& row);

/// The greatest number ever used in each numbered table (AUTOINCREMENT).
using LastNumbers = std::map<std::string, std::int64_t>;
Result<LastNumbers> lastNumbersOf(Connection& connection);
/// Replaces all existing ones. Call within a transaction.
Status setLastNumbers(Connection& connection, const LastNumbers& numbers);

}  // namespace needlelab
