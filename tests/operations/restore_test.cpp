// A restored backup replaces the database completely or not at all.
#include <gmock/gmock.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "common/base/files/files.h"
#include "db/backup/backup.h"
#include "db/service/folder/data_folder.h"
#include "db/service/start/bootstrap.h"
#include "db/store/schema.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

constexpr std::int64_t kNow = 1'790'000'000'000'000'000;

/// A stopped server's folder with the users `kept` and `late`; `late` was added after the backup.
class RestoreTest : public testing::Test {
 protected:
  void SetUp() override {
    addUser("kept");
    {
      auto store = open();
      auto reader = store->readers().borrow();
      ASSERT_TRUE(backupTo(**reader, backup()).ok());
    }
    addUser("late");
  }
  [[nodiscard]] fs::path data() const { return folder_.path() / "data"; }
  [[nodiscard]] fs::path backup() const { return folder_.path() / "backup.db"; }
  [[nodiscard]] std::unique_ptr<Store> open() const {
    auto store = Store::open(data(), {});
    if (!store.ok()) throw std::runtime_error(store.error().message);
    return std::move(*store);
  }
  void addUser(const std::string& name) const {
    auto store = open();
    pb::Request request;
    request.mutable_add_user()->set_name(name);
    request.mutable_add_user()->set_role(pb::TRAINEE);
    ASSERT_FALSE(store->service().execute({"root", pb::ADMINISTRATOR}, request).error);
  }
  /// Names of the people in the folder's database.
  [[nodiscard]] std::vector<std::string> people(const fs::path& at = {}) const {
    std::vector<std::string> names;
    auto reader =
        Connection::open(at.empty() ? data() / "needlelab.db" : at, {.mode = Connection::Mode::kReader});
    if (!reader.ok()) return {reader.error().message};
    auto rows = reader->prepare("SELECT name FROM accounts ORDER BY name");
    for (auto row = rows.step(); row.ok() && *row; row = rows.step()) names.emplace_back(rows.text(0));
    return names;
  }
  void copyTo(const fs::path& to) const {
    fs::remove(to);
    fs::copy_file(backup(), to);
  }
  /// Checks that a failed restore changes nothing.
  void refused(const fs::path& from, ErrorCode code, const std::string& words) {
    const auto before = *readWholeFile(data() / "needlelab.db");
    const auto result = restoreFrom(data(), from, kNow);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, code);
    EXPECT_THAT(result.error().message, HasSubstr(words));
    EXPECT_THAT(result.error().message, HasSubstr(from.string()));
    EXPECT_THAT(result.error().message, Not(HasSubstr("restoring"))) << "the copy is gone";
    EXPECT_EQ(*readWholeFile(data() / "needlelab.db"), before);
    EXPECT_FALSE(fs::exists(data() / "needlelab.db.restoring"));
    EXPECT_FALSE(fs::exists(data() / "restore.pending"));
    EXPECT_EQ(people(), (std::vector<std::string>{"kept", "late"}));
  }
  TempFolder folder_;
};

TEST_F(RestoreTest, installsTheBackupAndKeepsTheReplacedDatabase) {
  // A write-ahead log without a checkpoint must neither be lost with the old database nor be applied to the
  // new one.
  {
    auto writer = Connection::open(data() / "needlelab.db", {.mode = Connection::Mode::kWriter});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->script("INSERT INTO meta VALUES ('in_the_log', '1')").ok());
  }
  ASSERT_GT(fs::file_size(data() / "needlelab.db-wal"), 0u);
  const auto result = restoreFrom(data(), backup(), kNow);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(people(), std::vector<std::string>{"kept"});
  EXPECT_EQ(people(result->kept), (std::vector<std::string>{"kept", "late"}));
  auto old = Connection::open(result->kept, {.mode = Connection::Mode::kReader});
  auto rows = old->prepare("SELECT value FROM meta WHERE key = 'in_the_log'");
  EXPECT_TRUE(*rows.step()) << "the kept database has its log";
  auto fresh = Connection::open(data() / "needlelab.db", {.mode = Connection::Mode::kReader});
  auto none = fresh->prepare("SELECT value FROM meta WHERE key = 'in_the_log'");
  EXPECT_FALSE(*none.step());
  EXPECT_EQ(fs::status(data() / "needlelab.db").permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
  // and it works
  addUser("later");
  // A second restore in the same second keeps its own copy.
  const auto again = restoreFrom(data(), backup(), kNow);
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_NE(again->kept, result->kept);
  EXPECT_EQ(people(again->kept), (std::vector<std::string>{"kept", "later"}));
}

