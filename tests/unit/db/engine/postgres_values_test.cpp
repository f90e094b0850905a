#include "db/engine/postgres_values.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <regex>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace needlelab {
namespace {

std::string bytesOf(std::initializer_list<int> values) {
  std::string bytes;
  for (const int value : values) bytes += static_cast<char>(value);
  return bytes;
}

std::int64_t integer(PostgresType type, const std::string& bytes) {
  return integerOfPostgres(type, viewOf(bytes));
}

TEST(PostgresValues, wholeNumbersHaveTheGreatestByteFirst) {
  EXPECT_EQ(postgresInteger(0x0102030405060708), bytesOf({1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(postgresInteger(-2), bytesOf({255, 255, 255, 255, 255, 255, 255, 254}));
  constexpr auto kMin = std::numeric_limits<std::int64_t>::min();
  for (const std::int64_t value : {std::int64_t{0}, std::int64_t{-1}, kMin, ~kMin})
    EXPECT_EQ(integer(PostgresType::kInt8, postgresInteger(value)), value);
  EXPECT_EQ(integer(PostgresType::kInt4, bytesOf({255, 255, 255, 253})), -3);
  EXPECT_EQ(integer(PostgresType::kOid, bytesOf({255, 255, 255, 253})), 4294967293);
  EXPECT_EQ(integer(PostgresType::kInt2, bytesOf({128, 0})), -32768);
  EXPECT_EQ(integer(PostgresType::kBool, bytesOf({1})), 1);
  EXPECT_EQ(integer(PostgresType::kBool, bytesOf({0})), 0);
}

// array_recv: dimensions, NULLs, type, length, first index; each element preceded by its length
TEST(PostgresValues, listsAreArraysOfOneDimension) {
  const std::vector<std::int64_t> numbers = {1, -1};
  const std::string list = *postgresList(std::span<const std::int64_t>(numbers));
  EXPECT_EQ(list,
            bytesOf({0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 20, 0, 0, 0,   2,   0,   0,   0,   1,   0,   0,
                     0, 8, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0,  0, 8, 255, 255, 255, 255, 255, 255, 255, 255}));
  const std::vector<std::string_view> texts = {"", "ab"};
  EXPECT_EQ(*postgresList(std::span<const std::string_view>(texts)),
            bytesOf({0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 25, 0, 0,   0,
                     2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0,  2, 'a', 'b'}));
  EXPECT_EQ(*postgresList(std::span<const ByteView>()), bytesOf({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 17}));
  // more than PostgreSQL accepts is not even copied
  const Bytes some(1 << 20);
  const std::vector<ByteView> many(1024, ByteView(some));
  EXPECT_FALSE(postgresList(std::span<const ByteView>(many)).has_value());
}

TEST(PostgresValues, realsKeepTheirBits) {
  for (const double value : {0.0, -0.0, 0.1, -1e300, 5e-324, std::numeric_limits<double>::infinity()}) {
    const double back = realOfPostgres(PostgresType::kFloat8, viewOf(postgresReal(value)));
    EXPECT_EQ(back, value);
    EXPECT_EQ(std::signbit(back), std::signbit(value));
  }
  EXPECT_TRUE(std::isnan(realOfPostgres(PostgresType::kFloat8, viewOf(postgresReal(std::nan(""))))));
  // 1.5 as float4
  EXPECT_EQ(realOfPostgres(PostgresType::kFloat4, viewOf(bytesOf({0x3f, 0xc0, 0, 0}))), 1.5);
  // clamped to the range, as SQLite does
  EXPECT_EQ(integer(PostgresType::kFloat8, postgresReal(1e300)), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(integer(PostgresType::kFloat8, postgresReal(-1e300)), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(integer(PostgresType::kFloat8, postgresReal(std::nan(""))),
            std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(integer(PostgresType::kFloat8, postgresReal(-2.9)), -2);
}

// sum(BIGINT) is a numeric: digits in base 10,000
TEST(PostgresValues, sumsAreReadExactly) {
  // 12,345,678 = 1234 · 10,000 + 5678
  const std::string some = bytesOf({0, 2, 0, 1, 0, 0, 0, 0, 0x04, 0xd2, 0x16, 0x2e});
  EXPECT_EQ(integer(PostgresType::kNumeric, some), 12'345'678);
  EXPECT_EQ(realOfPostgres(PostgresType::kNumeric, viewOf(some)), 12'345'678);
  EXPECT_EQ(*textOfPostgres(PostgresType::kNumeric, viewOf(some)), "12345678");
  // trailing zero digits are omitted: 20,000 is one digit of weight 1
  EXPECT_EQ(integer(PostgresType::kNumeric, bytesOf({0, 1, 0, 1, 0x40, 0, 0, 0, 0, 2})), -20'000);
  // 0.5: weight −1
  const std::string half = bytesOf({0, 1, 0xff, 0xff, 0, 0, 0, 1, 0x13, 0x88});
  EXPECT_EQ(integer(PostgresType::kNumeric, half), 0);
  EXPECT_DOUBLE_EQ(realOfPostgres(PostgresType::kNumeric, viewOf(half)), 0.5);
  // 2^63 = 9·10^18 and more: 922 3372 0368 5477 5808
  const std::string above =
      bytesOf({0, 5, 0, 4, 0, 0, 0, 0, 3, 0x9a, 0x0d, 0x2c, 1, 0x70, 0x15, 0x65, 0x16, 0xb0});
  EXPECT_EQ(integer(PostgresType::kNumeric, above), std::numeric_limits<std::int64_t>::max());
  // NaN
  EXPECT_EQ(integer(PostgresType::kNumeric, bytesOf({0, 0, 0, 0, 0xc0, 0, 0, 0})), 0);
}

TEST(PostgresValues, bytesOfAnyLengthAreReadWithoutHarm) {
  for (const auto type : {PostgresType::kBool, PostgresType::kInt2, PostgresType::kInt4, PostgresType::kInt8,
                          PostgresType::kFloat4, PostgresType::kFloat8, PostgresType::kNumeric,
                          PostgresType::kText, PostgresType::kBytes, PostgresType{77}})
    for (std::size_t length = 0; length < 20; ++length) {
      const std::string bytes(length, '\xff');
      (void)integerOfPostgres(type, viewOf(bytes));
      (void)realOfPostgres(type, viewOf(bytes));
      (void)textOfPostgres(type, viewOf(bytes));
    }
}

TEST(PostgresValues, textsBeginWithTheirNumber) {
  EXPECT_EQ(integer(PostgresType::kText, "-17 apples"), -17);
  EXPECT_EQ(integer(PostgresType::kText, "apples"), 0);
  EXPECT_EQ(realOfPostgres(PostgresType::kText, viewOf(std::string("2.5"))), 2.5);
  EXPECT_FALSE(textOfPostgres(PostgresType::kText, viewOf(std::string("2.5"))).has_value());
}

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
