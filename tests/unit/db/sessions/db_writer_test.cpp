#include "db/sessions/db_writer.h"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <future>
#include <iterator>
#include <latch>
#include <stdexcept>

#include "db/audit/audit.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::ShimVfs;

DbWriter::Work addStation(const std::string& name) {
  return [name](Connection& writer) { return StationStore(writer).add(name, StationKeyBytes{}, 1); };
}

bool known(Connection& reader, const std::string& name) {
  const auto station = StationStore(reader).find(name);
  return station.ok() && station->has_value();
}

TEST(DbWriter, reportsSuccessOnlyWhenAnotherConnectionSeesTheRow) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 5ms}, {});
  for (int i = 0; i < 10; ++i) {
    const std::string name = "s" + std::to_string(i);
    std::promise<bool> seen;
    ASSERT_OK(writer.post(addStation(name),
                          [&](const Status& status) { seen.set_value(status.ok() && known(reader, name)); }));
    EXPECT_TRUE(seen.get_future().get()) << name;
  }
}

TEST(DbWriter, reportsTheRunningTransactionAndTheLastCommit) {
  test::TestDb db;
  DbWriter writer(std::move(db.writer), {.window = 0ms}, {});
  EXPECT_EQ(writer.standing().began_ns, 0);
  EXPECT_EQ(writer.standing().committed_ns, 0);
  DbWriter::Standing during;
  ASSERT_OK(writer.run([&](Connection&) {
    during = writer.standing();
    return Status();
  }));
  EXPECT_GT(during.began_ns, 0);
  const auto after = writer.standing();
  EXPECT_EQ(after.began_ns, 0);
  EXPECT_GE(after.committed_ns, during.began_ns);
  EXPECT_EQ(after.refused, "");
}

TEST(DbWriter, aFailingItemIsUndoneAndReportedAlone) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 30ms}, {});
  std::atomic<int> good = 0, bad = 0;
  const auto count = [&](const Status& status) { ++(status.ok() ? good : bad); };
  ASSERT_OK(writer.post(addStation("first"), count));
  ASSERT_OK(writer.post(
      [](Connection& connection) {
        if (auto done = StationStore(connection).add("half", StationKeyBytes{}, 1); !done) return done;
        return Status(Error{ErrorCode::kInvalidInput, "the second half is wrong"});
      },
      count));
  ASSERT_OK(writer.post(addStation("station-1"), count));  // exists already
  ASSERT_OK(writer.post(
      [](Connection& connection) { return connection.run("INSERT INTO nowhere VALUES (1)"); }, count));
  ASSERT_OK(writer.post(addStation("last"), count));
  writer.stop();
  EXPECT_EQ(good, 2);
  EXPECT_EQ(bad, 3);
  EXPECT_TRUE(known(reader, "first"));
  EXPECT_TRUE(known(reader, "last"));
  EXPECT_FALSE(known(reader, "half"));
  EXPECT_EQ(writer.counters().commits, 1u);
  EXPECT_EQ(writer.counters().items, 2u);
  EXPECT_EQ(writer.counters().refused, 3u);
  EXPECT_FALSE(writer.failed().has_value());
}

TEST(DbWriter, anItemOutOfMemoryIsUndoneAlone) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 5ms}, {});
  const auto lacking = writer.run([](Connection& connection) -> Status {
    if (auto done = StationStore(connection).add("half", StationKeyBytes{}, 1); !done) return done;
    sqlite3_hard_heap_limit64(sqlite3_memory_used() + (1 << 20));
    const auto done = connection.run(
        "INSERT INTO audit (unix_ns, who, action, subject, detail)"
        " VALUES (1, '', '', '', hex(zeroblob(16000000)))");
    sqlite3_hard_heap_limit64(0);
    return done;
  });
  ASSERT_FALSE(lacking.ok());
  EXPECT_NE(lacking.error().message.find("out of memory"), std::string::npos) << lacking.error().message;
  EXPECT_FALSE(writer.failed().has_value());
  EXPECT_OK(writer.run(addStation("next")));
  EXPECT_TRUE(known(reader, "next"));
  EXPECT_FALSE(known(reader, "half"));
}

