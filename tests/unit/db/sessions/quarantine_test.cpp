// Chunks with a valid CRC that cannot be decoded: they are kept, the session continues after them, and they
// are never reported as valid or Safe.
#include <cstring>

#include "common/base/bytes.h"
#include "db/audit/audit.h"
#include "db/backup/backup.h"
#include "db/backup/check.h"
#include "db/erasure/retention_store.h"
#include "tests/support/store/chunk_files.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using test::chunkOf;
using test::describe;

std::vector<std::pair<std::string, Bytes>> impossibleChunks() {
  return test::namedChunks(std::filesystem::path(NEEDLELAB_TEST_DATA) / "gesture/refused.tsv");
}

/// The number of samples that a chunk's header claims (FORMAT.md: offset 6).
std::uint64_t claimed(const Bytes& chunk) {
  return (chunk[6] | static_cast<std::uint64_t>(chunk[7]) << 8) + 1;
}

class Quarantine : public testing::Test {
 protected:
  /// A session of these chunks, closed with its station's numbers and hash.
  Uuid closedSession(const std::vector<Bytes>& chunks) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(store.open(describe(id), 5));
    SessionHash hash;
    std::uint64_t samples = 0;
    for (std::uint64_t seq = 0; seq < chunks.size(); ++seq) {
      const auto appended = store.append(id, seq, chunks[seq], "station-1");
      EXPECT_TRUE(appended.ok() && appended->kind == Appended::Kind::kStored &&
                  appended->next_seq == seq + 1);
      hash.update(chunks[seq]);
      samples += claimed(chunks[seq]);
    }
    pb::CloseSession request;
    request.set_session_id(test::bytesOfId(id));
    request.set_chunks(chunks.size());
    request.set_samples(samples);
    request.set_hash(hash.digest().data(), hash.digest().size());
    const auto closed = store.close(request, 77, "station-1");
    EXPECT_TRUE(closed.ok() && closed->kind == Closed::Kind::kClosed) << closed->text;
    return id;
  }
  test::TestDb db;
  SessionStore store{db.writer};
};

TEST_F(Quarantine, everyKindOfImpossibleChunkIsKeptMarkedAndPassedBy) {
  const auto kinds = impossibleChunks();
  ASSERT_GE(kinds.size(), 23u);
  for (const auto& [kind, bad] : kinds) {
    SCOPED_TRACE(kind);
    const Uuid id = makeUuidV7();
    ASSERT_OK(store.open(describe(id), 5));
    ASSERT_OK(store.append(id, 0, chunkOf(0)));
    const auto taken = store.append(id, 1, bad, "station-1");
    ASSERT_OK(taken);
    EXPECT_EQ(taken->kind, Appended::Kind::kStored) << taken->text;
    EXPECT_TRUE(taken->quarantined);
    EXPECT_NE(taken->text.find("chunk 1: "), std::string::npos) << taken->text;
    EXPECT_EQ(store.append(id, 1, bad)->kind, Appended::Kind::kRepeated);
    const auto next = store.append(id, 2, chunkOf(2));
    ASSERT_OK(next);
    EXPECT_EQ(next->kind, Appended::Kind::kStored);
    EXPECT_FALSE(next->quarantined);
    EXPECT_EQ(store.info(id)->quarantined_chunks(), 1u);

    auto row = db.writer.query(
        "SELECT bytes FROM chunks JOIN sessions ON number = session WHERE id = ? AND seq = 1", ByteView(id));
    ASSERT_TRUE(*row.step());
    const ByteView kept = row.bytes(0);
    EXPECT_TRUE(std::equal(kept.begin(), kept.end(), bad.begin(), bad.end())) << "the bytes as they came";

    const auto check = store.verify(id);
    ASSERT_OK(check);
    EXPECT_FALSE(check->ok);
    EXPECT_TRUE(check->faults.empty()) << "nothing was damaged here: " << check->faults.front();
    ASSERT_EQ(check->undecodable.size(), 1u);
    EXPECT_EQ(check->undecodable.front().seq, 1u);
    EXPECT_EQ(check->chunks, 2u);
    EXPECT_EQ(check->samples, 40u);

    const auto around = store.readAround(id, 0, 10, 1 << 20);
    ASSERT_OK(around);
    ASSERT_EQ(around->chunks.size(), 2u);
    EXPECT_EQ(around->chunks.back().seq, 2u);
    ASSERT_EQ(around->damaged.size(), 1u);
    EXPECT_EQ(around->damaged.front().seq, 1u);
  }
}

