// A lab moves to PostgreSQL and back with `needlelab-admin store copy`: which database its folder works with,
// whatever is killed, damaged or in the way.
#include "db/service/store_move.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <utility>

#include "common/base/clock.h"
#include "common/base/files.h"
#include "db/schema.h"
#include "db/service/store_switch.h"
#include "tests/support/postgres_database.h"
#include "tests/unit/client/admin/run_admin.h"
#include "tests/unit/db/dump.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;
using testing::Not;

class StoreMoveTest : public AdminTest {
 protected:
  [[nodiscard]] std::filesystem::path lab(const std::string& name) const {
    return folder.path() / "data" / name;
  }
  [[nodiscard]] StoreMove toPostgres() const {
    return {.folder = data(), .url = url, .by = "local:tess", .now_unix_ns = wallNowNs()};
  }
  [[nodiscard]] Run copyTo(std::vector<std::string> more = {}) const {
    std::vector<std::string> all{"store", "copy", "--from", data(), "--to", url};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
  [[nodiscard]] Run copyBack(std::vector<std::string> more = {}) const {
    std::vector<std::string> all{"store", "copy", "--from", url, "--to", data()};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
  /// Whether the lab works, on which engine, and has what it had.
  void expectSound(bool on_postgres, std::uint64_t sessions) const {
    {
      const auto store = Store::open(data(), {.create = false});
      ASSERT_OK(store);
      auto reader = TestDb::must((*store)->readers().borrow());
      EXPECT_EQ(reader->sqlite() == nullptr, on_postgres);
      for (const char* key : {"copy_under_way", "copied_to"})
        EXPECT_FALSE(TestDb::must(MetaStore(*reader).get(key)).has_value()) << key;
    }
    const Run check = onData({"check", "--json"});
    EXPECT_EQ(check.code, 0) << check.err << check.out;
    if (check.code == 0) {
      EXPECT_EQ(check.rows()[0]["sessions"], sessions);
    }
    const Run verify = onData({"audit", "verify"});
    EXPECT_EQ(verify.code, 0) << verify.err << verify.out;
  }
  /// A copy that ended before it was compared: `pages` pages of a row each are there.
  void leaveUnfinished(int pages) const {
    StoreMove move = toPostgres();
    move.copy = {.on_progress = [pages](const CopyProgress& progress) mutable -> Status {
                   if (progress.table_ended || --pages > 0) return {};
                   return Error{ErrorCode::kUnavailable, "killed"};
                 },
                 .most_rows = 1};
    const auto moved = moveStore(move);
    ASSERT_FALSE(moved.ok());
    EXPECT_EQ(moved.error().message, "killed");
  }

  PostgresBelow dropped_at_end{folder.path()};
  const std::string url = postgresUrlOf(folder.path() / "one");
};

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

TEST_F(StoreMoveTest, nobodyWorksWithAnUnfinishedCopy) {
  addSession(4);
  leaveUnfinished(5);
  EXPECT_TRUE(std::filesystem::exists(lab("needlelab.db")));
  const auto refused = Store::open(folder.path() / "other", {.store_url = url});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, HasSubstr("unfinished copy"));
  // the command goes on
  const Run there = copyTo();
  ASSERT_EQ(there.code, 0) << there.err;
  expectSound(true, 1);
}

TEST_F(StoreMoveTest, aCopyDoesNotGoOnOnceSomebodyWorkedWithTheSource) {
  addSession(4);
  leaveUnfinished(5);
  addSession(1);
  const Run refused = copyTo();
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--begin-again"));
  const Run again = copyTo({"--begin-again"});
  ASSERT_EQ(again.code, 0) << again.err;
  expectSound(true, 2);
}

TEST_F(StoreMoveTest, theWayBackBeginsAgainAndRefusesInTheSameWay) {
  addSession(4);
  ASSERT_EQ(copyTo().code, 0);
  StoreMove move = toPostgres();
  move.to_postgres = false;
  int pages = 5;
  move.copy.on_progress = [&](const CopyProgress&) -> Status {
    return --pages > 0 ? Status() : Status(Error{ErrorCode::kUnavailable, "killed"});
  };
  ASSERT_FALSE(moveStore(move).ok());
  EXPECT_TRUE(std::filesystem::exists(lab(kCopyingDatabase)));
  expectSound(true, 1);  // the lab works with the source meanwhile
  EXPECT_EQ(copyBack().code, 2);
  const Run again = copyBack({"--begin-again"});
  ASSERT_EQ(again.code, 0) << again.err;
  expectSound(false, 1);
}

TEST_F(StoreMoveTest, aDatabaseThatIsNotEmptyIsRefusedAndLeftAlone) {
  addSession(1);
  { ASSERT_OK(Store::open(folder.path() / "other", {.store_url = url})); }
  const Run refused = copyTo();
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("is not empty"));
  EXPECT_EQ(copyTo({"--begin-again"}).code, 2) << "it is no unfinished copy";
  expectSound(false, 1);
  ASSERT_OK(Store::open(folder.path() / "other", {}));
}

