// If a reader checkpoints beside the writer, SQLite before 3.51.3 can lose data committed in the meantime
// (tests/unit/db/sessions/wal_reset_test.cpp). The product's readers, used as in the server, never
// checkpoint.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "db/backup/check.h"
#include "db/login/credentials.h"
#include "db/store/store_address.h"
#include "tests/powercut/campaign.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

TEST(SecondCheckpointer, readersOfThePoolNeverCheckpoint) {
  // the shim becomes the default VFS, because the pool has no VFS option
  sqlite3_vfs* const usual = sqlite3_vfs_find(nullptr);
  sqlite3_vfs_register(sqlite3_vfs_find(ShimVfs::name()), 1);
  {
    TestDb db(ShimVfs::name());
    ReaderPool pool(db.path);
    int added = 0;
    const auto add = [&] {
      EXPECT_OK(StationStore(db.writer).add("s" + std::to_string(added++), StationKeyBytes{}, 1));
    };
    { const auto first = TestDb::must(pool.borrow()); }
    while (added < 350) add();
    ASSERT_OK(db.writer.checkpointPassive());
    // a commit at the worst moment, in case another connection checkpoints
    bool reached = false;
    ShimVfs::instance().setHook([&](ShimVfs::Op op, const std::string&, std::int64_t, int) {
      if (op == ShimVfs::Op::kHeaderRead && !std::exchange(reached, true))
        for (int i = 0; i < 20; ++i) add();
      return SQLITE_OK;
    });
    for (int i = 0; i < 3; ++i) {
      auto lease = TestDb::must(pool.borrow());
      EXPECT_OK(StationStore(*lease).list());
      add();
    }
    ShimVfs::instance().setHook({});
    EXPECT_FALSE(reached) << "a reader checkpoints";
    auto reader = TestDb::must(Connection::open(db.path, {}));
    const auto check = checkDatabase(reader);
    ASSERT_OK(check);
    EXPECT_TRUE(check->ok()) << check->faults.front();
    int lost = 0;
    for (int i = 0; i < added; ++i) {
      const auto found = StationStore(reader).find("s" + std::to_string(i));
      if (!found.ok() || !found->has_value()) ++lost;
    }
    std::printf("readers: %d commits, bad in %d\n", added, lost);
    EXPECT_EQ(lost, 0);
  }
  sqlite3_vfs_register(usual, 1);
}

TEST(SecondCheckpointerPlanted, isCaught) {
  const auto run = runPlanted("second-checkpointer", "SecondCheckpointer.readersOfThePoolNeverCheckpoint");
  EXPECT_TRUE(run.failed) << run.said;
}

}  // namespace
}  // namespace needlelab::test
