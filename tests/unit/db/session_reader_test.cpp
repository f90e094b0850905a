// Reading sessions back, also from a database that was damaged.
#include <set>

#include "common/base/crc32c.h"
#include "db/session_store.h"
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
  EXPECT_EQ(store.info(id)->description().SerializeAsString(), d.SerializeAsString());
}

TEST_F(SessionReaderTest, listsNewestFirstAndFilters) {
  const Uuid old = add("anna", 100, 1);
  const Uuid newest = add("ben", 300, 0);
  const Uuid middle = add("anna", 200, 2);
  const auto wanted = [](const std::string& station, const std::string& trainee, std::uint32_t limit = 0) {
    pb::ListSessions list;
    list.set_station(station);
    list.set_trainee(trainee);
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
      "UPDATE chunks SET bytes = CAST(substr(bytes, 1, 30) || x'a7' || substr(bytes, 32) AS BLOB) WHERE seq "
      "= 2",
      "UPDATE chunks SET crc = crc + 1 WHERE seq = 2",
      "UPDATE chunks SET samples = 19 WHERE seq = 2",
      "DELETE FROM chunks WHERE seq = 2",
      "DELETE FROM chunks WHERE seq = 4",
      "UPDATE sessions SET samples = 99",
      "UPDATE sessions SET chunks = 4, samples = 80",
      "UPDATE sessions SET hash = zeroblob(32)",
      // two whole chunks exchanged: each is sound, the hash is not
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
      db.writer.script("UPDATE chunks SET bytes = CAST(substr(bytes, 1, 30) || x'ff' || substr(bytes, 32) AS "
                       "BLOB) WHERE seq = 1"));
  EXPECT_OK(store.readChunks(id, 0, 1, 1 << 20));
  const auto refused = store.readChunks(id, 0, 3, 1 << 20);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_NE(refused.error().message.find("chunk 1"), std::string::npos) << refused.error().message;
  // and such a session cannot be closed
  EXPECT_FALSE(store.close(closeOf(id, 3), 1).ok());
}

}  // namespace
}  // namespace needlelab
