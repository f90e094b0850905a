#include <thread>

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
};

TEST_F(UpkeepHandlers, aBackupMakesChunksSafe) {
  const Uuid id = addSession("anna", 4);
  const auto path = folder.path() / "copy.db";
  const auto done = get(admin, backupTo(path)).backup_done();
  EXPECT_EQ(done.chunks_verified(), 4u);
  EXPECT_EQ(done.bytes(), std::filesystem::file_size(path));
  auto reader = store->readers().borrow();
  EXPECT_EQ(*SessionStore(**reader).safeSeqs(id), 3u) << "the last one with the session's end";
  EXPECT_EQ(refusal(admin, backupTo(path)), ErrorCode::kAlreadyExists);
  EXPECT_EQ(refusal(admin, backupTo("relative.db")), ErrorCode::kInvalidInput);
}

TEST_F(UpkeepHandlers, aRestoredBackupIsAWholeStore) {
  const Uuid id = addSession("anna", 4);
  std::filesystem::create_directory(folder.path() / "restored");
  get(admin, backupTo(folder.path() / "restored" / "needlelab.db"));
  auto restored = test::openStore(folder.path() / "restored");
  auto reader = restored->readers().borrow();
  EXPECT_EQ(*SessionStore(**reader).nextSeq(id), 4u);
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
