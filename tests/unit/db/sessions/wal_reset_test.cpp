// SQLite before 3.51.3 loses data if one connection commits, and thereby restarts the log, while another is
// between reading the log's header and copying by it ("WAL-reset bug"). Only the committing connection
// checkpoints.
#include <atomic>
#include <future>
#include <utility>

#include "db/backup/check.h"
#include "db/sessions/db_writer.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::ShimVfs;

class WalReset : public testing::Test {
 protected:
  void TearDown() override { ShimVfs::instance().setHook({}); }
  static Status add(Connection& connection, int number) {
    return StationStore(connection).add("s" + std::to_string(number), StationKeyBytes{}, 1);
  }
  /// Returns how many of the added rows a new connection does not find, or −1 if the database is unreadable.
  static int missing(const std::filesystem::path& path, int added) {
    auto reader = Connection::open(path, {});
    if (!reader) return -1;
    const auto check = checkDatabase(*reader);
    if (!check || !check->ok()) return -1;
    int count = 0;
    for (int i = 0; i < added; ++i) {
      const auto found = StationStore(*reader).find("s" + std::to_string(i));
      if (!found) return -1;
      if (!found->has_value()) ++count;
    }
    return count;
  }
};

TEST_F(WalReset, aConcurrentCheckpointAndCommitLoseData) {
  // Negative control: shows the bug that the rule avoids, on an SQLite version with the bug.
  if (sqlite3_libversion_number() >= 3'051'003)
    GTEST_SKIP() << "SQLite " << sqlite3_libversion() << " has it mended";
  for (const bool inside : {false, true}) {
    test::TestDb db(ShimVfs::name());
    auto other = test::TestDb::must(
        Connection::open(db.path, {.mode = Connection::Mode::kWriter, .vfs = ShimVfs::name()}));
    ASSERT_OK(other.run("SELECT count(*) FROM stations"));
    int added = 0;
    for (; added < 350; ++added) ASSERT_OK(add(db.writer, added));
    ASSERT_OK(db.writer.checkpointPassive());
    bool reached = false;
    const auto commit = [&] {
      for (int i = 0; i < 20; ++i) EXPECT_OK(add(db.writer, added++));
    };
    ShimVfs::instance().setHook([&](ShimVfs::Op op, const std::string&, std::int64_t, int) {
      if (op == ShimVfs::Op::kHeaderRead && !std::exchange(reached, true) && inside) commit();
      return SQLITE_OK;
    });
    ASSERT_OK(other.checkpointPassive());
    ShimVfs::instance().setHook({});
    ASSERT_TRUE(reached);
    if (!inside) commit();
    EXPECT_EQ(missing(db.path, added) != 0, inside) << missing(db.path, added);
  }
}

TEST_F(WalReset, theWriterNeverCommitsInsideItsCheckpoint) {
  test::TestDb db(ShimVfs::name());
  const std::string file = db.path.string();
  std::atomic<int> posted = 0, acknowledged = 0, inside = 0;
  std::promise<void> enough;
  {
    DbWriter writer(std::move(db.writer), {.window = 0ms, .checkpoint_every = 0ms}, {});
    const auto post = [&] {
      const int number = posted++;
      EXPECT_OK(writer.post([number](Connection& connection) { return add(connection, number); },
                            [&](const Status& status) {
                              if (status.ok() && ++acknowledged == 300) enough.set_value();
                            }));
    };
    // At each page that a checkpoint copies into the database: new commits, and a reader that opens and
    // closes.
    ShimVfs::instance().setHook([&](ShimVfs::Op op, const std::string& path, std::int64_t, int) {
      EXPECT_NE(op, ShimVfs::Op::kHeaderRead) << "somebody else has committed";
      if (op == ShimVfs::Op::kWrite && path == file && posted < 300) {
        ++inside;
        post();
        auto reader = Connection::open(db.path, {.vfs = ShimVfs::name()});
        EXPECT_OK(reader);
        EXPECT_OK(StationStore(*reader).list());
      }
      return SQLITE_OK;
    });
    post();
    EXPECT_EQ(enough.get_future().wait_for(1min), std::future_status::ready);
    writer.stop();
    ShimVfs::instance().setHook({});
    EXPECT_GT(writer.counters().checkpoints, 20u);
  }
  EXPECT_GT(inside, 100);
  EXPECT_EQ(acknowledged, posted);
  EXPECT_EQ(missing(db.path, posted), 0);
}

}  // namespace
}  // namespace needlelab