TEST_F(RestoreTest, accessesThatWereWithdrawnSinceTheBackupAreNamedAndNoted) {
  const auto ask = [&](Store& store, const pb::Request& request) {
    const Outcome outcome = store.service().execute({"root", pb::ADMINISTRATOR}, request);
    EXPECT_FALSE(outcome.error) << outcome.error->message;
  };
  const fs::path later = folder_.path() / "later.db";
  {
    auto store = open();
    const auto person = [&](const std::string& name) {
      pb::Request request;
      request.mutable_add_user()->set_name(name);
      request.mutable_add_user()->set_role(pb::INSTRUCTOR);
      request.mutable_add_user()->set_password("a long enough password");
      ask(*store, request);
    };
    for (const char* name : {"dismissed", "changed", "same"}) person(name);
    for (const char* name : {"stolen", "renewed", "mine"}) {
      pb::Request request;
      request.mutable_add_station()->set_name(name);
      ask(*store, request);
    }
    auto reader = store->readers().borrow();
    ASSERT_TRUE(backupTo(**reader, later).ok());
  }
  {
    auto store = open();
    pb::Request request;
    request.mutable_disable_user()->set_name("dismissed");
    ask(*store, request);
    request.mutable_set_password()->set_name("changed");
    request.mutable_set_password()->set_password("another long password");
    ask(*store, request);
    for (const char* name : {"stolen", "renewed"}) {
      request.mutable_revoke_station()->set_name(name);
      ask(*store, request);
    }
    request.mutable_add_station()->set_name("renewed");
    ask(*store, request);
  }
  const auto result = restoreFrom(data(), later, kNow);
  ASSERT_TRUE(result.ok()) << result.error().message;
  const auto store = open();
  const auto valid_again = noteAccessValidAgain(*store, result->kept);
  ASSERT_TRUE(valid_again.ok()) << valid_again.error().message;
  std::vector<std::string> texts;
  for (const RestoredAccess& one : *valid_again) texts.push_back(one.text);
  EXPECT_THAT(texts, testing::ElementsAre(HasSubstr("user changed: had a new password"),
                                          HasSubstr("user dismissed: was disabled"),
                                          HasSubstr("station renewed: had got a new key"),
                                          HasSubstr("station stolen: its key was revoked")));
  auto reader = store->readers().borrow();
  auto rows =
      (*reader)->prepare("SELECT count(*) FROM audit WHERE action = 'access valid again' AND who = 'local'");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), 4);
}

