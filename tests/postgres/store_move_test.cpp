// A lab moves to PostgreSQL and back with `needlelab-admin store copy`, with programs killed at any point.
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "tests/postgres/store_move_fixture.h"
#include "tests/unit/db/dump.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

TEST_F(StoreMoveTest, aLabMovesToPostgresAndBackWithKeysAndLog) {
  addSession(5);
  addSession(3, true);
  const auto key = TestDb::must(readWholeFile(lab("audit.key")));
  const Run there = copyTo();
  ASSERT_EQ(there.code, 0) << there.err;
  EXPECT_THAT(there.out, HasSubstr("start the server"));
  EXPECT_THAT(there.err, HasSubstr("copied chunks: 8 rows"));
  EXPECT_THAT(there.err, HasSubstr("compared chunks: 8 rows"));
  EXPECT_FALSE(std::filesystem::exists(lab("needlelab.db")));
  EXPECT_EQ((*TestDb::must(readStoreFile(data()))).url, url);
  expectSound(true, 2);
  addSession(2);
  // run again by mistake
  const Run again = copyTo();
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("nothing to do"));
  expectSound(true, 3);

  const Run back = copyBack();
  ASSERT_EQ(back.code, 0) << back.err;
  EXPECT_THAT(back.out, HasSubstr("without --store"));
  EXPECT_TRUE(std::filesystem::exists(lab("needlelab.db")));
  EXPECT_FALSE(std::filesystem::exists(lab("store")));
  EXPECT_FALSE(std::filesystem::exists(lab(kCopyingDatabase)));
  expectSound(false, 3);
  EXPECT_EQ(TestDb::must(readWholeFile(lab("audit.key"))), key);
  const Run audit = onData({"audit"});
  EXPECT_THAT(audit.out, HasSubstr("from SQLite to PostgreSQL"));
  EXPECT_THAT(audit.out, HasSubstr("from PostgreSQL to SQLite"));
  EXPECT_THAT(copyBack().out, HasSubstr("nothing to do"));
}

/// The rows of each table in a dump.
std::map<std::string, std::string> tablesOf(const std::string& dump) {
  std::map<std::string, std::string> tables;
  for (std::size_t at = dump.find("== "); at != std::string::npos;) {
    const std::size_t next = dump.find("\n== ", at);
    const std::string part = dump.substr(at, next == std::string::npos ? next : next + 1 - at);
    tables[part.substr(3, part.find(':') - 3)] = part;
    at = next == std::string::npos ? next : next + 1;
  }
  return tables;
}

/// The rows of a table that this dump has and `other` has not.
std::vector<std::string> rowsBeyond(const std::string& table, const std::string& other) {
  const auto rowsOf = [](const std::string& text) {
    std::vector<std::string> rows;
    for (std::size_t at = text.find('\n') + 1, end = 0; (end = text.find('\n', at)) != std::string::npos;
         at = end + 1)
      rows.push_back(text.substr(at, end - at));
    std::sort(rows.begin(), rows.end());
    return rows;
  };
  const auto rows = rowsOf(table), others = rowsOf(other);
  std::vector<std::string> beyond;
  std::set_difference(rows.begin(), rows.end(), others.begin(), others.end(), std::back_inserter(beyond));
  return beyond;
}

TEST_F(StoreMoveTest, rowsOfEveryTableSurviveAMoveToPostgresAndBack) {
  const std::string at = postgresUrlOf(folder.path() / "filled");
  std::filesystem::create_directory(file("filled"));
  const auto database = folder.path() / "filled/needlelab.db";
  {
    auto made = TestDb::must(Connection::open(database, {.mode = Connection::Mode::kWriter, .create = true}));
    ASSERT_OK(migrate(made));
    ASSERT_OK(made.script(TestDb::must(readWholeFile(NEEDLELAB_TEST_DATA "/db/rows.sql"))));
  }
  const auto moved = moveStore({.folder = file("filled"), .url = at, .by = "local:tess", .now_unix_ns = 1});
  ASSERT_OK(moved);
  const Run back = run({"store", "copy", "--from", at, "--to", file("filled")});
  ASSERT_EQ(back.code, 0) << back.err;
  auto before = TestDb::must(Connection::open(moved->kept, {}));
  auto after = TestDb::must(Connection::open(database, {}));
  auto tables = tablesOf(dump(before)), moved_tables = tablesOf(dump(after));
  // the way back has its own line and proof; all others are unchanged
  for (const char* log : {"audit", "audit_chain"}) {
    EXPECT_THAT(rowsBeyond(tables[log], moved_tables[log]), testing::IsEmpty()) << log;
    EXPECT_EQ(rowsBeyond(moved_tables[log], tables[log]).size(), 1u) << log;
  }
  EXPECT_THAT(rowsBeyond(moved_tables["audit"], tables["audit"]),
              testing::ElementsAre(HasSubstr("from PostgreSQL to SQLite")));
  EXPECT_THAT(rowsBeyond(moved_tables["meta"], tables["meta"]), testing::IsEmpty());
  EXPECT_THAT(rowsBeyond(tables["meta"], moved_tables["meta"]),
              testing::ElementsAre(testing::StartsWith("'copied_to'")));
  for (const char* grown : {"audit", "audit_chain", "meta"})
    for (auto* all : {&tables, &moved_tables}) EXPECT_EQ(all->erase(grown), 1u) << grown;
  EXPECT_EQ(tables.size(), 29u);
  EXPECT_EQ(moved_tables, tables);
}

