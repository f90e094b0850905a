// Copies of a whole store between the two engines: every row stays the same, however often the copy is
// killed.
#include "db/backup/store_copy.h"

#include <gmock/gmock.h>

#include "common/base/files/files.h"
#include "db/backup/check.h"
#include "db/backup/copied_tables.h"
#include "db/teaching/attempt_sums.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

class StoreCopyTest : public testing::Test {
 protected:
  Connection emptySqlite(const std::string& name) const {
    auto made = TestDb::must(
        Connection::open(folder.path() / name, {.mode = Connection::Mode::kWriter, .create = true}));
    EXPECT_OK(made.script("PRAGMA synchronous=OFF"));
    EXPECT_OK(migrate(made));
    return made;
  }
  /// A file with rows in every table.
  [[nodiscard]] Connection filledSqlite() const {
    auto made = emptySqlite("source");
    EXPECT_OK(made.script(TestDb::must(readWholeFile(NEEDLELAB_TEST_DATA "/db/rows.sql"))));
    return made;
  }
  Connection emptyPostgres(const std::string& name) const {
    return TestDb::must(openAt(StoreAddress(folder.path() / "x", postgresUrlOf(folder.path() / name)),
                               Connection::Mode::kWriter));
  }
  static CopyMark mark() { return {"copy-1"}; }
  /// All steps of a copy; a failed step fails the test.
  static void copyAll(Connection& from, Connection& to) {
    ASSERT_TRUE(TestDb::must(isEmptyStore(to)));
    ASSERT_OK(beginCopy(to, mark()));
    ASSERT_OK(copyRows(from, to, {}));
    const auto compared = compareRows(from, to, {});
    ASSERT_OK(compared);
    EXPECT_GE(compared->chunks, 4u);
    ASSERT_OK(endCopy(to, mark()));
    ASSERT_OK(leaveCopyMarks(to));
  }
  static std::int64_t numberIn(Connection& connection, const std::string& sql) {
    auto row = connection.prepare(sql);
    EXPECT_TRUE(*row.step()) << sql;
    return row.integer(0);
  }
  static std::int64_t nextAuditId(Connection& connection) {
    return TestDb::must(connection.insert(
        "INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1, '', '', '', '') RETURNING id"));
  }
  /// The message of a comparison that must fail.
  static std::string difference(Connection& from, Connection& to) {
    const auto compared = compareRows(from, to, {});
    if (compared.ok()) return "it found nothing";
    EXPECT_EQ(compared.error().code, ErrorCode::kCorrupt);
    return compared.error().message;
  }

  TempFolder folder;
  PostgresBelow dropped_at_end{folder.path()};
};

TEST_F(StoreCopyTest, aStoreGoesToPostgresAndBackAndIsTheSame) {
  Connection source = filledSqlite();
  const std::string expected = dump(source);
  Connection there = emptyPostgres("a");
  copyAll(source, there);
  Connection back = emptySqlite("back");
  copyAll(there, back);
  EXPECT_EQ(dump(back), expected);
  for (Connection* copy : {&there, &back}) {
    const auto check = checkDatabase(*copy);
    ASSERT_OK(check);
    EXPECT_TRUE(check->ok()) << check->faults.front();
    EXPECT_TRUE(check->sums.empty()) << check->sums.front();
  }
}

TEST_F(StoreCopyTest, keysGoOnAsTheyWouldHaveAtTheSource) {
  Connection source = filledSqlite();
  ASSERT_OK(source.script(
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES (50, 1, '', '', '', '');"
      "DELETE FROM audit WHERE id = 50"));
  Connection there = emptyPostgres("a");
  copyAll(source, there);
  Connection back = emptySqlite("back");
  copyAll(there, back);
  EXPECT_EQ(nextAuditId(source), 51);
  EXPECT_EQ(nextAuditId(there), 51);
  EXPECT_EQ(nextAuditId(back), 51);
}

TEST_F(StoreCopyTest, rowsComeAsTheyAreWithoutWhatTriggersWouldMakeOfThem) {
  Connection source = filledSqlite();
  // a state that no program leaves: a trigger would update the counters and count the attempts
  ASSERT_OK(source.script(
      "UPDATE sessions SET chunks = 9 WHERE state = 1; DELETE FROM session_progress WHERE session = 2;"
      "UPDATE attempt_sums SET attempts = 77"));
  Connection there = emptyPostgres("a");
  copyAll(source, there);
  EXPECT_EQ(numberIn(there, "SELECT attempts FROM attempt_sums"), 77);
  EXPECT_EQ(numberIn(there, "SELECT count(*) FROM session_progress"),
            numberIn(source, "SELECT count(*) FROM session_progress"));
  Connection back = emptySqlite("back");
  copyAll(there, back);
  EXPECT_EQ(dump(back), dump(source));
  // and what is added later is counted again
  for (Connection* copy : {&there, &back}) {
    ASSERT_OK(copy->script("UPDATE sessions SET trainee = 'newcomer' WHERE number = 1"));
    EXPECT_EQ(numberIn(*copy, "SELECT sessions FROM attempt_sums WHERE trainee = 'newcomer'"), 1);
  }
}

