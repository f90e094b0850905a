// What only PostgreSQL does with chunks. tests/unit/db/sessions/append_many_test.cpp tests that they are
// stored as on SQLite.
#include <gtest/gtest.h>

#include <deque>
#include <future>
#include <string>
#include <vector>

#include "db/sessions/db_writer.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;

TEST(ChunksTogether, theirBytesAreNotTriedToBeCompressed) {
  test::TestDb db;
  auto rows = db.writer.prepare(
      "SELECT attrelid::regclass::text || ' ' || attstorage::text FROM pg_attribute"
      " WHERE attname = 'bytes' AND attrelid IN ('chunks'::regclass, 'derived_chunks'::regclass) ORDER BY 1");
  const auto storage = rows.all(firstText);
  ASSERT_OK(storage);
  EXPECT_EQ(*storage, (std::vector<std::string>{"chunks e", "derived_chunks e"}));
}

TEST(ChunksTogether, aGroupThatLosesItsConnectionIsStoredOnRetry) {
  test::TestDb db;
  auto reader = db.reader();
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  std::deque<Bytes> bytes;
  for (std::uint64_t seq = 0; seq < 20; ++seq) bytes.push_back(test::chunkOf(seq, 5));
  std::deque<Appended> outcomes(20);
  int stored = 0, refused = 0;  // used on the writer's thread
  const auto post = [&](DbWriter& writer) {
    for (std::uint64_t seq = 0; seq < 20; ++seq)
      ASSERT_OK(writer.postChunk({id, seq, bytes[seq], "station-1", &outcomes[seq]},
                                 [&](const Status& status) { ++(status.ok() ? stored : refused); }));
  };
  DbWriter writer(std::move(db.writer), {.window = 1h, .max_group = 21}, {});
  post(writer);
  ASSERT_OK(writer.post(
      [](Connection& connection) {
        // it ends this connection's own backend, after data were stored in the transaction
        (void)connection.run("SELECT pg_terminate_backend(pg_backend_pid())");
        return Status();
      },
      [](const Status& status) { EXPECT_FALSE(status.ok()); }));
  post(writer);
  ASSERT_OK(writer.post([](Connection&) { return Status(); }, {}));
  writer.stop();
  EXPECT_EQ(refused, 20);
  EXPECT_EQ(stored, 20);
  EXPECT_EQ(writer.counters().together, 20u);
  EXPECT_FALSE(writer.failed().has_value());
  EXPECT_EQ(*SessionStore(reader).nextSeq(id), 20u);
}

TEST(ChunksTogether, aGroupHasTwoRoundTrips) {
  test::TestDb db;
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  for (std::uint64_t group = 0; group < 8; ++group) {
    std::deque<Bytes> bytes;
    std::deque<Appended> outcomes(10);
    std::deque<ArrivedChunk> chunks;
    std::vector<const ArrivedChunk*> wanted;
    for (std::uint64_t i = 0; i < 10; ++i) {
      bytes.push_back(test::chunkOf(10 * group + i, 5));
      chunks.push_back({id, 10 * group + i, bytes.back(), "station-1", &outcomes[i]});
      wanted.push_back(&chunks.back());
    }
    const std::uint64_t before = db.writer.roundTrips();
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWriteSoon);
    ASSERT_OK(transaction);
    const auto results = SessionStore(db.writer).appendMany(wanted);
    ASSERT_OK(results);
    for (const auto& result : *results) ASSERT_TRUE(result.has_value() && result->ok());
    ASSERT_OK(transaction->commit());
    // the first one prepares the statement
    EXPECT_EQ(db.writer.roundTrips() - before, group == 0 ? 3u : 2u);
  }
  EXPECT_EQ(*SessionStore(db.writer).nextSeq(id), 80u);
}

TEST(ChunksTogether, thoseThatWaitAreCheckedWhileTheThreadWaitsForTheServer) {
  test::TestDb db;
  auto reader = db.reader();
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  std::deque<Bytes> bytes;
  for (std::uint64_t seq = 0; seq < 20; ++seq) bytes.push_back(test::chunkOf(seq, 5));
  bytes.back()[bytes.back().size() / 2] ^= 1;  // its CRC is wrong
  std::deque<Appended> outcomes(20);
  std::promise<void> all_wait;
  DbWriter writer(std::move(db.writer), {.window = 1h, .max_group = 1}, {});
  ASSERT_OK(writer.post(
      [&](Connection& connection) -> Status {
        all_wait.get_future().wait();
        return connection.run("SELECT pg_sleep(0.2)");
      },
      {}));
  for (std::uint64_t seq = 0; seq < 20; ++seq)
    ASSERT_OK(writer.postChunk({id, seq, bytes[seq], "station-1", &outcomes[seq]},
                               [](const Status& status) { EXPECT_TRUE(status.ok()); }));
  all_wait.set_value();
  writer.stop();
  EXPECT_EQ(writer.counters().checked_ahead, 19u);
  for (std::uint64_t seq = 0; seq < 19; ++seq) EXPECT_EQ(outcomes[seq].kind, Appended::Kind::kStored);
  EXPECT_EQ(outcomes[19].kind, Appended::Kind::kCorrupt);
  EXPECT_EQ(*SessionStore(reader).nextSeq(id), 19u);
}

}  // namespace
}  // namespace needlelab
