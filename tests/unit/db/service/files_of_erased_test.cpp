// What an erasure says of backups and other databases that lie aside, also of those that somebody made to do
// harm; and what a restore of one of them erases anew.
#include "db/service/files_of_erased.h"

#include <gmock/gmock.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "db/erasure_list.h"
#include "tests/unit/db/hot_journal.h"
#include "tests/unit/db/service/records_fixture.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class FilesOfErased : public test::RecordsTest {
 protected:
  void SetUp() override {
    addStation();
    addPerson("ada", pb::ADMINISTRATOR);
    fs::create_directory(kept);
  }
  fs::path backup(const std::string& name) {
    pb::Request request;
    request.mutable_backup()->set_path((kept / name).string());
    get(admin, request);
    return kept / name;
  }
  std::vector<std::string> filesOf(const std::string& name) {
    const auto erasure = get(admin, erase(name)).erasure();
    text = erasure.text();
    return {erasure.files().begin(), erasure.files().end()};
  }
  void give(const Uuid& session, const std::string& who) {
    pb::Request request;
    request.mutable_assign_session()->set_session_id(test::bytesOfId(session));
    request.mutable_assign_session()->set_trainee(who);
    request.mutable_assign_session()->set_reason("practised before the account");
    get(manager, request);
  }
  std::uint64_t chunks(const Uuid& id) {
    pb::Request show;
    show.mutable_get_session()->set_session_id(test::bytesOfId(id));
    return get(instructor, show).session().chunks();
  }
  std::size_t restore(const fs::path& from) {
    store.reset();
    for (const char* suffix : {"-wal", "-shm"}) fs::remove(database.string() + suffix);
    fs::copy_file(from, database, fs::copy_options::overwrite_existing);
    store = test::openStore(folder.path() / "data");
    return store->erasuresRepeated();
  }
  std::string everything() {
    std::string all;
    EXPECT_OK(change([&](Connection& c) -> Status {
      all = test::dump(c);
      return {};
    }));
    return all;
  }
  const fs::path kept = folder.path() / "kept";
  const fs::path database = folder.path() / "data" / "needlelab.db";
  std::string text;
};

TEST_F(FilesOfErased, aJournalBesideAFileDeletesNothing) {
  addNamed("tom", "Tom Alt");
  addNamed("tim", "");
  const auto one = backup("one.db");
  const auto journal = test::writeHotJournal(one, database);
  EXPECT_THAT(filesOf("tom"), UnorderedElementsAre(one.string(), journal.string()));
  EXPECT_TRUE(fs::exists(database));
  EXPECT_TRUE(fs::exists(journal));
  EXPECT_THAT(filesOf("tim"), UnorderedElementsAre(one.string(), journal.string()));
}

TEST_F(FilesOfErased, aFileThatNeverEndsIsListedAndTheErasureIsComplete) {
  addNamed("tom", "");
  const Uuid of_tom = closedSession("tom", 1, "");
  const auto one = backup("one.db");
  const auto hostile = kept / "x.db";
  {
    auto made =
        test::TestDb::must(Connection::open(hostile, {.mode = Connection::Mode::kWriter, .create = true}));
    ASSERT_OK(
        made.script("CREATE VIEW people AS WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
                    " SELECT i AS name FROM n WHERE i < 0"));
    ASSERT_OK(made.script("PRAGMA journal_mode=DELETE"));
  }
  EXPECT_THAT(filesOf("tom"), UnorderedElementsAre(one.string(), hostile.string()));
  EXPECT_EQ(chunks(of_tom), 0u);
}

/// Puts pages into the file through which a scan of `table` comes to the same leaf without end: each page of
/// ten refers to the next one from all its places.
void makeEndless(const fs::path& file, const std::string& table) {
  std::uint32_t root = 0;
  {
    auto opened = test::TestDb::must(Connection::open(file, {}));
    auto row = opened.query("SELECT rootpage FROM sqlite_schema WHERE name = ?", table);
    ASSERT_TRUE(*row.step());
    root = row.natural32(0);
  }
  for (const char* suffix : {"-wal", "-shm"}) fs::remove(file.string() + suffix);
  constexpr std::size_t kPage_bytes = 4096;
  std::string bytes = *readWholeFile(file);
  const auto pages = static_cast<std::uint32_t>(bytes.size() / kPage_bytes);
  const auto put = [](std::string& in, std::size_t at, std::uint32_t value) {
    for (int i = 0; i < 4; ++i)
      in[at + static_cast<std::size_t>(i)] = static_cast<char>(value >> (24 - 8 * i));
  };
  std::string page = bytes.substr((root - 1) * kPage_bytes, kPage_bytes);
  ASSERT_EQ(page[0], 0x05) << "an interior page: the table has more rows than a page takes";
  const auto byteAt = [&](std::size_t at) { return static_cast<unsigned char>(page[at]); };
  const std::size_t cells = byteAt(3) * 256u + byteAt(4);
  const auto pointTo = [&](std::uint32_t child) {
    put(page, 8, child);
    for (std::size_t i = 0; i < cells; ++i) put(page, byteAt(12 + 2 * i) * 256u + byteAt(13 + 2 * i), child);
  };
  std::uint32_t last_leaf = 0;
  for (std::size_t i = 8; i < 12; ++i) last_leaf = last_leaf << 8 | byteAt(i);
  constexpr std::uint32_t kLevels = 10;
  pointTo(pages + 1);
  bytes.replace((root - 1) * kPage_bytes, kPage_bytes, page);
  for (std::uint32_t i = 1; i <= kLevels; ++i) {
    pointTo(i < kLevels ? pages + i + 1 : last_leaf);
    bytes += page;
  }
  put(bytes, 28, pages + kLevels);
  std::ofstream(file, std::ios::binary) << bytes;
}

