// What stores rely on with either engine. Runs on SQLite and, in db_postgres_test, on PostgreSQL.
#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class BothEngines : public testing::Test {
 protected:
  std::int64_t count(Connection& connection, const std::string& table) {
    const auto rows = connection.prepare("SELECT count(*) FROM " + table).first([](const Statement& row) {
      return row.integer(0);
    });
    EXPECT_OK(rows);
    return rows->value_or(-1);
  }
  std::int64_t groups() { return count(db.writer, "groups"); }
  Status addGroup(const std::string& name) {
    return db.writer.run(
        "INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns) VALUES (?1, '', 1, '', 1)",
        name);
  }
  TestDb db;
};

TEST_F(BothEngines, takeAListWhereTheEngineHasArraysAndSayItElsewhere) {
  const std::vector<std::int64_t> numbers = {3, 4};
  auto rows = db.writer.prepare("SELECT ?");
  const auto stepped = rows.bindList(std::span<const std::int64_t>(numbers)).step();
  EXPECT_EQ(stepped.ok(), onPostgres());
  if (onPostgres()) return;
  EXPECT_THAT(stepped.error().message, HasSubstr("a list of 2 values"));
}

TEST_F(BothEngines, keepValuesOfEveryKind) {
  const std::string text = "Ünï ' \" ? $1 \\ \n";
  const Bytes bytes = {0, 1, 255, 0};
  constexpr auto kMax = std::numeric_limits<std::int64_t>::max();
  ASSERT_OK(db.writer.script("CREATE TABLE kinds (a BIGINT, b DOUBLE PRECISION, c TEXT, d " +
                             std::string(db.writer.sqlite() != nullptr ? "BLOB" : "BYTEA") + ")"));
  ASSERT_OK(
      db.writer.run("INSERT INTO kinds (a, b, c, d) VALUES (?,?,?,?)", kMax, 0.1, text, ByteView(bytes)));
  ASSERT_OK(
      db.writer.run("INSERT INTO kinds (a, b, c, d) VALUES (?,?,?,?)", -kMax - 1, -1e-300, "", ByteView()));
  ASSERT_OK(db.writer.run("INSERT INTO kinds (a, b, c, d) VALUES (?,?,?,?)", std::optional<std::int64_t>(),
                          std::optional<double>(), std::optional<std::string>(), std::optional<ByteView>()));
  auto rows = db.writer.prepare("SELECT a, b, c, d FROM kinds ORDER BY a IS NULL, a DESC");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), kMax);
  EXPECT_EQ(rows.real(1), 0.1);
  EXPECT_EQ(rows.text(2), text);
  EXPECT_EQ(Bytes(rows.bytes(3).begin(), rows.bytes(3).end()), bytes);
  EXPECT_EQ(rows.text(0), std::to_string(kMax));
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), -kMax - 1);
  EXPECT_EQ(rows.real(1), -1e-300);
  EXPECT_EQ(rows.text(2), "");
  EXPECT_FALSE(rows.isNull(2));
  EXPECT_FALSE(rows.isNull(3));
  ASSERT_TRUE(*rows.step());
  for (int column = 0; column < 4; ++column) EXPECT_TRUE(rows.isNull(column));
  EXPECT_EQ(rows.integer(0), 0);
  EXPECT_EQ(rows.real(1), 0);
  EXPECT_EQ(rows.text(2), "");
  EXPECT_FALSE(*rows.step());
}

TEST_F(BothEngines, anotherStatementRunsWhileRowsAreRead) {
  for (const char* name : {"anna", "ben", "cleo"}) ASSERT_OK(addGroup(name));
  std::vector<std::string> names;
  auto rows = db.writer.prepare("SELECT id FROM groups ORDER BY id");
  while (*rows.step()) {
    names.push_back(rows.text(0));
    ASSERT_OK(
        db.writer.run("INSERT INTO meta (key, value) VALUES (?, ?)", names.back(), "of " + names.back()));
    // the same text as the statement in progress
    auto again = db.writer.prepare("SELECT id FROM groups ORDER BY id");
    EXPECT_TRUE(*again.step());
    EXPECT_EQ(again.text(0), "anna");
  }
  EXPECT_THAT(names, ElementsAre("anna", "ben", "cleo"));
}

TEST_F(BothEngines, errorsSayWhatKindTheyAre) {
  ASSERT_OK(addGroup("anna"));
  const auto code = [](const Status& status) {
    return status.ok() ? ErrorCode::kFailed : status.error().code;
  };
  EXPECT_EQ(code(addGroup("anna")), ErrorCode::kAlreadyExists);
  EXPECT_EQ(code(db.writer.run("INSERT INTO group_members (group_id, person) VALUES ('none', 'anna')")),
            ErrorCode::kNotFound);
  EXPECT_EQ(code(addGroup("")), ErrorCode::kInvalidInput) << "a CHECK";
  EXPECT_EQ(code(db.writer.run("INSERT INTO meta (key) VALUES ('x')")), ErrorCode::kInvalidInput)
      << "NOT NULL";
  const Status wrong = db.writer.run("SELECT nothing FROM nowhere");
  EXPECT_EQ(code(wrong), ErrorCode::kFailed);
  EXPECT_THAT(wrong.error().message, HasSubstr("nowhere"));
  EXPECT_FALSE(db.writer.damaged());
  EXPECT_EQ(groups(), 1);
  // a number that the engine cannot represent
  const Status large = db.writer.run("UPDATE groups SET revision = ?", ~std::uint64_t{0});
  EXPECT_EQ(code(large), ErrorCode::kInvalidInput);
}

