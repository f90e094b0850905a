#include "db/engine/postgres_sql.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(PostgresSql, numbersParametersAsSqliteDoes) {
  const struct {
    const char *sqlite, *postgres;
  } rows[] = {
      {"SELECT 1", "SELECT 1"},
      {"SELECT a FROM t WHERE b = ? AND c = ?", "SELECT a FROM t WHERE b = $1 AND c = $2"},
      {"VALUES (?1, ?1, ?2)", "VALUES ($1, $1, $2)"},
      // the next one comes after the greatest
      {"VALUES (?3, ?, ?1, ?)", "VALUES ($3, $4, $1, $5)"},
      {"VALUES (?12)", "VALUES ($12)"},
      {"", ""},
      {"?", "$1"},
  };
  for (const auto& row : rows) EXPECT_EQ(forPostgres(row.sqlite).text, row.postgres) << row.sqlite;
}

TEST(PostgresSql, countsParametersAndLeavesHintsOut) {
  EXPECT_EQ(forPostgres("VALUES (?3, ?1)").parameters, 3);
  EXPECT_EQ(forPostgres("SELECT '?'").parameters, 0);
  EXPECT_EQ(forPostgres("SELECT a FROM t NOT INDEXED ORDER BY a").text, "SELECT a FROM t ORDER BY a");
}

TEST(PostgresSql, leavesTextsNamesAndCommentsAsTheyAre) {
  const struct {
    const char *sqlite, *postgres;
  } rows[] = {
      {"SELECT '?', ?", "SELECT '?', $1"},
      {"SELECT 'it''s ?', ?", "SELECT 'it''s ?', $1"},
      {"SELECT \"a?\" -- why?\n WHERE ?", "SELECT \"a?\" -- why?\n WHERE $1"},
      {"SELECT ? -- to the end ?", "SELECT $1 -- to the end ?"},
      // broken: the engine says so
      {"SELECT ?, 'open ?", "SELECT $1, 'open ?"},
      {"SELECT a - ?", "SELECT a - $1"},
  };
  for (const auto& row : rows) EXPECT_EQ(forPostgres(row.sqlite).text, row.postgres) << row.sqlite;
}

}  // namespace
}  // namespace needlelab