TEST_F(StoreMoveTest, killedWithSignalNineItGoesOn) {
  addSession(20);
  for (const bool to_postgres : {true, false}) {
    SCOPED_TRACE(to_postgres);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      StoreMove move = toPostgres();
      move.to_postgres = to_postgres;
      std::uint64_t chunks = 0;
      move.copy.max_rows = 3;
      move.copy.on_progress = [&](const CopyProgress& progress) -> Status {
        if (progress.table == "chunks" && ++chunks == 4) ::kill(::getpid(), SIGKILL);
        return {};
      };
      (void)moveStore(move);
      ::_exit(1);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << status;
    StoreMove move = toPostgres();
    move.to_postgres = to_postgres;
    std::uint64_t chunks = 0;
    move.copy.on_progress = [&](const CopyProgress& progress) -> Status {
      if (progress.table == "chunks" && !progress.comparing) chunks = progress.rows;
      return {};
    };
    // PostgreSQL soon notices that the program has ended
    auto moved = moveStore(move);
    for (int i = 0; i < 100 && !moved && moved.error().code == ErrorCode::kUnavailable; ++i) {
      ::usleep(50'000);
      moved = moveStore(move);
    }
    ASSERT_OK(moved);
    EXPECT_TRUE(moved->went_on);
    EXPECT_EQ(chunks, 20u - 4 * 3) << "committed data stay";
    EXPECT_EQ(moved->compared.chunks, 20u);
    expectSound(to_postgres, 1);
  }
}

TEST_F(StoreMoveTest, afterALostConnectionItGoesOn) {
  addSession(20);
  StoreMove move = toPostgres();
  move.copy.max_rows = 3;
  bool ended = false;
  move.copy.on_progress = [&](const CopyProgress& progress) -> Status {
    if (progress.table != "chunks" || std::exchange(ended, true)) return {};
    ASSIGN_OR_RETURN(auto other, openAt(StoreAddress(lab("needlelab.db"), url), Connection::Mode::kWriter));
    return other.script(
        "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
        " WHERE datname = current_database() AND pid <> pg_backend_pid()");
  };
  const auto lost = moveStore(move);
  ASSERT_FALSE(lost.ok());
  EXPECT_EQ(lost.error().code, ErrorCode::kUnavailable) << lost.error().message;
  const auto moved = moveStore(move);
  ASSERT_OK(moved);
  EXPECT_TRUE(moved->went_on);
  EXPECT_EQ(moved->compared.chunks, 20u);
  expectSound(true, 1);
}

TEST_F(StoreMoveTest, aSwitchThatWasKilledIsCompletedByTheNextStart) {
  addSession(2);
  ASSERT_EQ(copyTo().code, 0);
  // killed after writing DIR/store but before renaming the old database
  const auto kept = [&] {
    for (const auto& entry : std::filesystem::directory_iterator(data()))
      if (entry.path().filename().string().starts_with("needlelab.db.replaced-") &&
          entry.path().extension() != "")
        return entry.path();
    return std::filesystem::path();
  }();
  ASSERT_FALSE(kept.empty());
  auto file = *TestDb::must(readStoreFile(data()));
  EXPECT_EQ(file.kept, "");
  std::filesystem::rename(kept, lab("needlelab.db"));
  file.kept = "needlelab.db.replaced-again";
  ASSERT_OK(writeStoreFile(data(), file));
  expectSound(true, 1);
  EXPECT_FALSE(std::filesystem::exists(lab("needlelab.db")));
  EXPECT_TRUE(std::filesystem::exists(lab("needlelab.db.replaced-again")));

  // killed after removing DIR/store but before renaming the copy
  ASSERT_EQ(copyBack().code, 0);
  {
    auto copy = TestDb::must(Connection::open(lab("needlelab.db"), {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writeCopyMark(copy, {"copy-1", true}));
    ASSERT_TRUE(TestDb::must(copy.emptyLog(0)));
  }
  std::filesystem::rename(lab("needlelab.db"), lab(kCopyingDatabase));
  expectSound(false, 1);
  EXPECT_FALSE(std::filesystem::exists(lab(kCopyingDatabase)));

  // a copy that was not compared never replaces a database
  {
    auto copy = TestDb::must(Connection::open(lab("needlelab.db"), {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writeCopyMark(copy, {"copy-1"}));
    ASSERT_TRUE(TestDb::must(copy.emptyLog(0)));
  }
  std::filesystem::rename(lab("needlelab.db"), lab(kCopyingDatabase));
  const auto none = Store::open(data(), {.create = false});
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(std::filesystem::exists(lab("needlelab.db")));
}

TEST_F(StoreMoveTest, aUserWhoOwnsTheDatabaseAndNothingElseIsEnough) {
  addSession(3);
  const PlainUser user(true);
  const Run there = run({"store", "copy", "--from", data(), "--to", user.url()});
  ASSERT_EQ(there.code, 0) << there.err;
  expectSound(true, 1);
  addSession(2);  // with the triggers that this user turned back on
  const Run back = run({"store", "copy", "--from", user.url(), "--to", data()});
  ASSERT_EQ(back.code, 0) << back.err;
  expectSound(false, 2);
}

}  // namespace
}  // namespace needlelab::test
