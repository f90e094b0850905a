// Seeking: the right chunk, for the same effort in ten seconds as in three hours.
#include <cmath>
#include <random>

#include "db/session_store.h"
#include "db/transaction.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

/// One second at 20 Hz a chunk, so that three hours are made quickly. The clock begins anywhere.
constexpr std::int64_t kClock_ns = 987'654'321'000;
Bytes secondOf(std::uint64_t first_tick, std::size_t count, double jitter = 0) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i].tick = first_tick + i;
    samples[i].time_ns = kClock_ns + static_cast<std::int64_t>(
                                         5e7 * (static_cast<double>(first_tick + i) + (i == 0 ? jitter : 0)));
  }
  return encodeChunk(Resolution{}, samples);
}

class SessionSeek : public testing::Test {
 protected:
  struct Chunk {
    std::uint64_t first_tick, count;
  };
  Uuid add(const std::vector<Chunk>& chunks) {
    const Uuid id = makeUuidV7();
    auto all = test::TestDb::must(Transaction::begin(db.writer, Transaction::Kind::kWrite));
    EXPECT_OK(store.open(test::describe(id), 1));
    for (std::uint64_t seq = 0; seq < chunks.size(); ++seq)
      EXPECT_OK(store.append(id, seq, secondOf(chunks[seq].first_tick, chunks[seq].count)));
    EXPECT_OK(all.commit());
    return id;
  }
  Uuid addRegular(std::uint64_t seconds) {
    std::vector<Chunk> chunks;
    for (std::uint64_t s = 0; s < seconds; ++s) chunks.push_back({1000 + 20 * s, 20});
    return add(chunks);
  }
  SoughtChunk seekTick(const Uuid& id, std::uint64_t tick) {
    return test::TestDb::must(store.seek(id, {tick, 0}));
  }
  SoughtChunk seekTime(const Uuid& id, double s) {
    return test::TestDb::must(store.seek(id, {std::nullopt, s}));
  }
  test::TestDb db;
  SessionStore store{db.writer};
};

TEST_F(SessionSeek, theEffortDoesNotGrowWithTheLength) {
  const Uuid brief = addRegular(10), lengthy = addRegular(3 * 3600);
  std::uint32_t most[2] = {};
  std::mt19937_64 random(7);
  for (int i = 0; i < 300; ++i) {
    const double share = std::uniform_real_distribution<>(0, 1)(random);
    int which = 0;
    for (const auto& [id, seconds] : {std::pair{brief, 10.0}, std::pair{lengthy, 3 * 3600.0}}) {
      const double at = share * seconds;
      const auto by_time = seekTime(id, at);
      EXPECT_EQ(by_time.seq, static_cast<std::uint64_t>(at)) << at;
      const auto by_tick = seekTick(id, 1000 + static_cast<std::uint64_t>(20 * at));
      EXPECT_EQ(by_tick.seq, static_cast<std::uint64_t>(at)) << at;
      EXPECT_EQ(by_tick.recording_first_tick, 1000u);
      EXPECT_EQ(by_tick.recording_first_time_ns, kClock_ns + 50'000'000'000);
      most[which] = std::max({most[which], by_time.chunks_read, by_tick.chunks_read});
      ++which;
    }
  }
  RecordProperty("chunks_read_10_s", static_cast<int>(most[0]));
  RecordProperty("chunks_read_3_h", static_cast<int>(most[1]));
  EXPECT_LE(most[0], 5u);
  EXPECT_LE(most[1], 5u);
}

/// SQLite's own count of what its statements did: no scan, whatever the length.
TEST_F(SessionSeek, noRowsAreSteppedThrough) {
  const Uuid lengthy = addRegular(3 * 3600);
  (void)seekTime(lengthy, 5000);
  std::int64_t scanned = 0, instructions = 0;
  (void)seekTime(lengthy, 7777);
  for (sqlite3_stmt* s = sqlite3_next_stmt(db.writer.handle(), nullptr); s != nullptr;
       s = sqlite3_next_stmt(db.writer.handle(), s)) {
    const std::string sql = sqlite3_sql(s);
    if (sql.find("FROM chunks") == std::string::npos) continue;
    scanned += sqlite3_stmt_status(s, SQLITE_STMTSTATUS_FULLSCAN_STEP, 1);
    instructions += sqlite3_stmt_status(s, SQLITE_STMTSTATUS_VM_STEP, 1);
  }
  EXPECT_EQ(scanned, 0);
  EXPECT_GT(instructions, 0);
  EXPECT_LT(instructions, 2000) << "two seeks of at most five chunks each";
}

TEST_F(SessionSeek, gapsAndUnevenChunksAreFoundByHalving) {
  std::mt19937_64 random(11);
  std::vector<Chunk> chunks;
  std::uint64_t tick = 0;
  for (int i = 0; i < 500; ++i) {
    const std::uint64_t count = 1 + random() % 40;
    chunks.push_back({tick, count});
    // now and then an hour of nothing
    tick += count + (random() % 20 == 0 ? 72'000 : 0);
  }
  const Uuid id = add(chunks);
  const auto bound = static_cast<std::uint32_t>(2 * std::ceil(std::log2(500.0)) + 4);
  for (int i = 0; i < 500; ++i) {
    const std::uint64_t at = random() % (tick + 1000);
    std::uint64_t expected = 0;
    for (std::uint64_t seq = 0; seq < chunks.size(); ++seq) {
      if (chunks[seq].first_tick <= at) expected = seq;
    }
    const auto sought = seekTick(id, at);
    EXPECT_EQ(sought.seq, expected) << at;
    EXPECT_EQ(sought.first_tick, chunks[expected].first_tick);
    EXPECT_LE(sought.chunks_read, bound);
    EXPECT_EQ(seekTime(id, 0.05 * static_cast<double>(at) + 0.01).seq, expected) << at;
  }
}

TEST_F(SessionSeek, theEndsAndTheEmptySession) {
  const Uuid id = addRegular(7);
  EXPECT_EQ(seekTick(id, 0).seq, 0u);
  EXPECT_EQ(seekTime(id, -5).seq, 0u);
  EXPECT_EQ(seekTick(id, UINT64_MAX).seq, 6u);
  EXPECT_EQ(seekTime(id, 1e8).seq, 6u);
  EXPECT_EQ(seekTick(addRegular(1), 1010).seq, 0u);
  EXPECT_EQ(store.seek(addRegular(0), {5, 0}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store.seek(makeUuidV7(), {5, 0}).error().code, ErrorCode::kNotFound);
}

TEST_F(SessionSeek, aDamagedChunkInTheWayMakesItEarlierNeverLate) {
  const Uuid id = addRegular(100);
  ASSERT_OK(db.writer.script("UPDATE chunks SET crc = 0 WHERE seq BETWEEN 40 AND 60"));
  for (std::uint64_t s = 0; s < 100; ++s) EXPECT_LE(seekTick(id, 1000 + 20 * s).seq, s);
  EXPECT_EQ(seekTick(id, 1000 + 20 * 70).seq <= 70, true);
  ASSERT_OK(db.writer.script("UPDATE chunks SET crc = 0 WHERE seq = 0"));
  EXPECT_EQ(store.seek(id, {1500, 0}).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace needlelab
