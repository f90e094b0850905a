/// Dumps a whole database as text in a fixed order, for comparison.
#pragma once

#include <string>

#include "db/store/connection.h"

namespace needlelab::test {

/// A column as SQLite's quote() writes it, on either engine.
inline std::string quotedColumn(Connection& connection, const std::string& name, const std::string& type) {
  if (connection.sqlite() != nullptr) return "quote(" + name + ")";
  const std::string quoted = type == "text"    ? "'''' || replace(" + name + ", '''', '''''') || ''''"
                             : type == "bytea" ? "'X''' || hex(" + name + ") || ''''"
                                               : "CAST(" + name + " AS TEXT)";
  return "coalesce(" + quoted + ", 'NULL')";
}

inline std::string dump(Connection& connection) {
  const bool sqlite = connection.sqlite() != nullptr;
  std::string text;
  auto tables = connection.prepare(
      sqlite
          ? "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY name"
          : "SELECT table_name::text FROM information_schema.tables WHERE table_schema = 'needlelab'"
            " ORDER BY table_name");
  while (*tables.step()) {
    const std::string table = tables.text(0);
    std::string columns, expression;
    auto info = connection.query(
        sqlite ? "SELECT name, '' FROM pragma_table_info(?) ORDER BY cid"
               : "SELECT column_name::text, data_type::text FROM information_schema.columns"
                 " WHERE table_schema = 'needlelab' AND table_name = ? ORDER BY ordinal_position",
        table);
    while (*info.step()) {
      columns += (columns.empty() ? "" : " | ") + info.text(0);
      expression +=
          (expression.empty() ? "" : " || ' | ' || ") + quotedColumn(connection, info.text(0), info.text(1));
    }
    text += "== " + table + ": " + columns + "\n";
    auto rows = connection.prepare("SELECT " + expression + " FROM " + table + " ORDER BY 1");
    while (*rows.step()) text += rows.text(0) + "\n";
  }
  return text;
}

}  // namespace needlelab::test
