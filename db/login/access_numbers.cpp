#include "db/login/access_numbers.h"

#include <utility>

#include "db/store/text_lists.h"

namespace needlelab {

Result<std::int64_t> AccessNumberStore::last() {
  ASSIGN_OR_RETURN(const auto number, connection_.prepare("SELECT number FROM access_numbers WHERE what = 0")
                                          .first([](const Statement& row) { return row.integer(0); }));
  return number.value_or(0);
}

Result<std::vector<AccessChange>> AccessNumberStore::after(std::int64_t number, std::uint64_t most) {
  return connection_
      .query(
          "SELECT number, what, name, how, server FROM access_numbers WHERE number > ? AND what <> 0"
          " ORDER BY number LIMIT ?",
          number, most)
      .all([](const Statement& row) {
        return AccessChange{row.integer(0), static_cast<AccessWhat>(row.integer(1)), row.text(2), row.text(3),
                            row.text(4)};
      });
}

Result<std::int64_t> AccessNumberStore::of(AccessWhat what, std::string_view name) {
  ASSIGN_OR_RETURN(const auto number,
                   connection_
                       .query("SELECT number FROM access_numbers WHERE what = ? AND name = ?",
                              static_cast<int>(what), name)
                       .first([](const Statement& row) { return row.integer(0); }));
  return number.value_or(0);
}

Result<std::map<std::string, std::int64_t>> AccessNumberStore::ofMany(AccessWhat what,
                                                                      std::span<const std::string> names) {
  Statement rows = connection_.query(
      "SELECT name, number FROM access_numbers WHERE what = ?1 AND name" + amongTexts(connection_, 2),
      static_cast<int>(what));
  bindTexts(connection_, rows, names);
  ASSIGN_OR_RETURN(const auto found,
                   rows.all([](const Statement& row) { return std::pair(row.text(0), row.integer(1)); }));
  return std::map<std::string, std::int64_t>(found.begin(), found.end());
}

Status AccessNumberStore::raise(AccessWhat what, std::string_view name, std::string_view how,
                                std::string_view server) {
  RETURN_IF_ERROR(connection_.run(
      "INSERT INTO access_numbers AS a (what, name, number, how, server) VALUES (0, '', 1, '', '')"
      " ON CONFLICT (what, name) DO UPDATE SET number = a.number + 1"));
  return connection_.run(
      "INSERT INTO access_numbers (what, name, number, how, server)"
      " SELECT ?, ?, number, ?, ? FROM access_numbers WHERE what = 0"
      " ON CONFLICT (what, name) DO UPDATE SET number = excluded.number, how = excluded.how,"
      " server = excluded.server",
      static_cast<int>(what), name, how, server);
}

}  // namespace needlelab
