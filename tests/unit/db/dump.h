/// Dumps a whole database as text in a fixed order, for comparison.
#pragma once

#include <string>

#include "db/connection.h"

namespace needlelab::test {

inline std::string dump(Connection& connection) {
  std::string text;
  auto tables = connection.prepare(
      "SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY name");
  while (*tables.step()) {
    const std::string table = tables.text(0);
    std::string columns, expression;
    auto info = connection.query("SELECT name FROM pragma_table_info(?) ORDER BY cid", table);
    while (*info.step()) {
      columns += (columns.empty() ? "" : " | ") + info.text(0);
      expression += (expression.empty() ? "" : " || ' | ' || ") + ("quote(" + info.text(0) + ")");
    }
    text += "== " + table + ": " + columns + "\n";
    auto rows = connection.prepare("SELECT " + expression + " FROM " + table + " ORDER BY 1");
    while (*rows.step()) text += rows.text(0) + "\n";
  }
  return text;
}

}  // namespace needlelab::test
