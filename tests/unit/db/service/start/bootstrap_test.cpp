#include "db/service/start/bootstrap.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "db/store/schema.h"
#include "db/teaching/documents.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

unsigned modeOf(const std::filesystem::path& path) {
  struct stat info {};
  EXPECT_EQ(::stat(path.c_str(), &info), 0) << path;
  return info.st_mode & 0777u;
}

pb::Request listProfiles() {
  pb::Request request;
  request.mutable_list_profiles();
  return request;
}

const Principal kAdmin{"ada", pb::ADMINISTRATOR};

TEST(Bootstrap, theFirstStartMakesAPrivateFolderWithTheSamples) {
  const test::TempFolder folder;
  const auto dir = folder.path() / "a" / "data";
  auto store = test::openStore(dir);
  EXPECT_EQ(modeOf(dir), 0700u);
  EXPECT_EQ(modeOf(dir / "needlelab.db"), 0600u);
  EXPECT_EQ(modeOf(dir / "needlelab.db-wal"), 0600u);
  ASSERT_FALSE(embeddedSamples().empty());
  const auto outcome = store->service().execute(kAdmin, listProfiles());
  ASSERT_FALSE(outcome.error.has_value());
  EXPECT_EQ(static_cast<std::size_t>(outcome.reply.profiles().profiles_size()), embeddedSamples().size() - 3);
  pb::Request curricula;
  curricula.mutable_list_curricula();
  EXPECT_EQ(store->service().execute(kAdmin, curricula).reply.curricula().curricula_size(), 3);
}

TEST(Bootstrap, aSecondStartKeepsExistingData) {
  const test::TempFolder folder;
  {
    auto store = test::openStore(folder.path());
    ASSERT_OK(store->writer().run([](Connection& c) {
      if (auto done = c.script("DELETE FROM exercises; DELETE FROM curricula; DELETE FROM profiles"); !done)
        return done;
      return StationStore(c).add("lab-1", StationKeyBytes{}, 1);
    }));
  }
  auto store = test::openStore(folder.path());
  EXPECT_EQ(store->service().execute(kAdmin, listProfiles()).reply.profiles().profiles_size(), 0)
      << "samples came again";
  auto reader = store->readers().borrow();
  EXPECT_TRUE(StationStore(**reader).find("lab-1")->has_value());
  EXPECT_EQ(**MetaStore(**reader).get("engine_version"), programVersion());
}

TEST(Bootstrap, twoProcessesNeverShareAFolder) {
  const test::TempFolder folder;
  {
    const auto store = test::openStore(folder.path());
    const auto second = Store::open(folder.path(), {.holder = "needlelab-admin"});
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
    EXPECT_NE(second.error().message.find("a server is running on " + folder.path().string()),
              std::string::npos);
    EXPECT_NE(second.error().message.find("use --server"), std::string::npos);
  }
  EXPECT_OK(Store::open(folder.path(), {.holder = "needlelab-admin"}));
  EXPECT_OK(Store::open(folder.path(), {}));
}

TEST(Bootstrap, aFolderWithoutDatabaseIsNotMadeUnlessAsked) {
  const test::TempFolder folder;
  const auto missing = Store::open(folder.path() / "typo", {.create = false});
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "typo"));
}

TEST(Bootstrap, aFolderWithoutANameIsInvalid) {
  const auto store = Store::open("", {});
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::kInvalidInput);
}

TEST(Bootstrap, aFileInPlaceOfTheFolderIsInvalid) {
  const test::TempFolder folder;
  const auto file = folder.write("file", "x");
  EXPECT_FALSE(Store::open(file, {}).ok());
}

/// Files that a start opens; certificates_test.cpp covers the server's in DIR/tls.
constexpr const char* kOpened[] = {"needlelab.db",  "needlelab.db-wal",     "needlelab.db-shm",
                                   "lock",          "needlelab.db-journal", "erasures",
                                   "audit.key",     "audit.head",           "audit.head.replaced",
                                   "pseudonym.key", "restore.pending"};

TEST(Bootstrap, anythingButAFileIsRefusedByNameWithoutWaiting) {
  namespace fs = std::filesystem;
  const auto pipe = [](const fs::path& path) { return ::mkfifo(path.c_str(), 0600) == 0; };
  const auto socket = [](const fs::path& path) { return ::mknod(path.c_str(), S_IFSOCK | 0600, 0) == 0; };
  const auto link_to_a_device = [](const fs::path& path) {
    return ::symlink("/dev/zero", path.c_str()) == 0;
  };
  const auto a_folder = [](const fs::path& path) { return fs::create_directory(path); };
  const std::pair<std::function<bool(const fs::path&)>, const char*> kinds[] = {
      {pipe, "a pipe"}, {socket, "a socket"}, {link_to_a_device, "a device"}, {a_folder, "a folder"}};
  for (const char* name : kOpened) {
    const test::TempFolder folder;
    { EXPECT_OK(Store::open(folder.path(), {})); }
    const auto path = folder.path() / name, aside = folder.path() / "aside";
    const bool was = fs::exists(path);
    if (was) fs::rename(path, aside);
    for (const auto& [make, what] : kinds) {
      SCOPED_TRACE(path.string() + " " + what);
      ASSERT_TRUE(make(path));
      const auto refused = Store::open(folder.path(), {});
      ASSERT_FALSE(refused.ok());
      EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
      EXPECT_NE(refused.error().message.find(path.string() + ": is " + what), std::string::npos)
          << refused.error().message;
      EXPECT_TRUE(fs::exists(path)) << "it stays";
      fs::remove(path);
    }
    if (was) fs::rename(aside, path);
    EXPECT_OK(Store::open(folder.path(), {}));
  }
}

