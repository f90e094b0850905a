#include <sys/sysmacros.h>

#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "common/base/files/files.h"
#include "db/backup/backup.h"
#include "db/backup/old_backups.h"
#include "db/erasure/erasure.h"
#include "tests/support/store/backup_start.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class UpkeepHandlers : public test::ServiceTest {
 protected:
  void SetUp() override { addStation(); }
  static pb::Request backupTo(const std::filesystem::path& path) {
    pb::Request request;
    request.mutable_backup()->set_path(path.string());
    return request;
  }
  /// Makes the store see files, by name, on disks 1 and 2; others on an unknown disk.
  void layDisks(std::map<std::string, unsigned> disk_of) {
    const auto sys = folder.path() / "sys";
    for (const unsigned disk : {1u, 2u}) {
      const auto made = sys / "devices" / ("disk" + std::to_string(disk));
      std::filesystem::create_directories(made / "device");
      std::filesystem::create_directories(sys / "dev" / "block");
      std::filesystem::create_symlink(made, sys / "dev" / "block" / ("8:" + std::to_string(disk)));
    }
    BlockDevices devices;
    devices.sys = sys;
    devices.device_of = [disk_of](const std::filesystem::path& path) -> std::optional<dev_t> {
      const auto found = disk_of.find(path.filename().string());
      return makedev(8, found == disk_of.end() ? 9 : found->second);
    };
    store->service().backups().setBlockDevices(std::move(devices));
  }
  std::uint64_t safeOf(const Uuid& session) {
    auto reader = store->readers().borrow();
    return *SessionStore(**reader).safeSeqs(session);
  }
};

TEST_F(UpkeepHandlers, aBackupOnAnotherDiskMakesChunksSafe) {
  layDisks({{"needlelab.db", 1}, {"copy.db", 2}});
  const Uuid id = addSession("anna", 4);
  const auto path = folder.path() / "copy.db";
  const auto done = get(admin, backupTo(path)).backup_done();
  EXPECT_EQ(done.chunks_verified(), 4u);
  EXPECT_EQ(done.bytes(), std::filesystem::file_size(path));
  EXPECT_EQ(done.disk(), pb::BackupDone::ANOTHER_DISK);
  EXPECT_TRUE(done.safe());
  EXPECT_EQ(safeOf(id), 3u) << "the last one with the session's end";
  EXPECT_EQ(refusal(admin, backupTo(path)), ErrorCode::kAlreadyExists);
  EXPECT_EQ(refusal(admin, backupTo("relative.db")), ErrorCode::kInvalidInput);
}

TEST_F(UpkeepHandlers, aBackupOnTheDatabasesDiskIsUnsafeUnlessRequested) {
  layDisks({{"needlelab.db", 1}, {"beside.db", 1}, {"asked.db", 1}});
  const Uuid id = addSession("anna", 4);
  const auto beside = get(admin, backupTo(folder.path() / "beside.db")).backup_done();
  EXPECT_EQ(beside.disk(), pb::BackupDone::SAME_DISK);
  EXPECT_FALSE(beside.safe());
  EXPECT_EQ(safeOf(id), 0u) << "the spools keep it";
  pb::Request audit;
  audit.mutable_list_audit()->set_action("backup");
  EXPECT_NE(get(admin, audit).audit().entries(0).detail().find("not Safe"), std::string::npos);

  pb::Request asked = backupTo(folder.path() / "asked.db");
  asked.mutable_backup()->set_counts_as_safe(true);
  const auto done = get(admin, asked).backup_done();
  EXPECT_EQ(done.disk(), pb::BackupDone::SAME_DISK);
  EXPECT_TRUE(done.safe());
  EXPECT_EQ(safeOf(id), 3u);
}

TEST_F(UpkeepHandlers, aBackupOnAnUnknownDiskMakesNothingSafe) {
  layDisks({{"needlelab.db", 1}});
  const Uuid id = addSession("anna", 4);
  const auto done = get(admin, backupTo(folder.path() / "somewhere.db")).backup_done();
  EXPECT_EQ(done.disk(), pb::BackupDone::DISK_UNKNOWN);
  EXPECT_FALSE(done.safe());
  EXPECT_EQ(safeOf(id), 0u);
}

TEST_F(UpkeepHandlers, aBackupUnderLoadIsWhole) {
  const Uuid id = addSession("anna", 0);
  std::atomic<bool> stop = false;
  std::thread load([&] {
    for (std::uint64_t seq = 0; !stop; ++seq) {
      (void)change([&](Connection& c) {
        const auto appended = SessionStore(c).append(id, seq, test::chunkOf(seq));
        return appended.ok() ? Status() : Status(appended.error());
      });
    }
  });
  for (int i = 0; i < 3; ++i) get(admin, backupTo(folder.path() / ("copy" + std::to_string(i))));
  stop = true;
  load.join();
  pb::Request check;
  check.mutable_check();
  EXPECT_TRUE(get(admin, check).check_report().ok());
}