TEST_F(RestoreTest, anUnreadableReplacedDatabaseDoesNotPreventTheRestore) {
  std::ofstream(data() / "needlelab.db", std::ios::trunc) << std::string(20'000, 'x');
  fs::remove(data() / "needlelab.db-wal");
  fs::remove(data() / "needlelab.db-shm");
  const auto result = restoreFrom(data(), backup(), kNow);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_FALSE(noteAccessValidAgain(*open(), result->kept).ok());
  EXPECT_EQ(people(), std::vector<std::string>{"kept"});
  EXPECT_EQ(*readWholeFile(result->kept), std::string(20'000, 'x'));
}

TEST_F(RestoreTest, holdsTheFolderUntilItIsDone) {
  std::atomic<bool> ended = false;
  std::atomic<bool> taken = false;
  std::thread other([&] {
    const auto decided = [&] { return fs::exists(data() / kRestorePending); };
    while (!ended)
      if (decided() && FolderLock::take(data(), "needlelab-server").ok() && decided()) taken = true;
  });
  const auto result = restoreFrom(data(), backup(), kNow);
  ended = true;
  other.join();
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_FALSE(taken) << "a server would have opened a half-restored folder";
  EXPECT_TRUE(FolderLock::take(data(), "needlelab-server").ok()) << "free again";
}

TEST_F(RestoreTest, theWayBackIsARename) {
  {
    auto writer = Connection::open(data() / "needlelab.db", {.mode = Connection::Mode::kWriter});
    ASSERT_TRUE(writer->script("INSERT INTO meta VALUES ('in_the_log', '1')").ok());
  }
  const auto result = restoreFrom(data(), backup(), kNow);
  ASSERT_TRUE(result.ok()) << result.error().message;
  // Goes back as OPERATIONS.md describes.
  fs::create_directory(data() / "restored");
  for (const char* suffix : {"", "-wal", "-shm"}) {
    const std::string name = std::string("needlelab.db") + suffix;
    if (fs::exists(data() / name)) fs::rename(data() / name, data() / "restored" / name);
    if (fs::exists(result->kept.string() + suffix)) fs::rename(result->kept.string() + suffix, data() / name);
  }
  { const auto store = open(); }
  EXPECT_EQ(people(), (std::vector<std::string>{"kept", "late"}));
  auto old = Connection::open(data() / "needlelab.db", {.mode = Connection::Mode::kReader});
  auto rows = old->prepare("SELECT value FROM meta WHERE key = 'in_the_log'");
  EXPECT_TRUE(*rows.step()) << "with its log";
}

TEST_F(RestoreTest, aNewMachineGetsItsDatabase) {
  const fs::path there = folder_.path() / "new";
  fs::create_directory(there);
  const auto result = restoreFrom(there, backup(), kNow);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_TRUE(result->kept.empty());
  EXPECT_EQ(people(there / "needlelab.db"), std::vector<std::string>{"kept"});
}

TEST_F(RestoreTest, isRefusedWhileAServerRuns) {
  const auto store = open();
  const auto result = restoreFrom(data(), backup(), kNow);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(result.error().message, HasSubstr("a server is running"));
}

TEST_F(RestoreTest, refusesABadBackupAndChangesNothing) {
  const fs::path bad = folder_.path() / "bad.db";
  copyTo(bad);
  {
    auto writer = Connection::open(bad, {.mode = Connection::Mode::kWriter});
    ASSERT_TRUE(writer->script("PRAGMA journal_mode=DELETE; PRAGMA user_version=999").ok());
  }
  refused(bad, ErrorCode::kVersion, "999");
  copyTo(bad);
  std::string flipped = *readWholeFile(bad);
  constexpr std::size_t kVersionAt = 60;  // of SQLite's header, big-endian
  flipped[kVersionAt] = static_cast<char>(flipped[kVersionAt] ^ 0x80);
  folder_.write("bad.db", flipped);
  refused(bad, ErrorCode::kCorrupt, "its header says schema version -");
  // some 40 MB of SQLite's memory, where a larger one would have taken GB
  copyTo(bad);
  {
    auto writer = Connection::open(bad, {.mode = Connection::Mode::kWriter});
    std::string columns = "c0";
    for (int i = 1; i < 90; ++i) columns += ", c" + std::to_string(i) + " DEFAULT (1 + 1 + 1 + 1 + 1 + 1)";
    std::string tables;
    for (int i = 0; i < 300; ++i) tables += "CREATE TABLE t" + std::to_string(i) + " (" + columns + ");";
    ASSERT_TRUE(writer->script("PRAGMA journal_mode=DELETE;" + tables).ok());
  }
  refused(bad, ErrorCode::kCorrupt, "its schema is much larger than needlelab's");
  copyTo(bad);
  fs::resize_file(bad, fs::file_size(bad) / 2 / 4096 * 4096);
  refused(bad, ErrorCode::kCorrupt, "");
  folder_.write("bad.db", std::string(20'000, 'x'));
  refused(bad, ErrorCode::kCorrupt, "");
  folder_.write("bad.db", "");
  refused(bad, ErrorCode::kCorrupt, "not a needlelab database");
  // one great hole
  fs::resize_file(bad, fs::space(data()).available + (std::uintmax_t{1} << 30));
  refused(bad, ErrorCode::kNoRoom, "make room, nothing was changed");
  folder_.write("bad.db", "");
  refused(folder_.path() / "none.db", ErrorCode::kInvalidInput, "no such file");
  refused(data() / "needlelab.db", ErrorCode::kInvalidInput, "the database itself");
  copyTo(bad);
  folder_.write("bad.db-wal", "log");
  refused(bad, ErrorCode::kInvalidInput, "no backup");
}

TEST_F(RestoreTest, whatWasCutOffIsCompletedByTheNextStart) {
  // Tests each state that a crash can leave between the decision and the end.
  const std::string kept = "needlelab.db.replaced-20260101T000000Z";
  const auto decided = [&] {
    copyTo(data() / "needlelab.db.restoring");
    std::ofstream(data() / "restore.pending") << kept;
  };
  const auto expectRestored = [&](const char* when) {
    { const auto store = open(); }
    EXPECT_EQ(people(), std::vector<std::string>{"kept"}) << when;
    EXPECT_EQ(people(data() / kept), (std::vector<std::string>{"kept", "late"})) << when;
    EXPECT_FALSE(fs::exists(data() / "restore.pending")) << when;
    EXPECT_FALSE(fs::exists(data() / "needlelab.db.restoring")) << when;
  };
  const auto bringBack = [&] {
    for (const char* name : {"needlelab.db", "needlelab.db-wal", "needlelab.db-shm"})
      fs::remove(data() / name);
    fs::rename(data() / kept, data() / "needlelab.db");
    fs::remove(data() / (kept + "-wal"));
    fs::remove(data() / (kept + "-shm"));
  };
  const auto keepLog = [&] {
    if (fs::exists(data() / "needlelab.db-wal"))
      fs::rename(data() / "needlelab.db-wal", data() / (kept + "-wal"));
  };
  decided();
  expectRestored("just decided");
  bringBack();
  decided();
  keepLog();
  expectRestored("the log has its name");
  bringBack();
  decided();
  keepLog();
  fs::rename(data() / "needlelab.db", data() / kept);
  expectRestored("kept under its name");
  bringBack();
  decided();
  keepLog();
  fs::rename(data() / "needlelab.db", data() / kept);
  fs::remove(data() / "needlelab.db-shm");
  fs::rename(data() / "needlelab.db.restoring", data() / "needlelab.db");
  expectRestored("in place, not yet said");
  // Before the decision: the old database is unchanged.
  bringBack();
  copyTo(data() / "needlelab.db.restoring");
  { const auto store = open(); }
  EXPECT_EQ(people(), (std::vector<std::string>{"kept", "late"}));
}

TEST_F(RestoreTest, aForgedDecisionIsNotFollowed) {
  copyTo(data() / "needlelab.db.restoring");
  std::ofstream(data() / "restore.pending") << "../../etc/passwd";
  const auto store = Store::open(data(), {});
  ASSERT_FALSE(store.ok());
  EXPECT_THAT(store.error().message, HasSubstr("restore.pending"));
  EXPECT_EQ(people(), (std::vector<std::string>{"kept", "late"}));
}

TEST(BackupCancel, isGivenUpSoonAndLeavesNothing) {
  RunningServer server;
  auto station = server.connect(stationLogin("bench-1", server.addStation("bench-1")));
  ASSERT_TRUE(station.ok());
  FakeSession session("bench-1");
  ASSERT_TRUE(station->send(session.open()).ok());
  for (std::uint64_t seq = 0; seq < 60; ++seq) ASSERT_TRUE(station->send(session.chunk(seq)).ok());
  session.waitForAck(*station, 60);
  const fs::path target = server.folder() / "backup.db";
  pb::Request request;
  request.mutable_backup()->set_path(target);
  // The server cancels long work before the backup: this backup and later ones end at once.
  server.service().cancelLongWork();
  const Outcome outcome = server.service().execute({"root", pb::ADMINISTRATOR}, request);
  ASSERT_TRUE(outcome.error);
  EXPECT_THAT(outcome.error->message, HasSubstr("given up"));
  EXPECT_FALSE(fs::exists(target));
  EXPECT_FALSE(fs::exists(target.string() + ".partial"));
}

}  // namespace
}  // namespace needlelab