TEST_F(FilesOfErased, aTreeOfPagesWithoutEndIsGivenUpInTime) {
  ASSERT_OK(change([](Connection& c) {
    return c.run(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 5000)"
        " INSERT INTO audit (unix_ns, who, action, subject, detail)"
        " SELECT 1, 'ina', 'consent', 'ben', 'given' FROM n");
  }));
  const auto one = backup("one.db");
  ErasedRows erased;
  erased.names.name = "nobody";
  EXPECT_FALSE(namesErased(one, erased, nullptr));
  makeEndless(one, "audit");
  const auto began = std::chrono::steady_clock::now();
  EXPECT_TRUE(namesErased(one, erased, nullptr, std::chrono::milliseconds(300))) << "nobody can tell";
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(30));
}

TEST_F(FilesOfErased, whatIsLeftWhenTheTimeIsUpIsListedUnread) {
  backup("one.db");
  ErasedRows erased;
  erased.names.name = "nobody";
  EXPECT_THAT(filesThatName(folder.path() / "data", kept, erased, nullptr), IsEmpty());
  EXPECT_THAT(filesThatName(folder.path() / "data", kept, erased, nullptr, std::chrono::seconds(0)),
              ElementsAre(kept / "one.db"));
}

TEST_F(FilesOfErased, areThoseThatHaveThePersonUnderAnotherName) {
  const auto nobody = backup("nobody.db");
  const Uuid of_anna = closedSession("Anna Ohm", 1, "");
  const auto before = backup("before.db");
  addNamed("anna.ohm", "Anna Ohm");
  give(of_anna, "anna.ohm");
  const auto after = backup("after.db");
  EXPECT_THAT(filesOf("anna.ohm"), UnorderedElementsAre(before.string(), after.string()));
  EXPECT_EQ(chunks(of_anna), 0u);
  EXPECT_THAT(text, HasSubstr("not under one that stations gave"));
  EXPECT_GE(restore(after), 1u);
  EXPECT_EQ(chunks(of_anna), 0u);
  EXPECT_THAT(everything(), testing::Not(HasSubstr("Anna Ohm")));
  EXPECT_TRUE(store->service().erasuresToRepeat()->empty());
  // the name is free again, also after a start
  restore(nobody);
  const Uuid of_another = closedSession("Anna Ohm", 2, "");
  store.reset();
  store = test::openStore(folder.path() / "data");
  EXPECT_EQ(chunks(of_another), 3u);
}

// The list knows a person by the account's name alone: by a given name a restore, or a start after a kill,
// took a namesake's sessions.
TEST_F(FilesOfErased, aGivenNameIsNotOnTheListButInTheFiles) {
  addNamed("anna.ohm", "");
  const Uuid hers = closedSession("Anna", 1, ""), of_another = closedSession("Anna", 2, "");
  const auto before = backup("before.db");
  give(hers, "anna.ohm");
  EXPECT_THAT(filesOf("anna.ohm"), ElementsAre(before.string()));
  EXPECT_EQ(readErasures(folder.path() / "data")->size(), 1u);
  restore(before);
  EXPECT_EQ(chunks(of_another), 3u) << "another person's";
}

TEST_F(FilesOfErased, areThoseWithARemarkOrAPieceOfAnImportOnly) {
  addNamed("ben", "");
  closedSession("ben", 1, "as good as carla, says Carla Zwick");
  const auto remark = backup("remark.db");
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(c.run("DELETE FROM annotations"));
    return c.run("INSERT INTO import_pieces VALUES ('i', 0, '{\"name\":\"carla\"}', 'ada', 1)");
  }));
  const auto piece = backup("piece.db");
  ASSERT_OK(change([](Connection& c) { return c.run("DELETE FROM import_pieces"); }));
  backup("none.db");
  addNamed("carla", "Carla Zwick");
  EXPECT_THAT(filesOf("carla"), UnorderedElementsAre(remark.string(), piece.string()));
}

TEST_F(FilesOfErased, aListBesideTheBackupsThatCannotBeWrittenIsSaid) {
  addNamed("tom", "");
  backup("one.db");
  fs::remove(kept / kErasuresCopy);
  fs::create_directories(kept / kErasuresCopy / "in the way");
  filesOf("tom");
  EXPECT_THAT(text, HasSubstr("the list of erasures beside the backups could not be written"));
  EXPECT_THAT(text, HasSubstr((kept / kErasuresCopy).string()));
}

}  // namespace
}  // namespace needlelab
