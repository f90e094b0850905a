#include "db/service/bootstrap.h"

#include <sys/stat.h>

#include "db/documents.h"
#include "db/schema.h"
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
  EXPECT_EQ(static_cast<std::size_t>(outcome.reply.profiles().profiles_size()), embeddedSamples().size() - 2);
  pb::Request curricula;
  curricula.mutable_list_curricula();
  EXPECT_EQ(store->service().execute(kAdmin, curricula).reply.curricula().curricula_size(), 2);
}

TEST(Bootstrap, aSecondStartKeepsWhatIsThere) {
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
  EXPECT_EQ(**MetaStore(**reader).get("engine_version"), NEEDLELAB_VERSION);
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

TEST(Bootstrap, aNewerDatabaseAndAnEmptyFileAreTreatedRightly) {
  const test::TempFolder folder;
  folder.write("needlelab.db", "");  // a crash right after the file was made
  { EXPECT_OK(Store::open(folder.path(), {})); }
  {
    auto connection = Connection::open(folder.path() / "needlelab.db", {.mode = Connection::Mode::kWriter});
    ASSERT_OK(connection->script("PRAGMA user_version=999"));
  }
  const auto newer = Store::open(folder.path(), {});
  ASSERT_FALSE(newer.ok());
  EXPECT_EQ(newer.error().code, ErrorCode::kVersion);
}

}  // namespace
}  // namespace needlelab
