#include "db/copied_tables.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "db/schema.h"

namespace needlelab {
namespace {

constexpr std::size_t kShownKeyBytes = 64;

CopiedTable::Type typeOfSqlite(std::string_view name) {
  if (name == "INTEGER") return CopiedTable::Type::kInteger;
  if (name == "REAL") return CopiedTable::Type::kReal;
  return name == "BLOB" ? CopiedTable::Type::kBytes : CopiedTable::Type::kText;
}

Result<CopiedTable> describeTable(Connection& sqlite, const std::string& name) {
  CopiedTable table{name, {}, {}};
  std::map<std::int64_t, std::size_t> key;
  auto rows = sqlite.query("SELECT name, type, pk FROM pragma_table_info(?) ORDER BY cid", name);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    if (rows.integer(2) > 0) key[rows.integer(2)] = table.columns.size();
    table.columns.push_back({rows.text(0), typeOfSqlite(rows.text(1))});
  }
  for (const auto& [place, column] : key) table.key.push_back(column);
  return table;
}

/// "a", "b" of the given columns.
std::string namesOf(const CopiedTable& table, const std::vector<std::size_t>& places,
                    std::string_view behind_each = "") {
  std::string text;
  for (const std::size_t place : places)
    text += fmt::format("{}\"{}\"{}", text.empty() ? "" : ", ", table.columns[place].name, behind_each);
  return text;
}

std::string namesOfAll(const CopiedTable& table) {
  std::string text;
  for (const auto& column : table.columns)
    text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", column.name);
  return text;
}

std::string marksOf(std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += i == 0 ? "?" : ", ?";
  return text;
}

/// FROM … behind `after`, in the key's order, and what it wants bound but the limit.
std::string fromBehind(const CopiedTable& table, const CopiedRow& after) {
  std::string text = fmt::format(" FROM \"{}\"", table.name);
  if (!after.empty())
    text += fmt::format(" WHERE ({}) > ({})", namesOf(table, table.key), marksOf(table.key.size()));
  return text + fmt::format(" ORDER BY {} LIMIT ?", namesOf(table, table.key));
}

void bindCopied(Statement& statement, CopiedTable::Type type, const CopiedValue& value) {
  if (const auto* number = std::get_if<std::int64_t>(&value)) {
    statement.bind(*number);
  } else if (const auto* real = std::get_if<double>(&value)) {
    statement.bind(*real);
  } else if (const auto* text = std::get_if<std::string>(&value)) {
    if (type == CopiedTable::Type::kBytes)
      statement.bind(viewOf(*text));
    else
      statement.bind(std::string_view(*text));
  } else {
    statement.bindNull();
  }
}

void bindCopiedKey(Statement& statement, const CopiedTable& table, const CopiedRow& key) {
  for (std::size_t i = 0; i < key.size(); ++i)
    bindCopied(statement, table.columns[table.key[i]].type, key[i]);
}

CopiedValue copiedValue(const Statement& row, int column, CopiedTable::Type type) {
  if (row.isNull(column)) return {};
  switch (type) {
    case CopiedTable::Type::kInteger:
      return row.integer(column);
    case CopiedTable::Type::kReal:
      return row.real(column);
    default:
      return row.text(column);
  }
}

/// How many rows behind `after` make a page.
Result<std::int64_t> rowsOfPage(Connection& connection, const CopiedTable& table, const CopiedRow& after,
                                std::size_t most_rows) {
  std::string lengths;
  for (const auto& column : table.columns)
    if (column.type == CopiedTable::Type::kText || column.type == CopiedTable::Type::kBytes)
      lengths += fmt::format("{}coalesce(length(\"{}\"), 0)", lengths.empty() ? "" : " + ", column.name);
  const auto most = static_cast<std::int64_t>(std::min(most_rows, kMostRowsOfPage));
  if (lengths.empty()) return most;
  auto rows = connection.prepare("SELECT " + lengths + fromBehind(table, after));
  bindCopiedKey(rows, table, after);
  rows.bind(most);
  std::int64_t count = 0;
  for (std::uint64_t bytes = 0; bytes < kMostBytesOfPage; ++count) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    bytes += rows.natural(0);
  }
  return count;
}