TEST_F(StoreMoveTest, aRowThatIsChangedBehindTheCopysBackKeepsTheLabWhereItWas) {
  addSession(2);
  StoreMove move = toPostgres();
  bool changed = false;
  move.copy.on_progress = [&](const CopyProgress& progress) -> Status {
    if (!progress.comparing || std::exchange(changed, true)) return {};
    ASSIGN_OR_RETURN(auto other, openAt(StoreAddress(lab("needlelab.db"), url), Connection::Mode::kWriter));
    return other.run("UPDATE sessions SET exercise_id = 'other'");
  };
  const auto moved = moveStore(move);
  ASSERT_FALSE(moved.ok());
  EXPECT_EQ(moved.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(moved.error().message,
              HasSubstr("sessions, number 1 has another value in the column exercise_id"));
  expectSound(false, 1);
}

TEST_F(StoreMoveTest, damagedChunksAreNamedAndTheLabStaysUnlessItIsAskedToGo) {
  addSession(3, false, "UPDATE chunks SET bytes = zeroblob(length(bytes)) WHERE seq = 1");
  const Run refused = copyTo();
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.out, HasSubstr("damaged: chunks, session 1, chunk 1"));
  EXPECT_THAT(refused.err, HasSubstr("a chunk is damaged in the source"));
  EXPECT_TRUE(std::filesystem::exists(lab("needlelab.db")));
  EXPECT_FALSE(std::filesystem::exists(lab("store")));
  const Run moved = copyTo({"--with-damaged"});
  EXPECT_EQ(moved.code, 0) << moved.err;
  EXPECT_FALSE(std::filesystem::exists(lab("needlelab.db")));
  const Run check = onData({"check"});
  EXPECT_EQ(check.code, 1) << "the copy is as good as its original";
}

