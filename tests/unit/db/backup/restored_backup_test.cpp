#include "db/backup/foreign_database.h"

#include <gmock/gmock.h>

#include "db/audit/audit.h"
#include "db/store/schema.h"
#include "db/store/store_address.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// The lab's database, and another into which its backup was restored.
class RestoredBackupTest : public testing::Test {
 protected:
  void SetUp() override {
    for (test::TestDb* db : {&live, &restored}) ASSERT_OK(MetaStore(db->writer).set(kLabKey, "lab-1"));
    put(live, 5);
    put(restored, 5);
  }
  /// Stores the session's chunks from the next one up to `chunks`, as the station sent them.
  void put(test::TestDb& db, std::uint64_t chunks) {
    SessionStore store(db.writer);
    ASSERT_OK(store.open(test::describe(id), 1));
    for (std::uint64_t seq = *store.nextSeq(id); seq < chunks; ++seq)
      ASSERT_OK(store.append(id, seq, test::chunkOf(seq)));
  }
  void close(test::TestDb& db, std::uint64_t chunks) {
    ASSERT_OK(SessionStore(db.writer).close(test::closeOf(id, chunks), 9));
  }
  Result<RestoredBackup> compare() {
    Connection here = live.reader(), there = restored.reader();
    return compareRestored(here, there);
  }
  /// The watermark after the comparison was recorded.
  std::uint64_t safeAfter() {
    const auto compared = compare();
    EXPECT_OK(compared);
    if (compared.ok()) EXPECT_OK(recordRestored(live.writer, *compared, 1'000));
    return *SessionStore(live.writer).safeSeqs(id);
  }
  void expectRefused(ErrorCode code, const std::string& why) {
    const auto compared = compare();
    ASSERT_FALSE(compared.ok());
    EXPECT_EQ(compared.error().code, code);
    EXPECT_THAT(compared.error().message, HasSubstr(why));
    EXPECT_EQ(*SessionStore(live.writer).safeSeqs(id), 0u);
  }
  test::TestDb live, restored;
  const Uuid id = makeUuidV7();
};

TEST_F(RestoredBackupTest, anOpenSessionsLastChunkIsNotSafe) {
  EXPECT_EQ(safeAfter(), 4u);
  put(live, 8);
  EXPECT_EQ(safeAfter(), 4u) << "what came after the backup is not in it";
  put(restored, 8);
  EXPECT_EQ(safeAfter(), 7u);
}

TEST_F(RestoredBackupTest, aSessionThatWasClosedAfterTheBackupIsNotWhollySafe) {
  close(live, 5);
  EXPECT_EQ(safeAfter(), 4u);
  close(restored, 5);
  EXPECT_EQ(safeAfter(), 5u);
}

TEST_F(RestoredBackupTest, aBackupThatHasMoreThanTheLabCoversWhatBothHave) {
  put(restored, 9);
  EXPECT_EQ(safeAfter(), 5u);
}

TEST_F(RestoredBackupTest, anOlderBackupDoesNotLowerTheWatermark) {
  put(restored, 8);
  put(live, 8);
  EXPECT_EQ(safeAfter(), 7u);
  test::TestDb older;
  ASSERT_OK(MetaStore(older.writer).set(kLabKey, "lab-1"));
  put(older, 3);
  Connection here = live.reader(), there = older.reader();
  const auto compared = compareRestored(here, there);
  ASSERT_OK(compared);
  EXPECT_TRUE(compared->result.covered.empty());
  ASSERT_OK(recordRestored(live.writer, *compared, 1'001));
  EXPECT_EQ(*SessionStore(live.writer).safeSeqs(id), 7u);
}

TEST_F(RestoredBackupTest, aChunkThatDiffersMakesNothingSafe) {
  // consistent in itself, but different from the lab's
  const Uuid other = makeUuidV7();
  for (test::TestDb* db : {&live, &restored}) {
    SessionStore store(db->writer);
    ASSERT_OK(store.open(test::describe(other), 1));
    for (std::uint64_t seq = 0; seq < 3; ++seq)
      ASSERT_OK(store.append(other, seq, test::chunkOf(seq, db == &live ? 20 : 21)));
  }
  expectRefused(ErrorCode::kCorrupt,
                "session " + uuidText(other) + ": chunk 0 of the restored database is not the lab's");
}

TEST_F(RestoredBackupTest, aChunkThatIsDamagedThereMakesNothingSafe) {
  ASSERT_OK(restored.writer.run("UPDATE chunks SET crc = crc + 1 WHERE seq = 2"));
  expectRefused(ErrorCode::kCorrupt, "fails the check");
}

TEST_F(RestoredBackupTest, aSessionErasedFromTheLabCoversNothing) {
  const Uuid erased = makeUuidV7();
  SessionStore store(restored.writer);
  ASSERT_OK(store.open(test::describe(erased), 1));
  for (std::uint64_t seq = 0; seq < 3; ++seq) ASSERT_OK(store.append(erased, seq, test::chunkOf(seq)));
  const auto compared = compare();
  ASSERT_OK(compared);
  ASSERT_EQ(compared->result.covered.size(), 1u);
  EXPECT_EQ(compared->result.covered[0].session, id);
  EXPECT_EQ(compared->result.chunks_verified, 8u);
}

TEST_F(RestoredBackupTest, theLabsOwnDatabaseIsNoBackup) {
  Connection here = live.reader(), there = live.reader();
  const auto compared = compareRestored(here, there);
  ASSERT_FALSE(compared.ok());
  EXPECT_EQ(compared.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(compared.error().message, HasSubstr("the lab's own database"));
}

TEST_F(RestoredBackupTest, anotherLabsBackupIsRefused) {
  ASSERT_OK(MetaStore(restored.writer).set(kLabKey, "lab-2"));
  expectRefused(ErrorCode::kInvalidInput, "belongs to the lab 'lab-2', this one is 'lab-1'");
}

TEST_F(RestoredBackupTest, theBackupsAgeIsThatOfItsContents) {
  const auto at = [&](std::int64_t unix_ns, std::int64_t now_unix_ns) {
    EXPECT_OK(AuditStore(restored.writer).add({0, unix_ns, "ada", "log in", "", ""}));
    const auto compared = compare();
    EXPECT_OK(compared);
    EXPECT_OK(recordRestored(live.writer, *compared, now_unix_ns));
    return **MetaStore(live.writer).get("backup_unix_ns");
  };
  EXPECT_EQ(at(500, 1'000), "500");
  EXPECT_EQ(at(700, 1'000), "700");
  EXPECT_EQ(at(5'000, 1'000), "1000") << "a clock that was ahead makes no backup of tomorrow";
  ASSERT_OK(MetaStore(live.writer).set("backup_unix_ns", "9000"));
  EXPECT_EQ(at(6'000, 6'000), "9000") << "an older one does not hide a newer one";
}

TEST_F(RestoredBackupTest, itCanBeGivenUp) {
  const std::atomic<bool> cancelled = true;
  Connection here = live.reader(), there = restored.reader();
  const auto compared = compareRestored(here, there, &cancelled);
  ASSERT_FALSE(compared.ok());
  EXPECT_EQ(compared.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace needlelab
