#include "db/backup/copied_tables.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "db/store/schema.h"

namespace needlelab {
namespace {

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

/// Quoted column names, e.g. "a", "b".
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
                                          const CopiedRow& after, std::size_t max_rows) {
  std::string sql = fmt::format("SELECT {} FROM \"{}\"", namesOfAll(table), table.name);
  if (!after.empty())
    sql += fmt::format(" WHERE ({}) > ({})", namesOf(table, table.key), marksOf(table.key.size()));
  auto rows = connection.prepare(sql + fmt::format(" ORDER BY {} LIMIT ?", namesOf(table, table.key)));
  for (std::size_t i = 0; i < after.size(); ++i) bindCopied(rows, table.columns[table.key[i]].type, after[i]);
  rows.bind(std::uint64_t{std::min(max_rows, kMaxRowsOfPage)});
  return rows.all([&](const Statement& row) {
    CopiedRow values;
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
  std::string sql = fmt::format("INSERT INTO \"{}\" ({}) VALUES ", table.name, namesOfAll(table));
  for (std::size_t i = 0; i < rows.size(); ++i)
    sql += fmt::format("{}({})", i == 0 ? "" : ", ", marksOf(table.columns.size()));
  Statement add = connection.prepare(sql);
  for (const CopiedRow& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) bindCopied(add, table.columns[i].type, row[i]);
  return add.run();
}

CopiedRow keyOf(const CopiedTable& table, const CopiedRow& row) {
  CopiedRow key;
  for (const std::size_t place : table.key) key.push_back(row[place]);
  return key;
}

std::string rowText(const CopiedTable& table, const CopiedRow& row) {
  constexpr std::size_t kShownBytes = 64;
  std::string text = table.name;
  for (const std::size_t place : table.key) {
    text += fmt::format(", {} ", table.columns[place].name);
    if (const auto* number = std::get_if<std::int64_t>(&row[place]))
      text += std::to_string(*number);
    else if (const auto* chars = std::get_if<std::string>(&row[place]))
      text += '\'' + chars->substr(0, kShownBytes) + '\'';
  }
  return text;
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