TEST(Bootstrap, onlyLeftoversOfAKilledProgramAreRemovedAndReported) {
  namespace fs = std::filesystem;
  const test::TempFolder folder;
  { EXPECT_TRUE(test::openStore(folder.path())->leftoversRemoved().empty()); }
  for (const char* inner : {"backups", "elsewhere"}) fs::create_directory(folder.path() / inner);
  std::vector<fs::path> left;
  for (const char* name :
       {"needlelab.db.restoring", "needlelab.db.restoring-wal", "needlelab.db.restoring-shm",
        "needlelab.db.restoring-journal", "needlelab.db.backup-copy", "needlelab.db.backup-copy-journal",
        "audit.head.being-written-Ab12Cd", "audit.key.being-written-000000", "erasures.being-written-zzzzzz",
        "pseudonym.key.being-written-Ab12Cd", "restore.pending.being-written-Ab12Cd",
        "needlelab-20260101T023000Z.db.partial", "backups/needlelab-20260101T023000Z.db.partial-journal",
        "backups/needlelab-20260101T023000Z.nlbk.partial"})
    left.push_back(folder.write(name, "x"));
  std::sort(left.begin(), left.end());
  std::vector<fs::path> others;
  for (const char* name :
       {"needlelab.db.restoring.mine", "needlelab.db.restoring2", "audit.head.being-written-Ab12C",
        "audit.head.being-written-Ab12Cde", "audit.head.being-written-Ab_2Cd", "thesis.being-written-Ab12Cd",
        "audit.head.replaced", "thesis.nlbk.partial", "backups/thesis.db.partial",
        "backups/audit.head.being-written-Ab12Cd", "elsewhere/needlelab-20260101T023000Z.db.partial"})
    others.push_back(folder.write(name, "x"));
  const auto thesis = folder.write("thesis", "x");
  for (const char* name : {"audit.key.being-written-linked", "needlelab-20260102T023000Z.db.partial"}) {
    fs::create_symlink(thesis, folder.path() / name);
    others.push_back(folder.path() / name);
  }
  fs::create_directory(folder.path() / "audit.head.being-written-folder");
  {
    const auto in_use = FolderLock::take(folder.path(), "needlelab-admin restore");
    ASSERT_OK(in_use);
    EXPECT_FALSE(Store::open(folder.path(), {}).ok());
    for (const auto& path : left) EXPECT_TRUE(fs::exists(path)) << path << ": somebody may be writing it";
  }
  EXPECT_EQ(test::openStore(folder.path())->leftoversRemoved(), left);
  for (const auto& path : left) EXPECT_FALSE(fs::exists(path)) << path;
  for (const auto& path : others) EXPECT_TRUE(fs::exists(fs::symlink_status(path))) << path;
  EXPECT_TRUE(fs::exists(thesis));
  EXPECT_TRUE(fs::exists(folder.path() / "audit.head.being-written-folder"));
  EXPECT_TRUE(test::openStore(folder.path())->leftoversRemoved().empty());
}

TEST(Bootstrap, aFolderOfBackupsThatIsALinkIsNotFollowed) {
  namespace fs = std::filesystem;
  const test::TempFolder folder, elsewhere;
  const auto partial = elsewhere.write("needlelab-20260101T023000Z.db.partial", "x");
  fs::create_directory_symlink(elsewhere.path(), folder.path() / "backups");
  EXPECT_TRUE(test::openStore(folder.path())->leftoversRemoved().empty());
  EXPECT_TRUE(fs::exists(partial));
}

TEST(Bootstrap, aNewerDatabaseAndAnEmptyFileAreTreatedRightly) {
  const test::TempFolder folder;
  folder.write("needlelab.db", "");  // a crash right after the file was created
  { EXPECT_OK(Store::open(folder.path(), {})); }
  {
    auto connection = Connection::open(folder.path() / "needlelab.db", {.mode = Connection::Mode::kWriter});
    ASSERT_OK(connection->script("PRAGMA user_version=999"));
  }
  const auto newer = Store::open(folder.path(), {});
  ASSERT_FALSE(newer.ok());
  EXPECT_EQ(newer.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(newer.error().message.find("version 999"), std::string::npos) << newer.error().message;
}

}  // namespace
}  // namespace needlelab