TEST_F(BothEngines, aTransactionThatIsNotCommittedLeavesNothing) {
  {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    ASSERT_OK(transaction);
    EXPECT_TRUE(db.writer.inTransaction());
    ASSERT_OK(addGroup("anna"));
  }
  EXPECT_FALSE(db.writer.inTransaction());
  EXPECT_EQ(groups(), 0);
  {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    ASSERT_OK(transaction);
    ASSERT_OK(addGroup("anna"));
    ASSERT_OK(transaction->commit());
  }
  EXPECT_EQ(groups(), 1);
}

TEST_F(BothEngines, aSavepointRollsBackItsOwnPartEvenAfterAnError) {
  auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
  ASSERT_OK(transaction);
  ASSERT_OK(addGroup("anna"));
  {
    auto savepoint = Savepoint::begin(db.writer);
    ASSERT_OK(savepoint);
    ASSERT_OK(addGroup("ben"));
    EXPECT_FALSE(addGroup("anna").ok());
  }
  EXPECT_EQ(groups(), 1) << "the transaction continues";
  {
    auto savepoint = Savepoint::begin(db.writer);
    ASSERT_OK(savepoint);
    ASSERT_OK(addGroup("cleo"));
    ASSERT_OK(savepoint->release());
  }
  ASSERT_OK(transaction->commit());
  EXPECT_EQ(groups(), 2);
}

TEST_F(BothEngines, aViewDoesNotChange) {
  Connection reader = db.reader();
  auto view = Transaction::begin(reader, Transaction::Kind::kRead);
  ASSERT_OK(view);
  ASSERT_OK(addGroup("anna"));
  EXPECT_EQ(count(reader, "groups"), 0);
  ASSERT_OK(view->commit());
  EXPECT_EQ(count(reader, "groups"), 1);
  EXPECT_FALSE(reader.run("DELETE FROM groups").ok()) << "a reader changes nothing";
}

TEST_F(BothEngines, returningGivesTheKeyAndChangesCountsRows) {
  for (const char* expected : {"1", "2", "3"}) {
    const auto id = db.writer.insert(
        "INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (?,?,?,?,?) RETURNING id", 1, "ada",
        "x", "y", "z");
    ASSERT_OK(id);
    EXPECT_EQ(std::to_string(*id), expected);
    EXPECT_EQ(db.writer.changes(), 1);
  }
  // one numbered table never reuses a number, the other does
  ASSERT_OK(db.writer.run("DELETE FROM audit WHERE id = 3"));
  ASSERT_OK(db.writer.run("UPDATE audit SET detail = ''"));
  EXPECT_EQ(db.writer.changes(), 2);
  const auto next = db.writer.insert(
      "INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (?,?,?,?,?) RETURNING id", 1, "ada",
      "x", "y", "z");
  ASSERT_OK(next);
  EXPECT_EQ(*next, 4);
}

TEST_F(BothEngines, textsAreComparedByteByByte) {
  for (const char* name : {"b", "B", "a", "Ä", "_", "a b", "Z"}) ASSERT_OK(addGroup(name));
  const auto names = db.writer.prepare("SELECT id FROM groups ORDER BY id").all(firstText);
  ASSERT_OK(names);
  EXPECT_THAT(*names, ElementsAre("B", "Z", "_", "a", "a b", "b", "Ä"));
  const auto folded = db.writer.query("SELECT lower(?)", "ÄB").first(firstText);
  ASSERT_OK(folded);
  EXPECT_EQ(**folded, "Äb") << "ASCII letters only";
}

TEST_F(BothEngines, theFunctionsOfSqliteAreThere) {
  auto row = db.writer.query("SELECT max(?, ?), min(?, ?), instr(?, ?), hex(?), length(zeroblob(?))", 3, 5, 3,
                             5, "abcb", "b", ByteView(Bytes{1, 171}), 7);
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.integer(0), 5);
  EXPECT_EQ(row.integer(1), 3);
  EXPECT_EQ(row.integer(2), 2);
  EXPECT_EQ(row.text(3), "01AB");
  EXPECT_EQ(row.integer(4), 7);
}

TEST_F(BothEngines, aCancelledReadEnds) {
  std::atomic<bool> cancelled{true};
  const CancelScope scope(db.writer, &cancelled);
  const Status read = db.writer.run(
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 2000000000) SELECT sum(i) "
      "FROM n");
  ASSERT_FALSE(read.ok());
  cancelled = false;
  EXPECT_EQ(groups(), 0) << "the connection continues";
}

}  // namespace
}  // namespace needlelab::test