/// Of one column of all rows; all are there.
template <typename Value, typename Of>
std::vector<Value> columnOf(std::span<const CopiedRow> rows, std::size_t column, const Of& of) {
  std::vector<Value> values;
  values.reserve(rows.size());
  for (const CopiedRow& row : rows) values.push_back(of(row[column]));
  return values;
}

/// Whether PostgreSQL can take them as lists, a column each.
bool fitIntoLists(const CopiedTable& table, std::span<const CopiedRow> rows) {
  const bool has_reals = std::any_of(table.columns.begin(), table.columns.end(), [](const auto& column) {
    return column.type == CopiedTable::Type::kReal;
  });
  return !has_reals && std::none_of(rows.begin(), rows.end(), [](const CopiedRow& row) {
    return std::any_of(row.begin(), row.end(), [](const CopiedValue& value) {
      return std::holds_alternative<std::monostate>(value);
    });
  });
}

/// All in one statement: one round trip in place of one a row.
Status addRowsAsLists(Connection& connection, const CopiedTable& table, std::span<const CopiedRow> rows) {
  Statement add =
      connection.prepare(fmt::format("INSERT INTO \"{}\" ({}) SELECT * FROM unnest({})", table.name,
                                     namesOfAll(table), marksOf(table.columns.size())));
  const auto text = [](const CopiedValue& value) { return std::string_view(std::get<std::string>(value)); };
  const auto bytes = [](const CopiedValue& value) { return viewOf(std::get<std::string>(value)); };
  const auto number = [](const CopiedValue& value) { return std::get<std::int64_t>(value); };
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    switch (table.columns[i].type) {
      case CopiedTable::Type::kInteger: {
        const auto values = columnOf<std::int64_t>(rows, i, number);
        add.bindList(std::span(values));
        break;
      }
      case CopiedTable::Type::kBytes: {
        const auto values = columnOf<ByteView>(rows, i, bytes);
        add.bindList(std::span(values));
        break;
      }
      default: {
        const auto values = columnOf<std::string_view>(rows, i, text);
        add.bindList(std::span(values));
      }
    }
  }
  return add.run();
}

Status addOneRow(Connection& connection, const CopiedTable& table, const std::string& sql,
                 const CopiedRow& row) {
  Statement add = connection.prepare(sql);
  for (std::size_t i = 0; i < row.size(); ++i) bindCopied(add, table.columns[i].type, row[i]);
  return add.run();
}

}  // namespace

Result<std::vector<CopiedTable>> copiedTables() {
  ASSIGN_OR_RETURN(auto memory,
                   Connection::open(":memory:", {.mode = Connection::Mode::kReader, .create = true}));
  RETURN_IF_ERROR(memory.script("PRAGMA query_only=OFF"));
  for (const EmbeddedFile& file : embeddedMigrations())
    RETURN_IF_ERROR(memory.script(std::string(file.text)));
  ASSIGN_OR_RETURN(const auto names,
                   memory
                       .prepare("SELECT name FROM sqlite_schema WHERE type = 'table'"
                                " AND substr(name, 1, 7) <> 'sqlite_' ORDER BY name = 'meta', rowid")
                       .all(firstText));
  std::vector<CopiedTable> tables;
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(auto table, describeTable(memory, name));
    tables.push_back(std::move(table));
  }
  return tables;
}

Result<std::vector<CopiedRow>> rowsBehind(Connection& connection, const CopiedTable& table,
                                          const CopiedRow& after, std::size_t most_rows) {
  ASSIGN_OR_RETURN(const std::int64_t most, rowsOfPage(connection, table, after, most_rows));
  if (most == 0) return std::vector<CopiedRow>();
  auto rows = connection.prepare("SELECT " + namesOfAll(table) + fromBehind(table, after));
  bindCopiedKey(rows, table, after);
  rows.bind(most);
  return rows.all([&](const Statement& row) {
    CopiedRow values;
    values.reserve(table.columns.size());
    for (std::size_t i = 0; i < table.columns.size(); ++i)
      values.push_back(copiedValue(row, static_cast<int>(i), table.columns[i].type));
    return values;
  });
}