TEST_F(Quarantine, aSessionWithSuchChunksIsClosedByItsStationsNumbers) {
  const auto kinds = impossibleChunks();
  const Uuid id = closedSession({chunkOf(0), kinds.front().second, chunkOf(2), kinds.back().second});
  const auto info = store.info(id);
  EXPECT_EQ(info->state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(info->chunks(), 4u);
  EXPECT_EQ(info->quarantined_chunks(), 2u);
  EXPECT_EQ(store.verify(id)->undecodable_chunks, 2u);
}

TEST_F(Quarantine, aBackupContainsSuchChunksButStopsSafetyAtThem) {
  const Bytes bad = impossibleChunks().front().second;
  const Uuid sound = closedSession({chunkOf(0), chunkOf(1)});
  const Uuid id = closedSession({chunkOf(0), chunkOf(1), bad, chunkOf(3)});
  const Uuid first = closedSession({bad, chunkOf(1)});
  Connection reader = db.reader();
  const auto target = db.folder.path() / "copy.db";
  const auto result = backupTo(reader, target);
  ASSERT_OK(result);
  EXPECT_EQ(result->undecodable_chunks, 2u);
  EXPECT_EQ(result->chunks_verified, 6u);
  ASSERT_OK(recordBackup(db.writer, *result, target, 9));
  EXPECT_EQ(*store.safeSeqs(sound), 2u);
  EXPECT_EQ(*store.safeSeqs(id), 2u) << "its station keeps chunk 2 and what follows";
  EXPECT_EQ(*store.safeSeqs(first), 0u);
  auto copy = test::TestDb::must(Connection::open(target, {}));
  EXPECT_EQ(SessionStore(copy).info(id)->quarantined_chunks(), 1u);
  const auto check = checkDatabase(copy);
  ASSERT_OK(check);
  EXPECT_TRUE(check->ok()) << "a restore takes it";
  EXPECT_EQ(check->undecodable.size(), 2u);
}

TEST_F(Quarantine, whereAcksAreSafeOnlySuchChunksAndLaterOnesAreUnsafe) {
  const Bytes bad = impossibleChunks().front().second;
  EXPECT_EQ(*store.unsafeChunks(false), 0u);
  EXPECT_EQ(*store.unsafeChunks(true), 0u);
  const Uuid sound = closedSession({chunkOf(0), chunkOf(1)});
  const Uuid open = makeUuidV7();
  ASSERT_OK(store.open(describe(open), 5));
  ASSERT_OK(store.append(open, 0, chunkOf(0)));
  EXPECT_EQ(*store.unsafeChunks(false), 3u) << "there is no backup";
  EXPECT_EQ(*store.unsafeChunks(true), 0u);
  ASSERT_OK(store.append(open, 1, bad));
  closedSession({bad, chunkOf(1), bad});
  EXPECT_EQ(*store.unsafeChunks(false), 7u);
  EXPECT_EQ(*store.unsafeChunks(true), 4u) << "one of the open session, three of the last";
  ASSERT_OK(store.markSafe(sound, 2));
  EXPECT_EQ(*store.unsafeChunks(false), 5u);
  EXPECT_EQ(*store.unsafeChunks(true), 4u);
}

/// Verification decodes and does not rely on the mark.
TEST_F(Quarantine, chunksWithoutAMarkAreFound) {
  const Uuid id = closedSession({chunkOf(0), impossibleChunks().back().second, chunkOf(2)});
  ASSERT_OK(db.writer.script("DELETE FROM quarantined_chunks"));
  EXPECT_FALSE(store.verify(id)->ok);
  Connection reader = db.reader();
  const auto result = backupTo(reader, db.folder.path() / "copy.db");
  ASSERT_OK(result);
  ASSERT_OK(recordBackup(db.writer, *result, db.folder.path() / "copy.db", 9));
  EXPECT_EQ(*store.safeSeqs(id), 1u);
}

TEST_F(Quarantine, aFlippedBitInAQuarantinedChunkIsDamage) {
  const Uuid id = closedSession({chunkOf(0), impossibleChunks().back().second});
  ASSERT_OK(
      db.writer.script("UPDATE chunks SET bytes = " + test::byteReplacedSql(21, "a7") + " WHERE seq = 1"));
  const auto check = store.verify(id);
  ASSERT_OK(check);
  EXPECT_EQ(check->faults.size(), 1u);
  EXPECT_TRUE(check->undecodable.empty());
}

TEST_F(Quarantine, theLogGetsOneLineASession) {
  const Bytes bad = impossibleChunks().front().second;
  const Uuid id = closedSession(std::vector<Bytes>(50, bad));
  const auto lines = AuditStore(db.writer).list(0, 0, {}, "chunk quarantine");
  ASSERT_OK(lines);
  ASSERT_EQ(lines->size(), 1u);
  EXPECT_EQ(lines->front().who, "station-1");
  EXPECT_EQ(lines->front().subject, uuidText(id));
}

/// The rest of an erased person's recording is read before it is removed: such a chunk does not prevent the
/// removal.
TEST_F(Quarantine, doesNotKeepErasedData) {
  const Uuid id = closedSession({chunkOf(0), impossibleChunks().front().second});
  ASSERT_OK(db.writer.script("UPDATE sessions SET recording = 3"));
  RetentionStore retention(db.writer);
  ASSERT_OK(retention.checkSome(id, 16));
  const auto more = retention.removeSome(id, 16);
  ASSERT_OK(more);
  EXPECT_TRUE(*more);
  auto rows =
      db.writer.prepare("SELECT (SELECT count(*) FROM chunks), (SELECT count(*) FROM quarantined_chunks)");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), 0);
  EXPECT_EQ(rows.integer(1), 0);
}