TEST_F(StoreMoveTest, whoWorksWithOneOfTheTwoKeepsTheCopyFromBeginning) {
  addSession(1);
  {
    const auto server = Store::open(data(), {});
    ASSERT_OK(server);
    const Run refused = copyTo();
    EXPECT_EQ(refused.code, 1);
    EXPECT_THAT(refused.err, HasSubstr("a server is running"));
  }
  {
    const auto server = Store::open(folder.path() / "other", {.store_url = url});
    ASSERT_OK(server);
    const Run refused = copyTo();
    EXPECT_EQ(refused.code, 1);
    EXPECT_THAT(refused.err, HasSubstr("works on this database"));
  }
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

/// A user of PostgreSQL who may nothing but log in, and a database.
class PlainUser {
 public:
  /// `owns`: the database is the user's, and empty; else it has the tables of another user, which this one
  /// may change.
  explicit PlainUser(bool owns)
      : cluster_(std::getenv("NEEDLELAB_TEST_POSTGRES")),
        control_(connect("postgres")),
        name_("plain" + std::to_string(::getpid()) + (owns ? "a" : "b")) {
    run(control_, "CREATE ROLE " + name_ + " LOGIN");
    run(control_, "CREATE DATABASE " + name_ +
                      " TEMPLATE template0 ENCODING 'UTF8' LC_COLLATE 'C' LC_CTYPE 'C'" +
                      (owns ? " OWNER " + name_ : ""));
    if (owns) return;
    Connection made = connect(name_);
    EXPECT_OK(migrate(made));
    run(made, "GRANT USAGE ON SCHEMA needlelab TO " + name_ +
                  "; GRANT ALL ON ALL TABLES IN SCHEMA needlelab TO " + name_);
  }
  ~PlainUser() {
    (void)control_.script("DROP DATABASE IF EXISTS " + name_ + " WITH (FORCE)");
    (void)control_.script("DROP ROLE IF EXISTS " + name_);
  }
  PlainUser(const PlainUser&) = delete;
  PlainUser& operator=(const PlainUser&) = delete;
  [[nodiscard]] std::string url() const {
    return cluster_.substr(0, cluster_.find(" user=")) + " user=" + name_ + " dbname=" + name_;
  }

 private:
  [[nodiscard]] Connection connect(const std::string& database) const {
    return TestDb::must(
        openAt(StoreAddress("needlelab.db", cluster_ + " dbname=" + database), Connection::Mode::kWriter));
  }
  static void run(Connection& connection, const std::string& sql) { EXPECT_OK(connection.script(sql)); }

  const std::string cluster_;
  Connection control_;
  const std::string name_;
};

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

TEST_F(StoreMoveTest, aUserWhoDoesNotOwnTheTablesIsRefusedBeforeAnythingIsCopied) {
  addSession(3);
  const PlainUser user(false);
  const Run refused = run({"store", "copy", "--from", data(), "--to", user.url()});
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("must be owner of table"));
  EXPECT_THAT(refused.err, HasSubstr("needs the user who owns the tables"));
  expectSound(false, 1);
}

TEST_F(StoreMoveTest, wrongFoldersAndAddressesAreNamed) {
  addSession(1);
  const auto refusal = [&](const std::string& from, const std::string& to) {
    const Run refused = run({"store", "copy", "--from", from, "--to", to});
    EXPECT_EQ(refused.code, 2) << refused.err;
    return refused.err;
  };
  EXPECT_THAT(refusal(data(), data()), HasSubstr("one of --from and --to"));
  EXPECT_THAT(refusal(url, url), HasSubstr("one of --from and --to"));
  EXPECT_THAT(refusal(file("none"), url), HasSubstr("is no folder"));
  std::filesystem::create_directory(file("empty"));
  EXPECT_THAT(refusal(file("empty"), url), HasSubstr("no needlelab.db"));
  EXPECT_THAT(refusal(url, file("empty")), HasSubstr("The lab's keys lie in that folder"));
  EXPECT_THAT(refusal(url, data()), HasSubstr("has a database of its own"));
  const std::string hush = refusal(data(), "postgresql://anna:hush@127.0.0.1:1/lab");
  EXPECT_THAT(hush, HasSubstr("has a password"));
  EXPECT_THAT(hush, Not(HasSubstr("hush")));
  // another lab's database
  ASSERT_EQ(copyTo().code, 0);
  const std::string other = postgresUrlOf(folder.path() / "two");
  { ASSERT_OK(Store::open(folder.path() / "other", {.store_url = other})); }
  EXPECT_THAT(refusal(other, data()), HasSubstr("check the address"));
  EXPECT_THAT(refusal(data(), other), HasSubstr("is on PostgreSQL"));
  expectSound(true, 1);
}

}  // namespace
}  // namespace needlelab::test
