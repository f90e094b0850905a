// How closes read the chunks of open sessions: each once.
#include "db/service/scoring/running_hashes.h"

#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class RunningHashesTest : public test::ServiceTest {
 protected:
  void SetUp() override { addStation(); }
  Result<std::optional<HashedChunks>> goOn(const Uuid& id, std::uint64_t chunks) {
    auto reader = store->readers().borrow();
    SessionStore sessions(**reader);
    return hashes.goOn(sessions, id, chunks);
  }
  RunningHashes hashes;
};

TEST_F(RunningHashesTest, eachChunkIsReadOnceAcrossCalls) {
  const Uuid id = addSession("anna", 5);
  std::uint64_t bytes = 0;
  for (const std::uint64_t chunks : {2u, 2u, 5u, 5u}) {
    const auto hashed = goOn(id, chunks);
    ASSERT_OK(hashed);
    ASSERT_TRUE(hashed->has_value());
    EXPECT_EQ((*hashed)->chunks, chunks);
    EXPECT_EQ((*hashed)->samples, 20 * chunks);
    EXPECT_EQ(textOf((*hashed)->hash), test::closeOf(id, chunks).hash());
  }
  for (std::uint64_t seq = 0; seq < 5; ++seq) bytes += test::chunkOf(seq).size();
  EXPECT_EQ(hashes.bytesHashed(), bytes);
  // fewer than are hashed already: restarted
  EXPECT_EQ(textOf((*goOn(id, 2))->hash), test::closeOf(id, 2).hash());
  hashes.forget(id);
  EXPECT_EQ(hashes.sessions(), 0u);
}

TEST_F(RunningHashesTest, aLongSessionTakesSeveralCallsOfBoundedReading) {
  constexpr std::uint64_t kChunks = 20'000;  // with one sample each
  const Uuid id = addSession("anna", kChunks, 1);
  std::uint64_t calls = 1, counted = 0;
  for (std::uint64_t seq = 0; seq < kChunks; ++seq) {
    if (counted >= RunningHashes::kMaxBytesAtOnce) {
      ++calls;
      counted = 0;
    }
    counted += test::chunkOf(seq, 1).size() + SessionStore::kHashedChunkBytes;
  }
  ASSERT_GE(calls, 2u);
  for (std::uint64_t call = 1; call < calls; ++call) {
    const auto more = goOn(id, kChunks);
    ASSERT_OK(more);
    ASSERT_FALSE(more->has_value()) << call;
  }
  const auto hashed = goOn(id, kChunks);
  ASSERT_OK(hashed);
  ASSERT_TRUE(hashed->has_value());
  EXPECT_EQ(textOf((*hashed)->hash), test::closeOf(id, kChunks, 1).hash());
}

TEST_F(RunningHashesTest, ofManySessionsThoseThatWereTriedLastAreKept) {
  std::vector<Uuid> ids(RunningHashes::kMaxSessions + 1);
  ASSERT_OK(change([&](Connection& c) -> Status {
    SessionStore sessions(c);
    for (Uuid& id : ids) {
      id = makeUuidV7();
      if (auto opened = sessions.open(test::describe(id), 1); !opened) return opened.error();
      if (auto stored = sessions.append(id, 0, test::chunkOf(0)); !stored) return stored.error();
    }
    return {};
  }));
  const std::uint64_t each = test::chunkOf(0).size();
  for (const Uuid& id : ids) ASSERT_OK(goOn(id, 1));
  EXPECT_EQ(hashes.sessions(), RunningHashes::kMaxSessions);
  EXPECT_EQ(hashes.bytesHashed(), each * ids.size());
  ASSERT_OK(goOn(ids[1], 1));
  EXPECT_EQ(hashes.bytesHashed(), each * ids.size());
  ASSERT_OK(goOn(ids[0], 1));
  EXPECT_EQ(hashes.bytesHashed(), each * (ids.size() + 1)) << "the one that was not used for longest";
}

TEST_F(RunningHashesTest, beforeADamagedChunkNothingIsReadAgain) {
  const Uuid id = addSession("anna", 4);
  ASSERT_OK(change([](Connection& c) { return c.script("UPDATE chunks SET crc = crc + 1 WHERE seq = 3"); }));
  for (int n = 0; n < 3; ++n) EXPECT_EQ(goOn(id, 4).error().code, ErrorCode::kCorrupt);
  const auto before = goOn(id, 3);
  ASSERT_OK(before);
  EXPECT_EQ(textOf((*before)->hash), test::closeOf(id, 3).hash());
  EXPECT_EQ(hashes.bytesHashed(),
            test::chunkOf(0).size() + test::chunkOf(1).size() + test::chunkOf(2).size());
}

}  // namespace
}  // namespace needlelab
