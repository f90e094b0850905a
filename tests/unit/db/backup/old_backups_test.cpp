#include "db/backup/old_backups.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "db/backup/backup.h"
#include "db/backup/encrypted_backup.h"
#include "tests/support/store/backup_start.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

class OldBackupsTest : public testing::Test {
 protected:
  /// A file with the first bytes of such a backup.
  fs::path backup(const std::string& name) const { return folder.write(name, test::startOfBackup(name)); }
  [[nodiscard]] fs::path at(const char* name) const { return folder.path() / name; }
  const test::TempFolder folder;
};

TEST_F(OldBackupsTest, namesFromAClockThatWasAheadNeverCostTheNewBackup) {
  const auto now = backup("needlelab-20260105T023000Z.db");
  for (const char* name : {"needlelab-20260103T023000Z.db", "needlelab-20260104T023000Z.db",
                           "needlelab-20300101T023000Z.db", "needlelab-20300102T023000Z.db"})
    backup(name);
  const auto first = removeOldBackups(now, 2);
  ASSERT_OK(first);
  EXPECT_EQ(first->removed, std::vector{at("needlelab-20260103T023000Z.db")});
  EXPECT_EQ(first->later.size(), 2u) << "named, neither removed nor counted";
  EXPECT_THAT(first->remainingText(), HasSubstr("2 backups are named by a later time"));
  ASSERT_OK(removeOldBackups(now, 1));
  ASSERT_OK(removeOldBackups(now, 0));
  EXPECT_TRUE(fs::exists(now));
  EXPECT_FALSE(fs::exists(at("needlelab-20260104T023000Z.db")));
  EXPECT_TRUE(fs::exists(at("needlelab-20300101T023000Z.db")));
}

TEST_F(OldBackupsTest, countsBothKinds) {
  const auto now = backup("needlelab-20260105T023000Z.nlbk");
  for (const char* name :
       {"needlelab-20260101T023000Z.nlbk", "needlelab-20260102T023000Z.db", "needlelab-20260103T023000Z.nlbk",
        "needlelab-20260104T023000Z.db", "needlelab-20260104T023000Z.txt", "needlelab-20300101T023000Z.nlbk"})
    backup(name);
  backup("needlelab.db");
  fs::create_directory(at("needlelab-20200101T000000Z.db"));
  const auto old = removeOldBackups(now, 3);
  ASSERT_OK(old);
  EXPECT_EQ(old->removed,
            (std::vector{at("needlelab-20260101T023000Z.nlbk"), at("needlelab-20260102T023000Z.db")}));
  EXPECT_EQ(old->later, std::vector{at("needlelab-20300101T023000Z.nlbk")});
  for (const char* stays :
       {"needlelab-20260104T023000Z.txt", "needlelab.db", "needlelab-20200101T000000Z.db"})
    EXPECT_TRUE(fs::exists(at(stays))) << stays;
  EXPECT_EQ(backupName(1'767'321'000'000'000'000, kEncryptedEnding), "needlelab-20260102T023000Z.nlbk");
}

TEST_F(OldBackupsTest, whatABackupWritesIsCounted) {
  test::TestDb db;
  auto reader = db.reader();
  const auto key = BackupKey::make(at("key"));
  ASSERT_OK(key);
  const auto plain = at("needlelab-20260101T023000Z.db"), encrypted = at("needlelab-20260102T023000Z.nlbk");
  ASSERT_OK(backupTo(reader, plain));
  ASSERT_OK(encryptedBackupTo(reader, encrypted, *key));
  const auto old = removeOldBackups(backup("needlelab-20260105T023000Z.db"), 1);
  ASSERT_OK(old);
  EXPECT_EQ(old->removed, (std::vector{plain, encrypted}));
  EXPECT_EQ(old->remainingText(), "");
}

TEST_F(OldBackupsTest, filesWithOnlyABackupsNameAreIgnoredAndStay) {
  const auto now = backup("needlelab-20260105T023000Z.db");
  const std::vector<fs::path> real = {backup("needlelab-20260101T023000Z.db"),
                                      backup("needlelab-20260102T023000Z.nlbk")};
  std::string other_program = test::startOfBackup("x.db");
  other_program[68] = 'm';
  const std::vector<fs::path> fakes = {folder.write("needlelab-20000101T000000Z.db", ""),
                                       folder.write("needlelab-20260105T022957Z.db", "x"),
                                       folder.write("needlelab-20260105T022958Z.db", other_program),
                                       folder.write("needlelab-20260105T022959Z.nlbk", "NLBACKU")};
  fs::create_symlink(real[0], at("needlelab-20260105T022956Z.db"));
  ASSERT_EQ(::mkfifo(at("needlelab-20260105T022955Z.db").c_str(), 0600), 0);
  const auto kept = removeOldBackups(now, 3);
  ASSERT_OK(kept);
  EXPECT_THAT(kept->removed, IsEmpty());
  EXPECT_EQ(kept->others, fakes);
  EXPECT_THAT(kept->remainingText(), HasSubstr("4 files are named as backups"));
  EXPECT_THAT(kept->remainingText(), HasSubstr("needlelab-20000101T000000Z.db"));
  const auto old = removeOldBackups(now, 1);
  ASSERT_OK(old);
  EXPECT_EQ(old->removed, real);
  for (const auto& path : fakes) EXPECT_TRUE(fs::exists(path)) << path;
}