TEST(DbWriter, anItemThatThrowsIsUndoneAndReportedAlone) {
  test::TestDb db;
  auto reader = db.reader();
  std::vector<std::string> said;
  {
    DbWriter::Options options;
    options.window = 30ms;
    options.on_thrown = [&](const std::string& text) { said.push_back(text); };
    DbWriter writer(std::move(db.writer), options, {});
    std::promise<Status> good, bad;
    ASSERT_OK(writer.post(
        [](Connection& connection) -> Status {
          auto rows = connection.prepare("SELECT name FROM stations");
          EXPECT_TRUE(rows.step().ok()) << "a statement that is under way";
          if (auto done = StationStore(connection).add("half", StationKeyBytes{}, 1); !done) return done;
          throw std::out_of_range("no such field");
        },
        [&](const Status& status) { bad.set_value(status); }));
    ASSERT_OK(writer.post(addStation("after"), [&](const Status& status) { good.set_value(status); }));
    const Status refused = bad.get_future().get();
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kFailed);
    EXPECT_NE(refused.error().message.find("no such field"), std::string::npos);
    EXPECT_OK(good.get_future().get());
    EXPECT_OK(writer.run(addStation("later")));
    EXPECT_FALSE(writer.failed().has_value());
  }
  EXPECT_EQ(said, std::vector<std::string>{"no such field"});
  EXPECT_TRUE(known(reader, "after"));
  EXPECT_TRUE(known(reader, "later"));
  EXPECT_FALSE(known(reader, "half"));
}

TEST(DbWriter, manyItemsShareACommitAndKeepTheirOrder) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 50ms}, {});
  std::vector<int> order;  // used only by the writer's thread, read after stop()
  for (int i = 0; i < 500; ++i) {
    ASSERT_OK(writer.post(
        [](Connection& connection) {
          return AuditStore(connection).add({0, 1, "a", "b", "c", "d"});
        },
        [&order, i](const Status& status) {
          if (status.ok()) order.push_back(i);
        }));
  }
  writer.stop();
  ASSERT_EQ(order.size(), 500u);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
  EXPECT_LT(writer.counters().commits, 20u);
  auto row = reader.prepare("SELECT count(*) FROM audit");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.integer(0), 500);
}

TEST(DbWriter, aFullQueueRefusesAtOnce) {
  test::TestDb db;
  std::promise<void> go;
  auto gate = go.get_future().share();
  DbWriter writer(std::move(db.writer), {.window = 0ms, .max_items = 3}, {});
  std::promise<void> running;
  ASSERT_OK(
      writer.post([&running, gate](Connection&) { return running.set_value(), gate.wait(), Status(); }, {}));
  running.get_future().wait();
  for (int i = 0; i < 3; ++i) ASSERT_OK(writer.post(addStation("s" + std::to_string(i)), {}));
  bool called = false;
  const auto refused = writer.post(addStation("too much"), [&](const Status&) { called = true; });
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  go.set_value();
  writer.stop();
  EXPECT_FALSE(called);
  EXPECT_EQ(writer.counters().items, 4u);
}

TEST(DbWriter, aFullQueueHasABoundedReserve) {
  test::TestDb db;
  std::promise<void> go;
  auto gate = go.get_future().share();
  DbWriter writer(std::move(db.writer), {.window = 0ms, .max_items = 3, .kept_items = 2}, {});
  std::promise<void> running;
  ASSERT_OK(
      writer.post([&running, gate](Connection&) { return running.set_value(), gate.wait(), Status(); }, {}));
  running.get_future().wait();
  const auto post = [&](const std::string& name, DbWriter::Places places) {
    return writer.post(addStation(name), {}, places).ok();
  };
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(post("s" + std::to_string(i), DbWriter::Places::kCommon));
  for (int i = 3; i < 5; ++i) {
    EXPECT_FALSE(post("more", DbWriter::Places::kCommon));
    EXPECT_TRUE(post("s" + std::to_string(i), DbWriter::Places::kKept));
  }
  EXPECT_FALSE(post("more", DbWriter::Places::kKept));
  go.set_value();
  writer.stop();
  EXPECT_EQ(writer.counters().items, 6u);
}

