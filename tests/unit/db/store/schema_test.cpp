#include "db/store/schema.h"

#include <string>
#include <utility>
#include <vector>

#include "db/backup/check.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

Connection fresh(const test::TempFolder& folder, const std::string& name = "a.db") {
  return test::TestDb::must(
      Connection::open(folder.path() / name, {.mode = Connection::Mode::kWriter, .create = true}));
}

TEST(Schema, aNewFileGetsTheNewestSchemaAndOurMark) {
  const test::TempFolder folder;
  auto connection = fresh(folder);
  EXPECT_EQ(*schemaVersion(connection), 0);
  EXPECT_FALSE(requireNewestSchema(connection).ok());
  ASSERT_OK(migrate(connection));
  EXPECT_EQ(*schemaVersion(connection), newestSchemaVersion());
  EXPECT_GE(newestSchemaVersion(), 1);
  ASSERT_OK(requireNewestSchema(connection));
  // again: nothing to do
  ASSERT_OK(migrate(connection));
}

TEST(Schema, theSchemaIsStrictThroughout) {
  test::TestDb db;
  auto rows = db.writer.prepare(
      "SELECT name FROM pragma_table_list WHERE schema = 'main' AND type = 'table' AND NOT strict"
      " AND name NOT LIKE 'sqlite_%'");
  EXPECT_FALSE(*rows.step()) << rows.text(0);
}

TEST(Schema, aNewerSchemaIsRefusedByName) {
  test::TestDb db;
  ASSERT_OK(db.writer.script("PRAGMA user_version=999"));
  for (const Status& refused : {migrate(db.writer), requireNewestSchema(db.writer)}) {
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kVersion);
    EXPECT_NE(refused.error().message.find("999"), std::string::npos);
    EXPECT_NE(refused.error().message.find(std::to_string(newestSchemaVersion())), std::string::npos);
  }
  EXPECT_EQ(*schemaVersion(db.writer), 999);
}

TEST(Schema, aFlippedBitInTheVersionOfTheHeaderIsDamage) {
  test::TestDb db;
  constexpr std::int64_t kFlipped = std::int64_t{1} << 31;
  const std::string version = std::to_string(newestSchemaVersion() - kFlipped);
  ASSERT_OK(db.writer.script("PRAGMA user_version=" + version));
  const auto read = schemaVersion(db.writer);
  ASSERT_FALSE(read);
  for (const Error& refused :
       {read.error(), migrate(db.writer).error(), requireNewestSchema(db.writer).error()}) {
    EXPECT_EQ(refused.code, ErrorCode::kCorrupt);
    EXPECT_NE(refused.message.find(version), std::string::npos) << refused.message;
    EXPECT_NE(refused.message.find("restore a backup"), std::string::npos) << refused.message;
  }
}

TEST(Schema, anAlteredSchemaIsRefusedByName) {
  const std::string lying = "UPDATE audit SET who = 'mona', subject = 'nobody' WHERE id = NEW.id; END";
  const std::pair<std::string, std::string> changes[] = {
      {"CREATE TRIGGER evil AFTER INSERT ON audit BEGIN " + lying, "trigger 'evil' of 'audit'"},
      {"CREATE VIEW spy AS SELECT * FROM people", "view 'spy'"},
      {"CREATE TABLE stash (a INTEGER) STRICT", "table 'stash'"},
      {"CREATE INDEX slow ON audit (who)", "index 'slow' of 'audit'"},
      {"DROP TRIGGER quarantine_ends", "trigger 'quarantine_ends' of 'chunks' is missing"},
      {"DROP TRIGGER sessions_opened; CREATE TRIGGER sessions_opened AFTER INSERT ON sessions BEGIN SELECT "
       "1; END",
       "trigger 'sessions_opened' of 'sessions' is not as needlelab makes it"},
      {"ALTER TABLE meta ADD COLUMN more TEXT", "table 'meta' is not as needlelab makes it"}};
  for (const auto& [sql, named] : changes) {
    SCOPED_TRACE(sql);
    test::TestDb db;
    EXPECT_TRUE(test::TestDb::must(schemaFaults(db.writer)).empty());
    ASSERT_OK(db.writer.script(sql));
    const auto faults = test::TestDb::must(schemaFaults(db.writer));
    ASSERT_EQ(faults.size(), 1u);
    EXPECT_NE(faults.front().find(named), std::string::npos) << faults.front();
    const auto refused = migrate(db.writer);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
    EXPECT_NE(refused.error().message.find(named), std::string::npos) << refused.error().message;
    const auto check = test::TestDb::must(checkDatabase(db.writer));
    EXPECT_EQ(check.faults, faults);
  }
}

/// Runs `sql` like somebody who may write names that SQLite reserves for itself.
Status scriptOnReservedNames(Connection& connection, const std::string& sql) {
  return connection.script("PRAGMA writable_schema=ON; " + sql + "; PRAGMA writable_schema=OFF");
}

constexpr const char* kStat4 = "CREATE TABLE sqlite_stat4(tbl,idx,neq,nlt,ndlt,sample)";

