#include "db/engine/postgres_values.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

namespace needlelab {
namespace {

TEST(PostgresSql, numbersParametersAsSqliteDoes) {
  const struct {
    const char *sqlite, *postgres;
  } rows[] = {
      {"SELECT 1", "SELECT 1"},
      {"SELECT a FROM t WHERE b = ? AND c = ?", "SELECT a FROM t WHERE b = $1 AND c = $2"},
      {"VALUES (?1, ?1, ?2)", "VALUES ($1, $1, $2)"},
      // the next one follows the largest
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
      // invalid: the engine reports it
      {"SELECT ?, 'open ?", "SELECT $1, 'open ?"},
      {"SELECT a - ?", "SELECT a - $1"},
  };
  for (const auto& row : rows) EXPECT_EQ(forPostgres(row.sqlite).text, row.postgres) << row.sqlite;
}

TEST(PostgresSql, theFilesThatQueryTheEngineMatchTheHeader) {
  const std::filesystem::path source = NEEDLELAB_SOURCE;
  const auto text_of = [](const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  };
  std::string header = text_of(source / "db/engine/postgres_values.h");
  const std::size_t at = header.find("Where the two do not do the same");
  ASSERT_NE(at, std::string::npos);
  header = header.substr(at, header.find("What stores may not use") - at);
  std::set<std::string> asking;
  for (const char* folder : {"db", "client", "common", "server"})
    for (const auto& file : std::filesystem::recursive_directory_iterator(source / folder)) {
      if (file.path().extension() != ".cpp" || file.path().parent_path() == source / "db/engine") continue;
      const std::string text = text_of(file.path());
      if (text.find("sqlite() == nullptr") != std::string::npos ||
          text.find("sqlite() != nullptr") != std::string::npos)
        asking.insert(file.path().stem());
    }
  EXPECT_GE(asking.size(), 15u);
  for (const std::string& name : asking)
    EXPECT_TRUE(std::regex_search(header, std::regex("\\b" + name + "\\b"))) << name << " is not in the list";
  // and no name that is no longer used
  const std::regex names("\\b[a-z]+(_[a-z]+)+\\b");
  for (std::sregex_iterator name(header.begin(), header.end(), names), end; name != end; ++name)
    EXPECT_TRUE(asking.contains(name->str())) << name->str();
}

}  // namespace
}  // namespace needlelab