TEST(DbWriter, stopCommitsTheQueueAndRefusesMore) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 1h}, {});  // otherwise the test would never end
  for (int i = 0; i < 20; ++i) ASSERT_OK(writer.post(addStation("s" + std::to_string(i)), {}));
  writer.stop();
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(known(reader, "s" + std::to_string(i)));
  EXPECT_FALSE(writer.post(addStation("late"), {}).ok());
  EXPECT_FALSE(writer.run(addStation("late")).ok());
  EXPECT_FALSE(known(reader, "late"));
}

TEST(DbWriter, countsTimesGroupsAndTheLogsSize) {
  test::TestDb db;
  const auto wal = db.path.string() + "-wal";
  DbWriter writer(std::move(db.writer), {.window = 1ms, .checkpoint_every = 0ms}, {});
  for (int i = 0; i < 5; ++i) ASSERT_OK(writer.run(addStation("s" + std::to_string(i))));
  EXPECT_FALSE(writer.run(addStation("s0")).ok());
  writer.stop();
  EXPECT_GT(std::filesystem::file_size(wal), 0u);
  const auto counters = writer.counters();
  EXPECT_EQ(counters.commits, 6u);
  EXPECT_EQ(counters.checkpoints, counters.commits) << "each is due at once";
  EXPECT_EQ(counters.commit_ns.count(), counters.commits);
  EXPECT_EQ(counters.work_ns.count(), counters.commits);
  EXPECT_EQ(counters.commit_ns.sum(), counters.total_commit_ns);
  EXPECT_EQ(counters.commit_ns.max(), counters.max_commit_ns);
  EXPECT_EQ(counters.group_items.sum(), 6) << "the refused one was in a group, too";
  EXPECT_EQ(counters.checkpoint_ns.count(), counters.checkpoints);
  EXPECT_GT(counters.checkpoint_ns.max(), 0);
  EXPECT_EQ(counters.wal_bytes, std::filesystem::file_size(wal));
  EXPECT_EQ(counters.wal_pages_waiting, 0u) << "no one reads, so a checkpoint moves everything";
}

/// Whether the log's file contains `word`.
bool logContains(const test::TestDb& db, const std::string& word) {
  std::ifstream in(db.path.string() + "-wal", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  return bytes.find(word) != std::string::npos;
}

TEST(DbWriter, emptiesTheWalOnRequestWithoutReaders) {
  test::TestDb db;
  DbWriter writer(std::move(db.writer), {.window = 1ms}, {});
  ASSERT_OK(writer.run(addStation("qzxstation")));
  EXPECT_TRUE(logContains(db, "qzxstation"));
  EXPECT_TRUE(writer.emptyLog(60s));
  EXPECT_EQ(std::filesystem::file_size(db.path.string() + "-wal"), 0u);
  EXPECT_EQ(writer.counters().logs_emptied, 1u);
  EXPECT_FALSE(writer.counters().log_pending);
  EXPECT_EQ(writer.counters().wal_bytes, 0u);
  auto reader = db.reader();
  EXPECT_TRUE(known(reader, "qzxstation")) << "it is in the database";
}

TEST(DbWriter, theLogIsPendingWhileSomebodyReadsAndIsEmptiedAfterwards) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 1ms, .empty_every = 1ms}, {});
  {
    auto view = Transaction::begin(reader, Transaction::Kind::kRead);
    ASSERT_OK(view);
    ASSERT_OK(writer.run(addStation("qzxstation")));
    EXPECT_FALSE(writer.emptyLog(1ms)) << "the reader's view is older";
    EXPECT_TRUE(writer.counters().log_pending);
    EXPECT_TRUE(logContains(db, "qzxstation"));
    ASSERT_OK(writer.run(addStation("goes on")));  // commits do not wait for the reader
  }
  EXPECT_TRUE(writer.emptyLog(60s));
  EXPECT_FALSE(writer.counters().log_pending);
  EXPECT_FALSE(logContains(db, "qzxstation"));
}

TEST(DbWriter, aRequestedEmptyWalIsEmptyAfterTheStop) {
  test::TestDb db;
  auto reader = db.reader();
  DbWriter writer(std::move(db.writer), {.window = 1ms, .empty_every = 3600s}, {});
  {
    auto view = Transaction::begin(reader, Transaction::Kind::kRead);
    ASSERT_OK(view);
    ASSERT_OK(writer.run(addStation("qzxstation")));
    EXPECT_FALSE(writer.emptyLog(1ms));
  }
  writer.stop();
  EXPECT_EQ(std::filesystem::file_size(db.path.string() + "-wal"), 0u);
  EXPECT_FALSE(writer.emptyLog(60s)) << "no one does it any more";
}