TEST_F(StoreCopyTest, killedAtAnyPageItGoesOnAndCopiesNoRowTwice) {
  Connection source = filledSqlite();
  Connection there = emptyPostgres("a");
  std::int64_t rows = 0;
  for (const CopiedTable& table : TestDb::must(copiedTables()))
    if (table.name != "meta") rows += numberIn(source, "SELECT count(*) FROM \"" + table.name + "\"");
  ASSERT_OK(beginCopy(there, mark()));
  std::uint64_t copied = 0;
  int runs = 0;
  for (bool done = false; !done && runs < 100; ++runs) {
    int pages = 0;
    const auto step = [&](const CopyProgress& progress) -> Status {
      if (progress.table_ended) return {};
      ++copied;  // pages of one row
      if (++pages < 3) return {};
      return Error{ErrorCode::kUnavailable, "killed"};
    };
    const auto ended = copyRows(source, there, {.on_progress = step, .max_rows = 1});
    done = ended.ok();
    if (!done) {
      EXPECT_EQ(ended.error().message, "killed");
    }
  }
  EXPECT_EQ(copied, static_cast<std::uint64_t>(rows));
  EXPECT_EQ(runs, rows / 3 + 1);
  const auto compared = compareRows(source, there, {.max_rows = 1});
  ASSERT_OK(compared);
  EXPECT_EQ(compared->rows,
            copied + static_cast<std::uint64_t>(numberIn(source, "SELECT count(*) FROM meta")));
}

TEST_F(StoreCopyTest, anAlteredCopyIsReportedByTableKeyAndColumn) {
  const struct {
    const char* sql;
    const char* row;
    const char* how;
  } cases[] = {
      {"UPDATE names SET full_name = 'Anne A.' WHERE name = 'anna'", "names, person 1", "full_name"},
      {"UPDATE people SET password_hash = '' WHERE id = 1", "people, id 1", "password_hash"},
      {"UPDATE session_events SET begin_s = begin_s + 1e-12 WHERE position = 0",
       "session_events, session 1, position 0", "begin_s"},
      {"UPDATE chunks SET bytes = zeroblob(length(bytes)) WHERE session = 1 AND seq = 1",
       "chunks, session 1, seq 1", "bytes"},
      {"DELETE FROM consents WHERE id = 1", "consents, id 1", "missing in the copy"},
      {"DELETE FROM consents WHERE id = 2", "consents, id 2", "missing in the copy"},
      {"INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('a-first', zeroblob(32), 1)",
       "stations, name 'a-first'", "in the copy alone"},
      {"INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('zz', zeroblob(32), 1)",
       "stations, name 'zz'", "in the copy alone"},
      {"UPDATE meta SET value = '0' WHERE key = 'codes_required'", "meta, key 'codes_required'", "value"},
      {"UPDATE last_numbers SET number = number - 1 WHERE name = 'audit'", "last numbers", "other numbers"}};
  Connection source = filledSqlite();
  Connection there = emptyPostgres("a");
  ASSERT_OK(beginCopy(there, mark()));
  ASSERT_OK(copyRows(source, there, {}));
  for (const auto& [sql, row, how] : cases) {
    SCOPED_TRACE(sql);
    ASSERT_OK(there.script(std::string("BEGIN; ") + sql));
    const std::string found = difference(source, there);
    EXPECT_THAT(found, HasSubstr(row));
    EXPECT_THAT(found, HasSubstr(how));
    ASSERT_OK(there.script("ROLLBACK"));
  }
  ASSERT_OK(compareRows(source, there, {}));
}

TEST_F(StoreCopyTest, aRowThatPostgresDoesNotTakeIsNamed) {
  Connection source = filledSqlite();
  ASSERT_OK(source.script("UPDATE names SET full_name = 'a' || char(0) || 'b' WHERE name = 'ina'"));
  Connection there = emptyPostgres("a");
  ASSERT_OK(beginCopy(there, mark()));
  const auto copied = copyRows(source, there, {});
  ASSERT_FALSE(copied.ok());
  EXPECT_EQ(copied.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(copied.error().message, HasSubstr("names, person 2"));
  EXPECT_THAT(copied.error().message, HasSubstr("byte 0"));
}

TEST_F(StoreCopyTest, anUnfinishedCopyCanBeEmptied) {
  Connection source = filledSqlite();
  Connection there = emptyPostgres("a");
  ASSERT_OK(beginCopy(there, mark()));
  ASSERT_OK(copyRows(source, there, {}));
  EXPECT_FALSE(TestDb::must(isEmptyStore(there)));
  EXPECT_FALSE(refuseUnfinishedCopy(there).ok());
  ASSERT_OK(emptyCopy(there));
  EXPECT_FALSE(TestDb::must(readCopyMark(there)).has_value());
  copyAll(source, there);
}

}  // namespace
}  // namespace needlelab::test
