// A lab moves to PostgreSQL and back with `needlelab-admin store copy`, whatever is killed in between.
#include <signal.h>
#include <sys/wait.h>

#include <map>
#include <utility>

#include "tests/postgres/store_move_fixture.h"
#include "tests/unit/db/dump.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

TEST_F(StoreMoveTest, aLabGoesToPostgresAndBackWithItsKeysAndItsLog) {
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
  // given again, by mistake
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

/// The rows of each table in a dump, but of those in which the starts in between write.
std::map<std::string, std::string> tablesOf(const std::string& dump) {
  std::map<std::string, std::string> tables;
  for (std::size_t at = dump.find("== "); at != std::string::npos;) {
    const std::size_t next = dump.find("\n== ", at);
    const std::string part = dump.substr(at, next == std::string::npos ? next : next + 1 - at);
    tables[part.substr(3, part.find(':') - 3)] = part;
    at = next == std::string::npos ? next : next + 1;
  }
  for (const char* log : {"audit", "audit_chain", "meta"}) EXPECT_EQ(tables.erase(log), 1u) << log;
  return tables;
}

TEST_F(StoreMoveTest, aFolderOfAnOldVersionGoesToPostgresAndBackAsItIsAfterItsMigration) {
  for (const int version : {1, 4, newestSchemaVersion()}) {
    SCOPED_TRACE(version);
    const std::string name = "v" + std::to_string(version);
    const std::string at = postgresUrlOf(folder.path() / name);
    std::filesystem::create_directory(file(name));
    {
      auto old = TestDb::must(Connection::open(folder.path() / name / "needlelab.db",
                                               {.mode = Connection::Mode::kWriter, .create = true}));
      ASSERT_OK(old.script(
          TestDb::must(readWholeFile(std::filesystem::path(NEEDLELAB_TEST_DATA) / (name + ".sql")))));
    }
    const auto moved = moveStore({.folder = file(name), .url = at, .by = "local:tess", .now_unix_ns = 1});
    ASSERT_OK(moved);
    const Run back = run({"store", "copy", "--from", at, "--to", file(name)});
    ASSERT_EQ(back.code, 0) << back.err;
    auto before = TestDb::must(Connection::open(moved->kept, {}));
    auto after = TestDb::must(Connection::open(folder.path() / name / "needlelab.db", {}));
    const auto tables = tablesOf(dump(before));
    EXPECT_EQ(tables.size(), 25u);
    EXPECT_EQ(tablesOf(dump(after)), tables);
  }
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
      move.copy.most_rows = 3;
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
    // PostgreSQL notices the end of the program soon
    auto moved = moveStore(move);
    for (int i = 0; i < 100 && !moved && moved.error().code == ErrorCode::kUnavailable; ++i) {
      ::usleep(50'000);
      moved = moveStore(move);
    }
    ASSERT_OK(moved);
    EXPECT_TRUE(moved->went_on);
    EXPECT_TRUE(moved->switched);
    EXPECT_EQ(chunks, 20u - 4 * 3) << "what was committed stays";
    EXPECT_EQ(moved->compared.chunks, 20u);
    expectSound(to_postgres, 1);
  }
}

TEST_F(StoreMoveTest, afterALostConnectionItGoesOn) {
  addSession(20);
  StoreMove move = toPostgres();
  move.copy.most_rows = 3;
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
  // killed between DIR/store and the old database's new name
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

  // killed between the end of DIR/store and the copy's new name
  ASSERT_EQ(copyBack().code, 0);
  {
    auto copy = TestDb::must(Connection::open(lab("needlelab.db"), {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writeCopyMark(copy, {"copy-1", newestSchemaVersion(), true}));
    ASSERT_TRUE(TestDb::must(copy.emptyLog(0)));
  }
  std::filesystem::rename(lab("needlelab.db"), lab(kCopyingDatabase));
  expectSound(false, 1);
  EXPECT_FALSE(std::filesystem::exists(lab(kCopyingDatabase)));

  // a copy that nobody compared gets into nobody's place
  {
    auto copy = TestDb::must(Connection::open(lab("needlelab.db"), {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writeCopyMark(copy, {"copy-1", newestSchemaVersion(), false}));
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
  addSession(2);  // with the triggers that this user turned on again
  const Run back = run({"store", "copy", "--from", user.url(), "--to", data()});
  ASSERT_EQ(back.code, 0) << back.err;
  expectSound(false, 2);
}

}  // namespace
}  // namespace needlelab::test
