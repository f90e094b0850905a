// Files that somebody else may have written: what lies beside them, what they say, and how long they take.
#include "db/foreign_database.h"

#include <gmock/gmock.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>

#include "db/backup.h"
#include "tests/unit/db/hot_journal.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ForeignDatabase : public testing::Test {
 protected:
  void SetUp() override {
    auto reader = db.reader();
    ASSERT_OK(backupTo(reader, path));
  }
  void change(const std::string& sql) {
    auto writer = test::TestDb::must(Connection::open(path, {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writer.script(sql));
    ASSERT_OK(writer.script("PRAGMA journal_mode=DELETE"));
  }
  test::TestDb db;
  const test::TempFolder place;
  const fs::path path = place.path() / "backup 50% #1?.db";
  const fs::path victim = place.write("victim", "of somebody else");
};

TEST_F(ForeignDatabase, isReadAsItIsUnderAnyName) {
  auto opened = openForeign(path);
  ASSERT_OK(opened);
  const auto station = opened->prepare("SELECT name FROM stations").first(firstText);
  ASSERT_OK(station);
  EXPECT_EQ(*station, "station-1");
  EXPECT_FALSE(opened->run("DELETE FROM stations").ok());
  EXPECT_EQ(std::distance(fs::directory_iterator(place.path()), fs::directory_iterator()), 2)
      << "nothing was made beside it";
}

TEST_F(ForeignDatabase, isReadAlsoInAFolderThatALinkNames) {
  const test::TempFolder other;
  fs::create_directory_symlink(place.path(), other.path() / "link");
  EXPECT_OK(openForeign(other.path() / "link" / path.filename()));
}

TEST_F(ForeignDatabase, withAJournalIsRefusedAndNoFileIsDeleted) {
  const auto copy = place.path() / "control.db";
  fs::copy_file(path, copy);
  const auto of_copy = place.write("victim of the control", "x");
  test::writeHotJournal(copy, of_copy);
  auto own = Connection::open(copy, {});
  if (own.ok()) (void)own->prepare("SELECT count(*) FROM sessions").first(firstText);
  ASSERT_FALSE(fs::exists(of_copy)) << "the journal is hot, and a database of one's own obeys it";

  const auto journal = test::writeHotJournal(path, victim);
  const auto refused = openForeign(path);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.error().message, HasSubstr(journal.string()));
  // one that comes after the look
  {
    auto opened = Connection::open(path, {.mode = Connection::Mode::kForeign});
    ASSERT_OK(opened);
    EXPECT_OK(opened->prepare("SELECT name FROM stations").first(firstText));
  }
  EXPECT_TRUE(fs::exists(victim));
  EXPECT_TRUE(fs::exists(journal));
}

TEST_F(ForeignDatabase, withALogIsRefusedUnlessTheLogIsEmpty) {
  const fs::path log = path.string() + "-wal";
  std::ofstream(log).close();
  EXPECT_OK(openForeign(path));
  std::ofstream(log) << "frames";
  EXPECT_EQ(openForeign(path).error().code, ErrorCode::kUnavailable);
}

TEST_F(ForeignDatabase, thatIsALinkOrAFolderOrNoneIsRefused) {
  fs::create_symlink(path, place.path() / "link.db");
  EXPECT_EQ(openForeign(place.path() / "link.db").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(openForeign(place.path()).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(openForeign(place.path() / "none.db").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(openForeign(victim).error().code, ErrorCode::kCorrupt);
}

TEST_F(ForeignDatabase, withAViewOfItsOwnIsRefusedBeforeAnythingIsAsked) {
  change(
      "CREATE VIEW endless AS WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
      " SELECT i FROM n");
  const auto refused = openForeign(path);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(refused.error().message, HasSubstr("view 'endless'"));
}

TEST_F(ForeignDatabase, endsAReadThatTakesTooLong) {
  const std::string endless =
      "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n WHERE i < 0";
  auto late = openForeign(path, nullptr, std::chrono::milliseconds(200));
  ASSERT_OK(late);
  const auto given_up = late->prepare(endless).first(firstText);
  ASSERT_FALSE(given_up.ok());
  EXPECT_EQ(given_up.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(given_up.error().message, HasSubstr("takes too long"));

  std::atomic<bool> ends = false;
  auto cancelled = openForeign(path, &ends);
  ASSERT_OK(cancelled);
  ends = true;
  EXPECT_FALSE(cancelled->prepare(endless).first(firstText).ok());
}

TEST(BackupBeside, noFileInTheBackupsFolderIsOpenedAsADatabase) {
  test::TestDb db;
  const test::TempFolder elsewhere;
  const auto target = elsewhere.path() / "monday.db";
  // as a loop of somebody else does, who may write there
  auto reader = db.reader();
  const auto other_disk = [](const char* from, const char* to) {
    const fs::path partial(to);
    std::ofstream(partial.string() + "-journal") << "of somebody else " << from;
    errno = EXDEV;
    return -1;
  };
  const auto result =
      backupTo(reader, target, nullptr, kMostLogBytesOfBackup, kRoomBesidePlainCopy, other_disk);
  ASSERT_OK(result);
  EXPECT_EQ(result->bytes, fs::file_size(target));
  EXPECT_OK(openForeign(target));
  EXPECT_FALSE(fs::exists(plainCopyBeside(db.path)));
  EXPECT_FALSE(fs::exists(target.string() + ".partial"));
  EXPECT_EQ(backupTo(reader, elsewhere.path() / "tuesday.db", nullptr, kMostLogBytesOfBackup,
                     std::uint64_t{1} << 60)
                .error()
                .code,
            ErrorCode::kNoRoom);
}

}  // namespace
}  // namespace needlelab
