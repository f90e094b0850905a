// A lab whose database is on PostgreSQL: which folder may serve which database.
#include "db/store/store_address.h"

#include <gmock/gmock.h>

#include <fstream>

#include "common/base/files/files.h"
#include "db/people/people.h"
#include "db/service/start/bootstrap.h"
#include "db/store/schema.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

class StoreOnPostgres : public testing::Test {
 protected:
  Result<std::unique_ptr<Store>> open(const std::string& name, const std::string& at,
                                      Durability least = Durability::kNothing) {
    Store::Options options;
    options.store_url = at;
    options.min_durability = least;
    return Store::open(folder.path() / name, options);
  }
  /// The message of a start that must be refused as invalid input.
  std::string refusal(const std::string& name, const std::string& at) {
    auto store = open(name, at);
    if (store) return "it was opened";
    EXPECT_EQ(store.error().code, ErrorCode::kInvalidInput) << store.error().message;
    return store.error().message;
  }
  void write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories((folder.path() / name).parent_path());
    std::ofstream(folder.path() / name) << text;
  }
  static Result<std::vector<std::string>> people(Store& store) {
    ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
    return (*reader).prepare("SELECT name FROM accounts ORDER BY name").all(firstText);
  }

  TempFolder folder;
  PostgresBelow dropped_at_end{folder.path()};
  const std::string url = postgresUrlOf(folder.path() / "one");
};

TEST_F(StoreOnPostgres, theFolderRemembersItsDatabase) {
  {
    const auto store = open("lab", url);
    ASSERT_OK(store);
    ASSERT_OK((*store)->writer().run([](Connection& writer) {
      return PeopleStore(writer).add({"anna", pb::TRAINEE, "", false, 1});
    }));
  }
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "lab" / "needlelab.db"));
  const auto file = readStoreFile(folder.path() / "lab");
  ASSERT_OK(file);
  ASSERT_TRUE(file->has_value());
  EXPECT_EQ((*file)->url, url);
  const auto store = open("lab", "");
  ASSERT_OK(store);
  const auto names = people(**store);
  ASSERT_OK(names);
  EXPECT_THAT(*names, testing::ElementsAre("anna"));
}

TEST_F(StoreOnPostgres, anAddressThatChangesIsRememberedWhereTheLabIsTheSame) {
  ASSERT_OK(open("lab", url));
  const std::string other = url + " application_name=moved";
  ASSERT_OK(open("lab", other));
  EXPECT_EQ((*readStoreFile(folder.path() / "lab"))->url, other);
}

TEST_F(StoreOnPostgres, oneServerAtATime) {
  const auto first = open("lab", url);
  ASSERT_OK(first);
  std::filesystem::create_directory(folder.path() / "copy");
  std::filesystem::copy_file(folder.path() / "lab" / kStoreFile, folder.path() / "copy" / kStoreFile);
  const auto second = open("copy", "");
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().message, HasSubstr("another needlelab-server"));
}

TEST_F(StoreOnPostgres, anotherLabsDatabaseIsRefused) {
  ASSERT_OK(open("lab", url));
  const std::string other = postgresUrlOf(folder.path() / "two");
  ASSERT_OK(open("other", other));
  EXPECT_THAT(refusal("lab", other), HasSubstr("check the address"));
  EXPECT_EQ((*readStoreFile(folder.path() / "lab"))->url, url) << "nothing was changed";
  // a folder without the lab's keys
  EXPECT_THAT(refusal("new", url), HasSubstr("keys are in another folder"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "new" / kStoreFile));
  // an empty database instead of the lab's
  EXPECT_THAT(refusal("lab", postgresUrlOf(folder.path() / "three")), HasSubstr("is new"));
}

TEST_F(StoreOnPostgres, aFolderKeepsItsOwnDatabase) {
  ASSERT_OK(open("lab", ""));
  EXPECT_THAT(refusal("lab", url), HasSubstr("has a database of its own"));
  const auto store = open("lab", "");
  ASSERT_OK(store);
  EXPECT_NE((*(*store)->readers().borrow())->sqlite(), nullptr);
}

TEST_F(StoreOnPostgres, wrongAddressesAreNamedWithoutTheirPassword) {
  for (const auto& [wrong, words] : {std::pair{"postgresql://anna:hush@127.0.0.1:1/lab", "has a password"},
                                     std::pair{"mysql://lab", "is not a PostgreSQL address"}}) {
    const std::string message = refusal("new", wrong);
    EXPECT_THAT(message, HasSubstr(words));
    EXPECT_THAT(message, testing::Not(HasSubstr("hush")));
  }
  EXPECT_THAT(refusal("new", url + "-none"), HasSubstr("does not exist"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "new" / kStoreFile));
}

TEST_F(StoreOnPostgres, aStoreFileOfSomethingElseIsNamedByItsLine) {
  const std::pair<const char*, const char*> cases[] = {
      {"url = x\nlab = 1\nurl = y\n", "line 3: is not understood"},
      {"# nothing\n", "url is missing"},
      {"url = x\n", "lab is missing"},
      {"{}", "line 1: is not understood"}};
  for (const auto& [text, words] : cases) {
    write("lab/store", text);
    EXPECT_THAT(refusal("lab", ""), HasSubstr(words)) << text;
  }
}

TEST_F(StoreOnPostgres, aStoreLessDurableThanRequiredIsRefused) {
  const auto store = open("lab", url, Durability::kDiskLoss);
  ASSERT_FALSE(store.ok());
  EXPECT_EQ(store.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(store.error().message, HasSubstr("--durability"));
  const auto sqlite = open("own", "", Durability::kDiskLoss);
  ASSERT_FALSE(sqlite.ok());
  EXPECT_EQ(sqlite.error().code, ErrorCode::kInvalidInput);
  ASSERT_OK(open("own", "", Durability::kPowerCut));
}

}  // namespace
}  // namespace needlelab::test