TEST(Schema, theTablesOfAnAnalyzeAreNoFault) {
  test::TestDb db;
  ASSERT_OK(db.writer.script("INSERT INTO meta (key, value) VALUES ('a', 'b'); ANALYZE"));
  ASSERT_OK(scriptOnReservedNames(db.writer, kStat4));
  auto made = db.writer.prepare("SELECT count(*) FROM sqlite_schema WHERE name LIKE 'sqlite_stat%'");
  ASSERT_TRUE(*made.step());
  ASSERT_EQ(made.integer(0), 2);
  EXPECT_EQ(test::TestDb::must(schemaFaults(db.writer)), std::vector<std::string>());
  EXPECT_OK(migrate(db.writer));
  EXPECT_TRUE(test::TestDb::must(checkDatabase(db.writer)).ok());
}

TEST(Schema, whatOnlyHasTheNameOfAnAnalyzesTableIsAFault) {
  const std::pair<std::string, std::string> changes[] = {
      {"CREATE VIEW sqlite_stat1 AS SELECT * FROM people", "view 'sqlite_stat1' is not needlelab's"},
      {"CREATE TRIGGER sqlite_stat1 AFTER INSERT ON audit BEGIN SELECT 1; END",
       "trigger 'sqlite_stat1' of 'audit' is not needlelab's"},
      {"CREATE INDEX sqlite_stat4 ON audit (who)", "index 'sqlite_stat4' of 'audit' is not needlelab's"},
      {"CREATE TABLE sqlite_stat1(tbl,idx,stat,more)", "table 'sqlite_stat1' is not needlelab's"},
      {"CREATE TABLE sqlite_stat1(tbl,idx,stat CHECK(stat))", "table 'sqlite_stat1' is not needlelab's"},
      {"CREATE TABLE sqlite_stat3(tbl,idx,neq,nlt,ndlt,sample)", "table 'sqlite_stat3' is not needlelab's"},
      {"CREATE TABLE SQLITE_STAT4(tbl,idx,neq,nlt,ndlt,sample)", "table 'SQLITE_STAT4' is not needlelab's"},
      {"CREATE TABLE sqlite_statistics (a INTEGER) STRICT", "table 'sqlite_statistics' is not needlelab's"}};
  for (const auto& [sql, named] : changes) {
    SCOPED_TRACE(sql);
    test::TestDb db;
    ASSERT_OK(scriptOnReservedNames(db.writer, sql));
    const auto faults = test::TestDb::must(schemaFaults(db.writer));
    ASSERT_EQ(faults.size(), 1u);
    EXPECT_NE(faults.front().find(named), std::string::npos) << faults.front();
    EXPECT_EQ(migrate(db.writer).error().code, ErrorCode::kCorrupt);
  }
}

TEST(Schema, anotherProgramsDatabaseIsLeftAlone) {
  const test::TempFolder folder;
  auto connection = fresh(folder);
  ASSERT_OK(connection.script("CREATE TABLE theirs (a)"));
  EXPECT_EQ(migrate(connection).error().code, ErrorCode::kCorrupt);
  auto marked = fresh(folder, "b.db");
  ASSERT_OK(marked.script("PRAGMA application_id=1234"));
  EXPECT_EQ(migrate(marked).error().code, ErrorCode::kCorrupt);
}

TEST(Schema, aFailingMigrationLeavesTheVersionBeforeIt) {
  const test::TempFolder folder;
  auto connection = fresh(folder);
  const EmbeddedFile files[] = {
      {"0001_good.sql", "CREATE TABLE a (x INTEGER) STRICT;"},
      {"0002_bad.sql", "CREATE TABLE b (x INTEGER) STRICT; INSERT INTO b VALUES (1); CREATE TABLE a (y);"}};
  const auto failed = migrate(connection, files);
  ASSERT_FALSE(failed.ok());
  EXPECT_NE(failed.error().message.find("0002_bad.sql"), std::string::npos);
  EXPECT_EQ(*schemaVersion(connection), 1);
  auto rows = connection.prepare("SELECT count(*) FROM sqlite_schema WHERE name = 'b'");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), 0);
  EXPECT_FALSE(connection.inTransaction());
}

TEST(Schema, numbersMustBeInOrder) {
  const test::TempFolder folder;
  auto connection = fresh(folder);
  const EmbeddedFile files[] = {{"0002_second.sql", "CREATE TABLE a (x INTEGER) STRICT;"}};
  EXPECT_FALSE(migrate(connection, files).ok());
  EXPECT_EQ(*schemaVersion(connection), 0);
}

TEST(Schema, aLaterVersionKeepsRowsAndIsRefusedByThisProgram) {
  test::TestDb db;
  ASSERT_OK(MetaStore(db.writer).set("k", "1"));
  std::vector<EmbeddedFile> files(embeddedMigrations().begin(), embeddedMigrations().end());
  files.push_back({"0002_more.sql", "ALTER TABLE meta ADD COLUMN more INTEGER NOT NULL DEFAULT 7;"});
  for (int start = 0; start < 2; ++start) {
    ASSERT_OK(migrate(db.writer, files));
    EXPECT_EQ(*schemaVersion(db.writer), 2);
  }
  auto row = db.writer.prepare("SELECT value, more FROM meta WHERE key = 'k'");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.text(0), "1");
  EXPECT_EQ(row.integer(1), 7);
  EXPECT_EQ(migrate(db.writer).error().code, ErrorCode::kVersion);
}

TEST(MetaStore, keepsTheNewestValue) {
  test::TestDb db;
  MetaStore meta(db.writer);
  EXPECT_FALSE(meta.get("k")->has_value());
  ASSERT_OK(meta.set("k", "1"));
  ASSERT_OK(meta.set("k", "2"));
  EXPECT_EQ(**meta.get("k"), "2");
}

}  // namespace
}  // namespace needlelab
