/// Compares the store's writes with plain SQLite's for the same chunks, in pages of the write-ahead log.
/// Times are noisy on a busy machine; page counts are not, and each page costs its share of an fsync.
#include <algorithm>
#include <numeric>
#include <random>

#include "db/sessions/session_store.h"
#include "db/store/connection.h"
#include "tests/unit/common/gesture/gesture_samples.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

constexpr std::size_t kIngestSessions = 1000, kIngestGroup = 35, kIngestGroups = 60;

/// 5.2 kB, the size of one second of a hand at 1 kHz.
Bytes chunkOfASecond() {
  const auto samples = test::smoothGesture(4000);
  Bytes chunk;
  for (std::size_t count = 10; chunk.size() < 5200 && count <= samples.size(); count += 10)
    chunk = encodeChunk(Resolution::standard(), std::span(samples).first(count));
  return chunk;
}

class IngestPages : public testing::TestWithParam<bool> {
 protected:
  /// Creates a database with all sessions open.
  struct Side {
    test::TestDb db;
    std::vector<Uuid> ids;
    Side() {
      EXPECT_OK(db.writer.script("BEGIN"));
      for (std::size_t i = 0; i < kIngestSessions; ++i) {
        ids.push_back(makeUuidV7());
        auto description = test::describe(ids.back());
        description.set_profile_json("{\"text\":\"" + std::string(4000, 'x') + "\"}");
        EXPECT_OK(SessionStore(db.writer).open(description, 1));
      }
      EXPECT_OK(db.writer.script("COMMIT"));
      EXPECT_OK(db.writer.checkpointPassive());
    }
    /// Returns the number of log pages of one transaction.
    template <typename Work>
    std::uint64_t pagesOf(const Work& work) {
      auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
      EXPECT_OK(transaction);
      work(db.writer);
      EXPECT_OK(transaction->commit());
      // This copies the whole log into the database, so that the log starts again.
      Connection::WalProgress progress;
      EXPECT_OK(db.writer.checkpointPassive(&progress));
      EXPECT_EQ(progress.pages, progress.moved);
      return progress.pages;
    }
  };
  Side ours_, raw_;
};

TEST_P(IngestPages, areAtMostAThirdMoreThanOfTheBareRows) {
  const Bytes chunk = chunkOfASecond();
  ASSERT_GE(chunk.size(), 5200u);
  ASSERT_LE(chunk.size(), 5400u);
  const auto samples = static_cast<std::uint64_t>(inspectChunk(chunk)->count);
  std::vector<std::size_t> order(kIngestSessions);
  std::iota(order.begin(), order.end(), 0);
  std::mt19937_64 random(11);
  std::uint64_t our_pages = 0, raw_pages = 0;
  for (std::size_t at = 0; at < kIngestGroups * kIngestGroup; at += kIngestGroup) {
    const auto each = [&](const auto& take) {
      for (std::size_t i = at; i < at + kIngestGroup; ++i)
        take(order[i % kIngestSessions], i / kIngestSessions);
    };
    // stations keep their turn, independent of the order in which their sessions were opened
    if (at == 0 && GetParam()) std::shuffle(order.begin(), order.end(), random);
    our_pages += ours_.pagesOf([&](Connection& connection) {
      each([&](std::size_t session, std::uint64_t seq) {
        const auto appended = SessionStore(connection).append(ours_.ids[session], seq, chunk, "station-1");
        ASSERT_OK(appended);
        ASSERT_EQ(appended->kind, Appended::Kind::kStored) << appended->text;
      });
    });
    raw_pages += raw_.pagesOf([&](Connection& connection) {
      each([&](std::size_t session, std::uint64_t seq) {
        ASSERT_OK(connection.run("INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES (?,?,?,?,?)",
                                 static_cast<std::uint64_t>(session + 1), seq, samples, 1, ByteView(chunk)));
      });
    });
  }
  const auto per_group = [](std::uint64_t pages) {
    return static_cast<double>(pages) / static_cast<double>(kIngestGroups);
  };
  RecordProperty("pages_per_group", std::to_string(per_group(our_pages)));
  std::printf("pages a group of %zu: ours %.1f, bare rows %.1f, ratio %.3f\n", kIngestGroup,
              per_group(our_pages), per_group(raw_pages), per_group(our_pages) / per_group(raw_pages));
  EXPECT_GE(raw_pages, kIngestGroups * kIngestGroup);
  EXPECT_LE(per_group(our_pages), 1.35 * per_group(raw_pages));
}

INSTANTIATE_TEST_SUITE_P(Order, IngestPages, testing::Bool(),
                         [](const auto& order) { return order.param ? "shuffled" : "asOpened"; });

}  // namespace
}  // namespace needlelab