TEST_F(Quarantine, marksGoWithTheirChunks) {
  closedSession({chunkOf(0), impossibleChunks().front().second});
  ASSERT_OK(db.writer.script("DELETE FROM chunks"));
  auto rows = db.writer.prepare("SELECT count(*) FROM quarantined_chunks");
  ASSERT_TRUE(*rows.step());
  EXPECT_EQ(rows.integer(0), 0);
}

/// Bytes that no station of our version sealed are refused as before: they were damaged in transit.
TEST_F(Quarantine, onlySealedChunksOfOurVersionAreKept) {
  const Uuid id = makeUuidV7();
  ASSERT_OK(store.open(describe(id), 5));
  Bytes bad = impossibleChunks().front().second;
  bad.back() ^= 1;
  EXPECT_EQ(store.append(id, 0, bad)->kind, Appended::Kind::kCorrupt);
  Bytes newer = chunkOf(0);
  newer[4] = 4;
  const std::uint32_t crc = crc32c(ByteView(newer).first(newer.size() - 4));
  std::memcpy(newer.data() + newer.size() - 4, &crc, 4);
  const auto refused = store.append(id, 0, newer);
  EXPECT_EQ(refused->kind, Appended::Kind::kCorrupt);
  EXPECT_NE(refused->text.find("version 4"), std::string::npos) << refused->text;
  EXPECT_EQ(store.info(id)->chunks(), 0u);
}

}  // namespace
}  // namespace needlelab