Result<CopiedRow> lastKeyOf(Connection& connection, const CopiedTable& table) {
  auto row =
      connection.prepare(fmt::format("SELECT {} FROM \"{}\" ORDER BY {} LIMIT 1", namesOf(table, table.key),
                                     table.name, namesOf(table, table.key, " DESC")));
  ASSIGN_OR_RETURN(const bool there, row.step());
  CopiedRow key;
  if (!there) return key;
  for (std::size_t i = 0; i < table.key.size(); ++i)
    key.push_back(copiedValue(row, static_cast<int>(i), table.columns[table.key[i]].type));
  return key;
}

Status addRows(Connection& connection, const CopiedTable& table, std::span<const CopiedRow> rows) {
  if (rows.empty()) return {};
  const auto named = [&](const CopiedRow& row, const Error& error) {
    return Error{error.code, fmt::format("table {}: {}", rowText(table, keyOf(table, row)), error.message)};
  };
  if (connection.sqlite() == nullptr && fitIntoLists(table, rows)) {
    const Status added = addRowsAsLists(connection, table, rows);
    if (added) return added;
    return Error{added.error().code, fmt::format("table {}, or one of the {} rows behind it: {}",
                                                 rowText(table, keyOf(table, rows.front())), rows.size() - 1,
                                                 added.error().message)};
  }
  const std::string sql = fmt::format("INSERT INTO \"{}\" ({}) VALUES ({})", table.name, namesOfAll(table),
                                      marksOf(table.columns.size()));
  for (const CopiedRow& row : rows)
    if (const Status added = addOneRow(connection, table, sql, row); !added) return named(row, added.error());
  return {};
}

CopiedRow keyOf(const CopiedTable& table, const CopiedRow& row) {
  CopiedRow key;
  for (const std::size_t place : table.key) key.push_back(row[place]);
  return key;
}

std::string rowText(const CopiedTable& table, const CopiedRow& key) {
  std::string text = table.name;
  for (std::size_t i = 0; i < key.size(); ++i) {
    text += fmt::format(", {} ", table.columns[table.key[i]].name);
    if (const auto* number = std::get_if<std::int64_t>(&key[i]))
      text += std::to_string(*number);
    else if (const auto* chars = std::get_if<std::string>(&key[i]))
      text += '\'' + chars->substr(0, kShownKeyBytes) + '\'';
  }
  return text;
}

std::optional<std::string> differingColumn(const CopiedTable& table, const CopiedRow& left,
                                           const CopiedRow& right) {
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    if (left[i] != right[i]) return table.columns[i].name;
  return std::nullopt;
}

Result<LastNumbers> lastNumbersOf(Connection& connection) {
  auto rows = connection.prepare(connection.sqlite() != nullptr
                                     ? "SELECT name, max(coalesce(seq, 0)) FROM sqlite_sequence GROUP BY name"
                                     : "SELECT name, number FROM last_numbers");
  LastNumbers numbers;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return numbers;
    numbers[rows.text(0)] = rows.integer(1);
  }
}

Status setLastNumbers(Connection& connection, const LastNumbers& numbers) {
  const bool sqlite = connection.sqlite() != nullptr;
  RETURN_IF_ERROR(connection.run(sqlite ? "DELETE FROM sqlite_sequence" : "DELETE FROM last_numbers"));
  for (const auto& [name, number] : numbers)
    RETURN_IF_ERROR(connection.run(sqlite ? "INSERT INTO sqlite_sequence (name, seq) VALUES (?, ?)"
                                          : "INSERT INTO last_numbers (name, number) VALUES (?, ?)",
                                   name, number));
  return {};
}

}  // namespace needlelab
