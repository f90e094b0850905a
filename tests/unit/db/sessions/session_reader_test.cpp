#include <cmath>
#include <random>
#include <set>

#include "common/base/bytes.h"
#include "db/people/person_refs.h"
#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using test::chunkOf;
using test::closeOf;
using test::describe;

class SessionReaderTest : public testing::Test {
 protected:
  Uuid add(const std::string& trainee, std::int64_t started, std::uint64_t chunks) {
    const Uuid id = makeUuidV7();
    auto d = describe(id);
    d.set_trainee(trainee);
    d.set_started_unix_ns(started);
    EXPECT_OK(store.open(d, started));
    for (std::uint64_t seq = 0; seq < chunks; ++seq) EXPECT_OK(store.append(id, seq, chunkOf(seq)));
    return id;
  }
  test::TestDb db;
  SessionStore store{db.writer};
};

TEST_F(SessionReaderTest, theDescriptionComesBackWhole) {
  const Uuid id = makeUuidV7();
  auto d = describe(id);
  for (const double number : {0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0}) d.add_placement(number);
  ASSERT_OK(store.open(d, 5));
  auto stored = store.info(id)->description();
  EXPECT_TRUE(isPersonRef(stored.trainee()));
  stored.clear_trainee();
  stored.clear_trainee_full_name();
  d.clear_trainee();
  EXPECT_EQ(stored.SerializeAsString(), d.SerializeAsString());
}

TEST_F(SessionReaderTest, listsNewestFirstAndFilters) {
  const Uuid old = add("anna", 100, 1);
  const Uuid newest = add("ben", 300, 0);
  const Uuid middle = add("anna", 200, 2);
  const auto wanted = [&](const std::string& station, const std::string& trainee, std::uint32_t limit = 0) {
    pb::ListSessions list;
    list.set_station(station);
    list.set_trainee(findPerson(db.writer, trainee, Named::kAccountOrTyped)->value_or(trainee));
    list.set_limit(limit);
    return list;
  };
  const auto all = store.list({});
  ASSERT_OK(all);
  ASSERT_EQ(all->size(), 3u);
  EXPECT_EQ((*all)[0].description().session_id(), test::bytesOfId(newest));
  EXPECT_EQ((*all)[1].description().session_id(), test::bytesOfId(middle));
  EXPECT_EQ((*all)[2].description().session_id(), test::bytesOfId(old));
  EXPECT_EQ((*all)[1].samples(), 40u);
  EXPECT_TRUE((*all)[0].description().profile_json().empty());
  EXPECT_EQ(store.list(wanted("", "anna"))->size(), 2u);
  EXPECT_EQ(store.list(wanted("station-1", "", 1))->size(), 1u);
  EXPECT_TRUE(store.list(wanted("station-2", ""))->empty());
  EXPECT_EQ(store.list({}, newest)->size(), 2u) << "those behind it";
  EXPECT_EQ(store.list(wanted("", "anna"), middle)->size(), 1u);
  auto of_exercise = wanted("", "");
  of_exercise.set_exercise_id("knee-1");
  EXPECT_EQ(store.list(of_exercise)->size(), all->size());
  of_exercise.set_exercise_id("shoulder-1");
  EXPECT_TRUE(store.list(of_exercise)->empty());
}

TEST_F(SessionReaderTest, readsChunksFromASeqWithinItsLimits) {
  const Uuid id = add("anna", 100, 10);
  const auto some = store.readChunks(id, 4, 3, 1 << 20);
  ASSERT_OK(some);
  ASSERT_EQ(some->size(), 3u);
  EXPECT_EQ(some->front().seq, 4u);
  EXPECT_EQ(some->front().bytes, chunkOf(4));
  EXPECT_EQ(some->front().samples, 20u);
  // at least one chunk, however small the limit
  EXPECT_EQ(store.readChunks(id, 0, 100, 1)->size(), 1u);
  EXPECT_EQ(store.readChunks(id, 0, 100, chunkOf(0).size() + chunkOf(1).size())->size(), 2u);
  EXPECT_TRUE(store.readChunks(id, 10, 100, 1 << 20)->empty());
  EXPECT_TRUE(store.readChunks(id, UINT64_MAX, 100, 1 << 20)->empty());
  EXPECT_EQ(store.readChunks(makeUuidV7(), 0, 1, 1).error().code, ErrorCode::kNotFound);
}

TEST_F(SessionReaderTest, verifyFindsASoundSessionSound) {
  const Uuid id = add("anna", 100, 5);
  EXPECT_TRUE(store.verify(id)->ok);
  ASSERT_OK(store.close(closeOf(id, 5), 1));
  const auto check = store.verify(id);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok) << check->text;
  EXPECT_EQ(check->chunks, 5u);
  EXPECT_EQ(check->samples, 100u);
  EXPECT_EQ(textOf(check->hash), closeOf(id, 5).hash());
}

