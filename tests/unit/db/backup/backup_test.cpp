#include "db/backup/backup.h"

#include <sys/stat.h>

#include <filesystem>
#include <vector>

#include "db/backup/check.h"
#include "db/store/schema.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

class BackupTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK(store.open(test::describe(id), 1));
    for (std::uint64_t seq = 0; seq < 5; ++seq) ASSERT_OK(store.append(id, seq, test::chunkOf(seq)));
  }
  test::TestDb db;
  SessionStore store{db.writer};
  Connection reader = db.reader();
  const Uuid id = makeUuidV7();
  const std::filesystem::path target = db.folder.path() / "copy.db";
};

TEST_F(BackupTest, theCopyIsWholeAndPrivateAndOneFile) {
  const auto result = backupTo(reader, target);
  ASSERT_OK(result);
  EXPECT_EQ(result->chunks_verified, 5u);
  EXPECT_EQ(result->bytes, std::filesystem::file_size(target));
  struct stat info {};
  ASSERT_EQ(::stat(target.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0600u);
  for (const char* suffix : {"-wal", "-shm", "-journal", ".partial"}) {
    EXPECT_FALSE(std::filesystem::exists(target.string() + suffix)) << suffix;
  }
  auto copy = test::TestDb::must(Connection::open(target, {}));
  EXPECT_EQ(test::dump(copy), test::dump(reader));
}

TEST_F(BackupTest, theWatermarkRisesToWhatTheCopyHolds) {
  const auto result = backupTo(reader, target);
  ASSERT_OK(result);
  // Two more chunks arrive after the copy: they are not safe.
  for (std::uint64_t seq = 5; seq < 7; ++seq) ASSERT_OK(store.append(id, seq, test::chunkOf(seq)));
  ASSERT_OK(recordBackup(db.writer, *result, target, 1234));
  EXPECT_EQ(*store.safeSeqs(id), 4u) << "of an open session all but the last";
  EXPECT_EQ(**MetaStore(db.writer).get("backup_path"), target.string());
  const auto next = backupTo(reader, db.folder.path() / "copy2.db");
  ASSERT_OK(next);
  ASSERT_OK(recordBackup(db.writer, *next, target, 1235));
  EXPECT_EQ(*store.safeSeqs(id), 6u);
}

TEST_F(BackupTest, aSessionClosedDuringTheCopyIsNotSafeYet) {
  const auto result = backupTo(reader, target);
  ASSERT_OK(result);
  // Closed after the copy but before the backup is recorded: the copy has all chunks, but not the hash.
  ASSERT_OK(store.close(test::closeOf(id, 5), 9));
  ASSERT_OK(recordBackup(db.writer, *result, target, 1234));
  EXPECT_LT(*store.safeSeqs(id), 5u) << "its station would empty its spool";
  const auto next = backupTo(reader, db.folder.path() / "copy2.db");
  ASSERT_OK(next);
  ASSERT_OK(recordBackup(db.writer, *next, target, 1235));
  EXPECT_EQ(*store.safeSeqs(id), 5u);
}

TEST_F(BackupTest, writersContinueAndTheCopyIsOneInstant) {
  // The copy is one snapshot: a commit during the copy does not change it.
  ASSERT_OK(reader.script("BEGIN; SELECT count(*) FROM sessions"));
  ASSERT_OK(store.append(id, 5, test::chunkOf(5)));
  ASSERT_OK(reader.script("COMMIT"));
  EXPECT_EQ(backupTo(reader, target)->chunks_verified, 6u);
}

TEST_F(BackupTest, nothingIsEverOverwritten) {
  ASSERT_OK(backupTo(reader, target));
  const auto again = backupTo(reader, target);
  ASSERT_FALSE(again.ok());
  EXPECT_EQ(again.error().code, ErrorCode::kAlreadyExists);
  EXPECT_EQ(backupTo(reader, db.path).error().code, ErrorCode::kAlreadyExists);
}

TEST_F(BackupTest, wrongPathsAreInvalidInput) {
  EXPECT_EQ(backupTo(reader, "copy.db").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(backupTo(reader, "").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(backupTo(reader, db.folder.path() / "none" / "copy.db").error().code, ErrorCode::kInvalidInput);
}

TEST_F(BackupTest, aDamagedDatabaseGivesNoBackup) {
  ASSERT_OK(db.writer.script("UPDATE chunks SET crc = crc + 1 WHERE seq = 3"));
  const auto refused = backupTo(reader, target);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_FALSE(std::filesystem::exists(target));
  EXPECT_FALSE(std::filesystem::exists(target.string() + ".partial"));
}

TEST_F(BackupTest, checkFindsDamageOfPages) {
  EXPECT_TRUE(checkDatabase(reader)->ok());
  const auto result = backupTo(reader, target);
  ASSERT_OK(result);
  // damages each page in turn, in a copy of the copy; every damage to used bytes is found
  std::ifstream in(target, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  std::size_t found = 0, pages = good.size() / 4096;
  for (std::size_t page = 1; page < pages; ++page) {
    std::string bad = good;
    // the header and the cell pointers of a page
    for (std::size_t i = 0; i < 12; ++i)
      bad[page * 4096 + i] = static_cast<char>(bad[page * 4096 + i] ^ 0x55);
    const auto path = db.folder.write("bad.db", bad);
    auto opened = Connection::open(path, {});
    if (!opened) {
      ++found;
      continue;
    }
    const auto check = checkDatabase(*opened);
    if (!check.ok() || !check->ok()) ++found;
  }
  EXPECT_EQ(found, pages - 1);
}

TEST(BackupLog, aBackupEndsThatLetsTheLogGrowAboveItsBound) {
  test::TestDb db;
  // more pages than one step of the copy
  ASSERT_OK(db.writer.script("BEGIN"));
  for (int i = 0; i < 6'000; ++i) {
    ASSERT_OK(db.writer.run("INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1,'','','',?)",
                            std::string(4'000, 'x')));
  }
  ASSERT_OK(db.writer.script("COMMIT"));
  auto reader = db.reader();
  const auto target = db.folder.path() / "copy.db";
  const auto given_up = backupTo(reader, target, nullptr, 1'000'000);
  ASSERT_FALSE(given_up.ok());
  EXPECT_EQ(given_up.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(given_up.error().message.find("the log beside the database grew to"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(target));
  EXPECT_FALSE(std::filesystem::exists(target.string() + ".partial"));
  EXPECT_OK(backupTo(reader, target));
}

}  // namespace
}  // namespace needlelab