/// Erases anna and makes a backup of the rest, named by its time.
class UpkeepBesideBackups : public UpkeepHandlers {
 protected:
  void SetUp() override {
    UpkeepHandlers::SetUp();
    for (const char* name : {"ada", "ben"}) addPerson(name, pb::ADMINISTRATOR);
    addPerson("anna", pb::TRAINEE);
    std::filesystem::create_directory(kept);
    pb::Request erase;
    erase.mutable_erase_person()->set_name("anna");
    erase.mutable_erase_person()->set_confirm("anna");
    get(admin, erase);
  }
  std::vector<std::string> faults() {
    pb::Request check;
    check.mutable_check();
    const auto report = get(admin, check).check_report();
    EXPECT_EQ(report.ok(), report.faults().empty());
    return {report.faults().begin(), report.faults().end()};
  }
  const std::filesystem::path kept = folder.path() / "kept", list = kept / kErasuresCopy;
};

TEST_F(UpkeepBesideBackups, anUnwritableErasureListIsReportedAfterRotation) {
  const auto old = kept / "needlelab-20200101T000000Z.db";
  ASSERT_OK(writeFileAtomically(old, viewOf(test::startOfBackup(".db"))));
  std::filesystem::create_directory(list);
  pb::Request request = backupTo(kept);
  request.mutable_backup()->set_keep(1);
  const auto refused = ask(admin, request);
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_EQ(refused.error->code, ErrorCode::kFailed);
  EXPECT_THAT(refused.error->message, testing::HasSubstr("the backup is made and verified, but the list"));
  EXPECT_THAT(refused.error->message, testing::HasSubstr(list.string()));
  EXPECT_FALSE(std::filesystem::exists(old));
  EXPECT_EQ(backupsIn(kept)->size(), 1u);
  ASSERT_EQ(faults().size(), 1u);
  EXPECT_THAT(faults()[0], testing::HasSubstr(list.string()));
  std::filesystem::remove(list);
  get(admin, backupTo(kept / "two.db"));
  EXPECT_THAT(faults(), testing::IsEmpty());
}

TEST_F(UpkeepBesideBackups, aFileWithOnlyABackupsNameStaysAndIsLogged) {
  const auto fake = kept / "needlelab-20200101T000000Z.db", old = kept / "needlelab-20200102T000000Z.db";
  ASSERT_OK(writeFileAtomically(fake, viewOf("x")));
  ASSERT_OK(writeFileAtomically(old, viewOf(test::startOfBackup(".db"))));
  pb::Request request = backupTo(kept);
  request.mutable_backup()->set_keep(1);
  EXPECT_THAT(get(admin, request).backup_done().removed(), testing::ElementsAre(old.string()));
  EXPECT_TRUE(std::filesystem::exists(fake));
  pb::Request audit;
  audit.mutable_list_audit()->set_action("backup");
  EXPECT_THAT(get(admin, audit).audit().entries(0).detail(),
              testing::HasSubstr("1 files are named as backups, but another user made them"));
}

TEST_F(UpkeepBesideBackups, checkReportsMissingErasuresUntilTheNextBackup) {
  EXPECT_THAT(faults(), testing::IsEmpty()) << "there are no backups";
  get(admin, backupTo(kept / "one.db"));
  EXPECT_THAT(faults(), testing::IsEmpty());
  std::filesystem::remove(list);
  ASSERT_EQ(faults().size(), 1u);
  EXPECT_THAT(faults()[0], testing::HasSubstr(list.string() + ": lacks erasures"));
  get(admin, backupTo(kept / "two.db"));
  EXPECT_THAT(faults(), testing::IsEmpty());
  std::filesystem::remove_all(kept);
  EXPECT_THAT(faults(), testing::IsEmpty()) << "a stick that is not there";
}

TEST_F(UpkeepHandlers, checkListsFaults) {
  addSession("anna", 4);
  pb::Request check;
  check.mutable_check();
  auto report = get(admin, check).check_report();
  EXPECT_TRUE(report.ok());
  EXPECT_EQ(report.sessions(), 1u);
  EXPECT_EQ(report.chunks(), 4u);
  ASSERT_OK(change([](Connection& c) { return c.run("UPDATE chunks SET samples = 1 WHERE seq = 2"); }));
  report = get(admin, check).check_report();
  EXPECT_FALSE(report.ok());
  ASSERT_EQ(report.faults_size(), 1);
  EXPECT_NE(report.faults(0).find("chunk 2"), std::string::npos);
}

}  // namespace
}  // namespace needlelab