TEST_F(SessionReaderTest, everyKindOfDamageIsFoundByVerify) {
  const std::string damages[] = {
      "UPDATE chunks SET bytes = " + test::byteReplacedSql(31, "a7") + " WHERE seq = 2",
      "UPDATE chunks SET crc = crc + 1 WHERE seq = 2",
      "UPDATE chunks SET samples = 19 WHERE seq = 2",
      "DELETE FROM chunks WHERE seq = 2",
      "DELETE FROM chunks WHERE seq = 4",
      "UPDATE sessions SET samples = 99",
      "UPDATE sessions SET chunks = 4, samples = 80",
      "UPDATE sessions SET hash = " + test::zerosSql(32),
      // Two whole chunks swapped: each one is valid, the hash is not.
      "UPDATE chunks SET seq = CASE seq WHEN 1 THEN 1001 WHEN 2 THEN 1002 ELSE seq END;"
      "UPDATE chunks SET seq = CASE seq WHEN 1001 THEN 2 WHEN 1002 THEN 1 ELSE seq END",
  };
  const Uuid id = add("anna", 100, 5);
  ASSERT_OK(store.close(closeOf(id, 5), 1));
  for (const std::string& damage : damages) {
    ASSERT_OK(db.writer.script("BEGIN;" + damage));
    const auto check = store.verify(id);
    ASSERT_OK(check);
    EXPECT_FALSE(check->ok) << damage;
    EXPECT_FALSE(check->text.empty());
    ASSERT_OK(db.writer.script("ROLLBACK"));
  }
  EXPECT_TRUE(store.verify(id)->ok);
}

TEST_F(SessionReaderTest, wrongCountersAreFoundByVerifyInOpenAndInClosedSessions) {
  const std::string of_open[] = {
      "UPDATE session_progress SET chunks = chunks - 1",
      "UPDATE session_progress SET chunks = chunks + 1",
      "UPDATE session_progress SET samples = samples + 1",
      "UPDATE session_progress SET stored_bytes = stored_bytes + 1",
      "DELETE FROM session_progress",
  };
  const std::string of_closed[] = {
      "UPDATE sessions SET stored_bytes = stored_bytes - 1",
      "INSERT INTO session_progress SELECT number, chunks, samples, stored_bytes FROM sessions",
  };
  const Uuid id = add("anna", 100, 3);
  const auto each = [&](const auto& damages) {
    for (const std::string& damage : damages) {
      ASSERT_OK(db.writer.script("BEGIN;" + damage));
      const auto check = store.verify(id);
      ASSERT_OK(check);
      EXPECT_FALSE(check->ok) << damage;
      ASSERT_OK(db.writer.script("ROLLBACK"));
      EXPECT_TRUE(store.verify(id)->ok) << "without: " << damage;
    }
  };
  each(of_open);
  ASSERT_OK(store.close(closeOf(id, 3), 1));
  each(of_closed);
}

TEST_F(SessionReaderTest, theStationsCrcIsKeptAndDiffersFromChunkToChunk) {
  add("anna", 100, 4);
  auto rows = db.writer.prepare("SELECT crc, bytes FROM chunks ORDER BY seq");
  std::set<std::int64_t> seen;
  while (*rows.step()) {
    const ByteView bytes = rows.bytes(1);
    EXPECT_EQ(rows.integer(0), crc32c(bytes.first(bytes.size() - 4)));
    seen.insert(rows.integer(0));
  }
  EXPECT_EQ(seen.size(), 4u);
}

TEST_F(SessionReaderTest, aDamagedChunkIsNeverHandedOut) {
  const Uuid id = add("anna", 100, 3);
  ASSERT_OK(
      db.writer.script("UPDATE chunks SET bytes = " + test::byteReplacedSql(31, "ff") + " WHERE seq = 1"));
  EXPECT_OK(store.readChunks(id, 0, 1, 1 << 20));
  const auto refused = store.readChunks(id, 0, 3, 1 << 20);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_NE(refused.error().message.find("chunk 1"), std::string::npos) << refused.error().message;
  // Such a session cannot be closed.
  EXPECT_FALSE(store.close(closeOf(id, 3), 1).ok());
}

/// Chunks of one second at 20 Hz, so that three hours are generated quickly. The clock starts at an arbitrary
/// time.
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

/// Checks SQLite's own statement counters: no scan, whatever the length.
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
    // occasional gaps of an hour
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