TEST_F(OldBackupsTest, filesOfAnotherUserAreNeitherCountedNorRemoved) {
  const auto now = backup("needlelab-20260105T023000Z.db");
  const auto old = backup("needlelab-20260101T023000Z.db"),
             partial = folder.write("needlelab-20260102T023000Z.db.partial", "x");
  fs::last_write_time(partial, fs::last_write_time(now) - std::chrono::hours(25));
  BackupRemover by;
  by.own = ::geteuid() + 1;
  const auto left = removeOldBackups(now, 1, by);
  ASSERT_OK(left);
  EXPECT_THAT(left->removed, IsEmpty());
  EXPECT_EQ(left->others, (std::vector{old, partial}));
  EXPECT_EQ(removeOldBackups(now, 1)->removed, (std::vector{old, partial})) << "the owner of the new one";
  EXPECT_EQ(removeOldBackups(at("needlelab-20270101T023000Z.db"), 1).error().code, ErrorCode::kFailed)
      << "no one knows whose";
}

TEST_F(OldBackupsTest, oneThatCannotBeRemovedIsNamedAndTheOthersGo) {
  const auto now = backup("needlelab-20260105T023000Z.db");
  std::vector<fs::path> old;
  for (const char* name : {"needlelab-20260101T023000Z.db", "needlelab-20260102T023000Z.db",
                           "needlelab-20260103T023000Z.nlbk", "needlelab-20260104T023000Z.db"})
    old.push_back(backup(name));
  BackupRemover by;
  by.unlink = [](const char* path) {
    if (std::string_view(path).find("T023000Z.nlbk") == std::string_view::npos &&
        std::string_view(path).find("20260101") == std::string_view::npos)
      return ::unlink(path);
    errno = EPERM;
    return -1;
  };
  const auto result = removeOldBackups(now, 1, by);
  ASSERT_OK(result);
  EXPECT_EQ(result->removed, (std::vector{old[1], old[3]}));
  EXPECT_EQ(result->failed, (std::vector{old[0], old[2]}));
  EXPECT_THAT(result->why, HasSubstr(old[0].string() + ": cannot remove this old backup"));
  EXPECT_THAT(result->remainingText(),
              HasSubstr("2 old backups could not be removed, such as " + old[0].string()));
  for (const auto& path : old) EXPECT_EQ(fs::exists(path), path == old[0] || path == old[2]) << path;
}

TEST_F(OldBackupsTest, aLinkIsNoUnfinishedCopy) {
  const auto copy = folder.write("needlelab-20260101T023000Z.nlbk.partial", "x");
  fs::create_symlink(folder.write("thesis", "x"), at("needlelab-20260102T023000Z.db.partial"));
  fs::create_directory(at("needlelab-20260103T023000Z.db.partial"));
  EXPECT_EQ(partialsIn(folder.path(), fs::file_time_type::max()), std::vector{copy});
  EXPECT_EQ(partialsIn(folder.path(), fs::last_write_time(copy)), std::vector<fs::path>());
  EXPECT_EQ(partialsIn(at("none"), fs::file_time_type::max()), std::vector<fs::path>());
}

TEST_F(OldBackupsTest, unfinishedCopiesOfADayBeforeGoWithTheOldBackups) {
  const auto now = backup("needlelab-20260105T023000Z.db");
  std::vector<fs::path> left;
  for (const char* name :
       {"needlelab-20260101T023000Z.db.partial", "needlelab-20260101T023000Z.db.partial-journal",
        "needlelab-20260102T023000Z.nlbk.partial"})
    left.push_back(folder.write(name, "x"));
  const auto running = folder.write("needlelab-20260105T022900Z.db.partial", "x");
  const auto others = folder.write("thesis.db.partial", "x");
  for (const auto& path : left) fs::last_write_time(path, fs::last_write_time(now) - std::chrono::hours(25));
  fs::last_write_time(others, fs::last_write_time(now) - std::chrono::hours(25));
  fs::last_write_time(running, fs::last_write_time(now) - std::chrono::hours(23));
  const auto old = removeOldBackups(now, 3);
  ASSERT_OK(old);
  EXPECT_EQ(old->removed, left);
  for (const auto& path : left) EXPECT_FALSE(fs::exists(path)) << path;
  for (const auto& path : {now, running, others}) EXPECT_TRUE(fs::exists(path)) << path;
}

}  // namespace
}  // namespace needlelab