TEST(DbWriter, aLogAboveItsBoundIsCutWithoutBeingAsked) {
  test::TestDb db;
  DbWriter writer(std::move(db.writer),
                  {.window = 0ms, .checkpoint_every = 3600s, .max_log_bytes = 200'000, .empty_every = 0ms},
                  {});
  ASSERT_TRUE(writer.emptyLog(60s));  // from the migrations
  std::uint64_t most = 0;
  for (int i = 0; i < 300; ++i) {
    ASSERT_OK(writer.run(addStation("s" + std::to_string(i))));
    most = std::max(most, writer.counters().wal_bytes);
  }
  writer.stop();
  EXPECT_GE(writer.counters().logs_emptied, 2u);
  // at most one commit of some pages beyond the bound
  EXPECT_LE(most, 300'000u);
}

// On a simulated clock that the writer's own waits advance: 1 ms per group, and up to the next checkpoint.
TEST(DbWriter, checkpointsByItselfEvery20ms) {
  test::FakeTime time;
  const std::int64_t began_ns = time.nowNs();
  test::TestDb db;
  ASSERT_OK(db.writer.checkpointPassive());
  const auto before = std::filesystem::file_size(db.path);
  DbWriter writer(std::move(db.writer), {.window = 1ms, .checkpoint_every = 20ms, .time = &time}, {});
  ASSERT_OK(writer.run([](Connection& connection) {
    for (int i = 0; i < 100; ++i) {
      if (auto done =
              StationStore(connection).add(std::string(50, 'x') + std::to_string(i), StationKeyBytes{}, 1);
          !done)
        return done;
    }
    return Status();
  }));
  EXPECT_LE(writer.counters().checkpoints, 1u);
  for (int i = 0; i < 100; ++i) ASSERT_OK(writer.run(addStation("s" + std::to_string(i))));
  writer.stop();
  EXPECT_GT(std::filesystem::file_size(db.path), before);
  const auto checkpoints = static_cast<std::int64_t>(writer.counters().checkpoints);
  EXPECT_GE(checkpoints, 4) << "101 groups of 1 ms";
  EXPECT_LE(checkpoints, (time.nowNs() - began_ns) / 20'000'000);
}

// The finding: without a privilege on one table every chunk was refused, but /healthz returned 200.
TEST(DbWriter, aFailedItemIsReportedFor30sDespiteTheCommit) {
  test::FakeTime time;
  test::TestDb db;
  DbWriter writer(std::move(db.writer), {.window = 1ms, .time = &time}, {});
  EXPECT_EQ(writer.failedItem(DbWriter::kReportedFor), "");
  EXPECT_FALSE(writer.run(addStation("station-1")).ok());
  EXPECT_EQ(writer.failedItem(DbWriter::kReportedFor), "") << "it was asked for what cannot be";
  const Status failed =
      writer.run([](Connection& connection) { return connection.run("INSERT INTO nowhere VALUES (1)"); });
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::kFailed);
  ASSERT_OK(writer.run(addStation("another")));
  EXPECT_EQ(writer.standing().refused, "");
  EXPECT_EQ(writer.failedItem(DbWriter::kReportedFor), failed.error().message);
  // the writer's own waits are some 0.1 s in total
  time.advance(std::chrono::nanoseconds(29s).count());
  EXPECT_EQ(writer.failedItem(DbWriter::kReportedFor), failed.error().message);
  time.advance(std::chrono::nanoseconds(1s).count());
  EXPECT_EQ(writer.failedItem(DbWriter::kReportedFor), "");
}

TEST(DbWriter, aLockHeldByAnotherProgramIsNoDiskFailure) {
  test::TestDb db;
  auto shell = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
  sqlite3_busy_timeout(db.writer.handle(), 10);
  DbWriter writer(std::move(db.writer), {.window = 1ms}, {});
  ASSERT_OK(shell.script("BEGIN IMMEDIATE"));
  const auto busy = writer.run(addStation("a"));
  ASSERT_FALSE(busy.ok());
  EXPECT_EQ(busy.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(writer.standing().refused, busy.error().message);
  EXPECT_EQ(writer.standing().began_ns, 0);
  ASSERT_OK(shell.script("ROLLBACK"));
  EXPECT_OK(writer.run(addStation("a")));
  EXPECT_EQ(writer.standing().refused, "");
}

/// A disk that fails in one way from a given moment on.
class DbWriterOnBadDisk : public testing::TestWithParam<std::pair<ShimVfs::Op, int>> {
 protected:
  void TearDown() override { ShimVfs::instance().setHook({}); }
};

TEST_P(DbWriterOnBadDisk, nothingIsAcknowledgedAfterIt) {
  auto& vfs = ShimVfs::instance();
  test::TestDb db(ShimVfs::name());
  auto reader = db.reader();
  std::atomic<bool> broken = false;
  vfs.setHook([&broken, param = GetParam()](ShimVfs::Op op, const std::string&, std::int64_t, int) {
    return broken && op == param.first ? param.second : SQLITE_OK;
  });
  std::atomic<int> fatal = 0;
  {
    DbWriter writer(std::move(db.writer), {.window = 20ms, .checkpoint_every = 1h},
                    [&](const Error&) { ++fatal; });
    ASSERT_OK(writer.run(addStation("before")));

    // three in one group; none of them may be acknowledged
    broken = true;
    std::atomic<int> acknowledged = 0, refused = 0;
    std::latch all(3);
    for (int i = 0; i < 3; ++i) {
      ASSERT_OK(writer.post(addStation("lost" + std::to_string(i)), [&](const Status& s) {
        ++(s.ok() ? acknowledged : refused);
        all.count_down();
      }));
    }
    all.wait();
    EXPECT_EQ(acknowledged, 0);
    EXPECT_EQ(refused, 3);

    // the disk recovers, the writer does not
    broken = false;
    const auto late = writer.run(addStation("after"));
    ASSERT_FALSE(late.ok());
    EXPECT_EQ(late.error().code, ErrorCode::kUnavailable);
    writer.stop();
    ASSERT_TRUE(writer.failed().has_value());
  }
  EXPECT_EQ(fatal, 1);
  EXPECT_TRUE(known(reader, "before"));
  EXPECT_FALSE(known(reader, "after"));
  // a new start finds an intact database
  auto again = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
  auto check = again.prepare("PRAGMA integrity_check");
  ASSERT_TRUE(*check.step());
  EXPECT_EQ(check.text(0), "ok");
}

class DbWriterCheckpoint : public testing::Test {
 protected:
  void TearDown() override { ShimVfs::instance().setHook({}); }
};

TEST_F(DbWriterCheckpoint, thatFailsStopsTheWriterButLosesNothing) {
  test::TestDb db(ShimVfs::name());
  const std::string file = db.path.string();
  ShimVfs::instance().setHook([file](ShimVfs::Op op, const std::string& path, std::int64_t, int) {
    return op == ShimVfs::Op::kWrite && path == file ? SQLITE_IOERR_WRITE : SQLITE_OK;
  });
  std::promise<void> fatal;
  DbWriter writer(std::move(db.writer), {.window = 1ms, .checkpoint_every = 10ms},
                  [&](const Error&) { fatal.set_value(); });
  ASSERT_OK(writer.run(addStation("acknowledged")));
  fatal.get_future().wait();
  EXPECT_FALSE(writer.run(addStation("after")).ok());
  writer.stop();
  auto reader = db.reader();
  EXPECT_TRUE(known(reader, "acknowledged"));
}

INSTANTIATE_TEST_SUITE_P(Faults, DbWriterOnBadDisk,
                         testing::Values(std::pair(ShimVfs::Op::kWrite, SQLITE_FULL),
                                         std::pair(ShimVfs::Op::kWrite, SQLITE_IOERR_WRITE),
                                         std::pair(ShimVfs::Op::kSync, SQLITE_IOERR_FSYNC)),
                         [](const auto& param_info) {
                           return param_info.param.second == SQLITE_FULL          ? "diskFull"
                                  : param_info.param.second == SQLITE_IOERR_FSYNC ? "fsyncFails"
                                                                                  : "writeFails";
                         });

}  // namespace
}  // namespace needlelab
