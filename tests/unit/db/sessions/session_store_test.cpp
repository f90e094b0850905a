#include "db/sessions/session_store.h"

#include <gmock/gmock.h>

#include "db/audit/audit.h"
#include "db/people/people.h"

#include "db/people/person_refs.h"
#include "db/sessions/session_results.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using test::chunkOf;
using test::closeOf;
using test::describe;

class SessionStoreTest : public testing::Test {
 protected:
  void openAndAppend(std::uint64_t chunks) {
    ASSERT_OK(store.open(describe(id), 5));
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      const auto appended = store.append(id, seq, chunkOf(seq));
      ASSERT_OK(appended);
      ASSERT_EQ(appended->kind, Appended::Kind::kStored);
      ASSERT_EQ(appended->next_seq, seq + 1);
    }
  }
  test::TestDb db;
  SessionStore store{db.writer};
  const Uuid id = makeUuidV7();
};

TEST_F(SessionStoreTest, openingTwiceWithTheSameDescriptionGivesTheNextSeq) {
  openAndAppend(3);
  const auto again = store.open(describe(id), 99);
  ASSERT_OK(again);
  EXPECT_EQ(*again, 3u);
  EXPECT_EQ(store.info(id)->received_unix_ns(), 5);
}

TEST_F(SessionStoreTest, openingWithAnotherDescriptionIsRefused) {
  openAndAppend(1);
  auto other = describe(id);
  other.set_trainee("ben");
  const auto refused = store.open(other, 6);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kAlreadyExists);
  auto other_profile = describe(id);
  other_profile.set_profile_json("{}");
  EXPECT_FALSE(store.open(other_profile, 6).ok());
  EXPECT_EQ(*shownName(db.writer, store.info(id)->description().trainee()), "anna");
}

TEST_F(SessionStoreTest, anUnknownStationMayNotOpen) {
  auto d = describe(id);
  d.set_station("nobody");
  const auto refused = store.open(d, 6);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
}

TEST_F(SessionStoreTest, aRepeatedChunkIsStoredOnce) {
  openAndAppend(3);
  const auto again = store.append(id, 1, chunkOf(1));
  ASSERT_OK(again);
  EXPECT_EQ(again->kind, Appended::Kind::kRepeated);
  EXPECT_EQ(again->next_seq, 3u);
  EXPECT_EQ(store.info(id)->chunks(), 3u);
  EXPECT_EQ(store.info(id)->samples(), 60u);
}

TEST_F(SessionStoreTest, aGapIsRefusedAndTheExpectedSeqNamed) {
  openAndAppend(2);
  for (const std::uint64_t seq : {std::uint64_t{3}, std::uint64_t{1} << 62, UINT64_MAX}) {
    const auto gap = store.append(id, seq, chunkOf(3));
    ASSERT_OK(gap);
    EXPECT_EQ(gap->kind, Appended::Kind::kGap);
    EXPECT_EQ(gap->next_seq, 2u);
    EXPECT_FALSE(gap->taken());
    EXPECT_NE(gap->text.find("send 2 first"), std::string::npos) << gap->text;
  }
}

TEST_F(SessionStoreTest, aContradictingChunkIsRefusedAndTheOldOneStays) {
  openAndAppend(2);
  const auto contradiction = store.append(id, 1, chunkOf(7));
  ASSERT_OK(contradiction);
  EXPECT_EQ(contradiction->kind, Appended::Kind::kContradiction);
  EXPECT_EQ(store.readChunks(id, 1, 1, 1 << 20)->front().bytes, chunkOf(1));
}

TEST_F(SessionStoreTest, aPrefixOfAStoredChunkIsAContradiction) {
  openAndAppend(1);
  auto cut = chunkOf(0);
  cut.pop_back();
  EXPECT_EQ(store.append(id, 0, cut)->kind, Appended::Kind::kContradiction);
  EXPECT_EQ(store.append(id, 0, {})->kind, Appended::Kind::kContradiction);
}

// A single byte must not make the writer, for which everyone waits, read a stored megabyte.
TEST_F(SessionStoreTest, aContradictionOfAnotherLengthReadsNoStoredChunk) {
  constexpr std::size_t kLong = 900'000;
  openAndAppend(1);
  ASSERT_OK(db.writer.run("UPDATE chunks SET bytes = zeroblob(?)", kLong));
  const auto pagesRead = [&](ByteView sent) {
    int hits = 0, misses = 0, most = 0;
    const auto look = [&](int what, int& count) {
      EXPECT_EQ(sqlite3_db_status(db.writer.handle(), what, &count, &most, 1), SQLITE_OK);
    };
    look(SQLITE_DBSTATUS_CACHE_HIT, hits);
    look(SQLITE_DBSTATUS_CACHE_MISS, misses);
    EXPECT_EQ(store.append(id, 0, sent, "station-1")->kind, Appended::Kind::kContradiction);
    look(SQLITE_DBSTATUS_CACHE_HIT, hits);
    look(SQLITE_DBSTATUS_CACHE_MISS, misses);
    return hits + misses;
  };
  const Bytes one = {'x'}, as_long(kLong, 'x');
  (void)pagesRead(one);  // the first one writes a line to the log
  EXPECT_LT(pagesRead(one), 50);
  EXPECT_GT(pagesRead(as_long), 100) << "the count sees what is read";
}

TEST_F(SessionStoreTest, allContradictionsOfASessionGiveOneLineInTheLog) {
  openAndAppend(2);
  const auto lines = [&] { return AuditStore(db.writer).list(0, 0, {}, "chunk contradicts"); };
  const auto contradict = [&](const Uuid& session, std::uint64_t seq, ByteView bytes) {
    const auto refused = store.append(session, seq, bytes, "station-1");
    ASSERT_OK(refused);
    EXPECT_EQ(refused->kind, Appended::Kind::kContradiction);
  };
  const Bytes one = {'x'};
  for (int n = 0; n < 100; ++n) contradict(id, static_cast<std::uint64_t>(n % 2), one);
  ASSERT_OK(store.close(closeOf(id, 2), 7));
  for (int n = 0; n < 100; ++n) contradict(id, 2, chunkOf(2));
  ASSERT_EQ(lines()->size(), 1u);
  EXPECT_EQ(lines()->front().who, "station-1");
  EXPECT_EQ(lines()->front().subject, uuidText(id));
  EXPECT_NE(lines()->front().detail.find("chunk 0 is stored with other bytes"), std::string::npos);

  const Uuid other = makeUuidV7();
  ASSERT_OK(store.open(describe(other), 5));
  ASSERT_OK(store.append(other, 0, chunkOf(0)));
  contradict(other, 0, one);
  ASSERT_EQ(lines()->size(), 2u) << "one line a session, not one in all";
  EXPECT_EQ(lines()->front().subject, uuidText(other));
}

TEST_F(SessionStoreTest, everyDamagedByteOfAChunkIsNoticed) {
  openAndAppend(0);
  const Bytes good = chunkOf(0);
  for (std::size_t i = 0; i < good.size(); ++i) {
    Bytes bad = good;
    bad[i] ^= 0x10;
    const auto refused = store.append(id, 0, bad);
    ASSERT_OK(refused);
    ASSERT_EQ(refused->kind, Appended::Kind::kCorrupt) << "byte " << i;
  }
  EXPECT_EQ(store.append(id, 0, {})->kind, Appended::Kind::kCorrupt);
  EXPECT_EQ(store.append(id, 0, Bytes(kMaxStoredChunkBytes + 1))->kind, Appended::Kind::kCorrupt);
  EXPECT_EQ(*store.nextSeq(id), 0u);
}

TEST_F(SessionStoreTest, chunksOfUnknownSessionsAndOfOtherStationsAreRefused) {
  EXPECT_EQ(store.append(id, 0, chunkOf(0))->kind, Appended::Kind::kUnknownSession);
  openAndAppend(1);
  EXPECT_EQ(store.append(id, 1, chunkOf(1), "station-2")->kind, Appended::Kind::kUnknownSession);
  EXPECT_EQ(store.append(id, 1, chunkOf(1), "station-1")->kind, Appended::Kind::kStored);
}

TEST_F(SessionStoreTest, closesWhenAllIsThereAndTheHashAgrees) {
  openAndAppend(4);
  const auto closed = store.close(closeOf(id, 4), 77);
  ASSERT_OK(closed);
  EXPECT_EQ(closed->kind, Closed::Kind::kClosed) << closed->text;
  EXPECT_EQ(closed->state, pb::SESSION_COMPLETE);
  const auto info = store.info(id);
  EXPECT_EQ(info->state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(info->hash(), closeOf(id, 4).hash());
  EXPECT_EQ(info->closed_unix_ns(), 77);
  EXPECT_EQ(info->samples(), 80u);
  // again, like a station that lost the answer
  EXPECT_EQ(store.close(closeOf(id, 4), 99)->kind, Closed::Kind::kRepeated);
  EXPECT_EQ(store.info(id)->closed_unix_ns(), 77);
}

TEST_F(SessionStoreTest, theCountersAreInOneTableAtATime) {
  const auto counted = [&](const std::string& sql) {
    auto row = db.writer.prepare(sql);
    std::string text;
    while (*row.step()) text += row.text(0) + " " + row.text(1) + " " + row.text(2) + ";";
    return text;
  };
  const std::string in_progress = "SELECT chunks, samples, stored_bytes FROM session_progress";
  const std::string in_session = "SELECT chunks, samples, stored_bytes FROM sessions";
  const std::string sums = "2 40 " + std::to_string(chunkOf(0).size() + chunkOf(1).size()) + ";";
  ASSERT_OK(store.open(describe(id), 1));
  EXPECT_EQ(counted(in_progress), "0 0 0;");
  for (std::uint64_t seq = 0; seq < 2; ++seq) ASSERT_OK(store.append(id, seq, chunkOf(seq)));
  EXPECT_EQ(counted(in_progress), sums);
  EXPECT_EQ(counted(in_session), "0 0 0;");
  const auto open = store.info(id);
  ASSERT_OK(open);
  ASSERT_EQ(store.close(closeOf(id, 2), 1)->kind, Closed::Kind::kClosed);
  EXPECT_EQ(counted(in_progress), "");
  EXPECT_EQ(counted(in_session), sums);
  // A reader of the session sees no difference.
  const auto closed = store.info(id);
  ASSERT_OK(closed);
  EXPECT_EQ(open->chunks(), closed->chunks());
  EXPECT_EQ(open->samples(), closed->samples());
  EXPECT_EQ(open->stored_bytes(), closed->stored_bytes());
}

TEST_F(SessionStoreTest, anOpenSessionWithoutCountersTakesNothing) {
  ASSERT_OK(store.open(describe(id), 1));
  ASSERT_OK(db.writer.script("DELETE FROM session_progress"));
  const auto refused = store.append(id, 0, chunkOf(0));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_NE(refused.error().message.find("counters"), std::string::npos) << refused.error().message;
  const auto unclosed = store.close(closeOf(id, 0), 1);
  ASSERT_FALSE(unclosed.ok());
  EXPECT_EQ(unclosed.error().code, ErrorCode::kCorrupt);
}

TEST_F(SessionStoreTest, closingAfterARestartIsInterrupted) {
  openAndAppend(1);
  auto request = closeOf(id, 1);
  request.set_interrupted(true);
  EXPECT_EQ(store.close(request, 1)->state, pb::SESSION_INTERRUPTED);
  EXPECT_TRUE(store.openSessions("station-1")->empty());
}

TEST_F(SessionStoreTest, closingTooEarlyNamesTheMissingChunk) {
  openAndAppend(2);
  const auto early = store.close(closeOf(id, 4), 1);
  ASSERT_OK(early);
  EXPECT_EQ(early->kind, Closed::Kind::kIncomplete);
  EXPECT_EQ(early->next_seq, 2u);
  EXPECT_EQ(store.info(id)->state(), pb::SESSION_OPEN);
}

TEST_F(SessionStoreTest, closingWithWrongNumbersOrHashLeavesTheSessionOpen) {
  openAndAppend(3);
  auto wrong_hash = closeOf(id, 3);
  (*wrong_hash.mutable_hash())[5] ^= 1;
  auto short_hash = closeOf(id, 3);
  short_hash.set_hash("abc");
  auto wrong_samples = closeOf(id, 3);
  wrong_samples.set_samples(59);
  auto fewer = closeOf(id, 2);
  for (const auto& request : {wrong_hash, short_hash, wrong_samples, fewer}) {
    const auto refused = store.close(request, 1);
    ASSERT_OK(refused);
    EXPECT_EQ(refused->kind, Closed::Kind::kContradiction) << refused->text;
  }
  EXPECT_EQ(store.info(id)->state(), pb::SESSION_OPEN);
  EXPECT_EQ(store.close(closeOf(id, 3), 1)->kind, Closed::Kind::kClosed);
}

TEST_F(SessionStoreTest, aReadersHashIsUsedOnlyIfItCoversAllChunks) {
  openAndAppend(3);
  auto reader = db.reader();
  const auto part = SessionStore(reader).hashChunks(id, 2), all = SessionStore(reader).hashChunks(id, 3);
  ASSERT_OK(part);
  ASSERT_OK(all);
  for (const auto& known : {std::optional(*part), std::optional<HashedChunks>()}) {
    const auto refused = store.closeHashed(closeOf(id, 3), 1, "station-1", known);
    ASSERT_OK(refused);
    EXPECT_EQ(refused->kind, Closed::Kind::kNotHashed);
    EXPECT_FALSE(refused->taken());
    EXPECT_THAT(refused->text, testing::HasSubstr("chunks came meanwhile"));
  }
  EXPECT_EQ(store.info(id)->state(), pb::SESSION_OPEN);
  EXPECT_EQ(store.closeHashed(closeOf(id, 3), 1, "station-1", *all)->kind, Closed::Kind::kClosed);
  EXPECT_EQ(store.closeHashed(closeOf(id, 3), 1, "station-1", {})->kind, Closed::Kind::kRepeated);
}

TEST_F(SessionStoreTest, aSessionIsHashedInPiecesThatGoOnBehindEachOther) {
  openAndAppend(5);
  auto reader = db.reader();
  SessionStore readers(reader);
  const std::uint64_t each = chunkOf(0).size() + SessionStore::kHashedChunkBytes;
  HashSoFar so_far;
  // the chunk that reaches the bound is the last one; chunks differ by a few bytes
  ASSERT_OK(readers.hashOn(id, 5, 2 * each - SessionStore::kHashedChunkBytes, so_far));
  EXPECT_EQ(so_far.chunks, 2u);
  EXPECT_EQ(so_far.bytes, chunkOf(0).size() + chunkOf(1).size());
  EXPECT_EQ(so_far.result().hash, readers.hashChunks(id, 2)->hash);
  ASSERT_OK(readers.hashOn(id, 4, UINT64_MAX, so_far));
  EXPECT_EQ(so_far.chunks, 4u);
  ASSERT_OK(readers.hashOn(id, 5, UINT64_MAX, so_far));
  EXPECT_EQ(so_far.samples, 100u);
  EXPECT_EQ(textOf(so_far.result().hash), closeOf(id, 5).hash());
  EXPECT_EQ(readers.hashOn(id, 6, UINT64_MAX, so_far).error().code, ErrorCode::kNotFound);
}

TEST_F(SessionStoreTest, aSessionWithoutChunksCanBeClosed) {
  openAndAppend(0);
  EXPECT_EQ(store.close(closeOf(id, 0), 1)->kind, Closed::Kind::kClosed);
}

TEST_F(SessionStoreTest, unknownSessionsCannotBeClosed) {
  EXPECT_EQ(store.close(closeOf(id, 0), 1)->kind, Closed::Kind::kUnknownSession);
  pb::CloseSession nonsense;
  nonsense.set_session_id("short");
  EXPECT_EQ(store.close(nonsense, 1)->kind, Closed::Kind::kUnknownSession);
  openAndAppend(1);
  EXPECT_EQ(store.close(closeOf(id, 1), 1, "station-2")->kind, Closed::Kind::kUnknownSession);
}

TEST_F(SessionStoreTest, aClosedSessionTakesRepeatsButNothingNew) {
  openAndAppend(2);
  ASSERT_OK(store.close(closeOf(id, 2), 1));
  EXPECT_EQ(store.append(id, 1, chunkOf(1))->kind, Appended::Kind::kRepeated);
  EXPECT_EQ(store.append(id, 2, chunkOf(2))->kind, Appended::Kind::kContradiction);
  EXPECT_EQ(store.close(closeOf(id, 3), 1)->kind, Closed::Kind::kContradiction);
}

TEST_F(SessionStoreTest, theSmallestRoundTripWins) {
  openAndAppend(0);
  ASSERT_OK(store.setClockOffset(id, 100, 50'000));
  ASSERT_OK(store.setClockOffset(id, 200, 60'000));
  EXPECT_EQ(store.info(id)->clock_offset_ns(), 100);
  ASSERT_OK(store.setClockOffset(id, -300, 40'000));
  EXPECT_EQ(store.info(id)->clock_offset_ns(), -300);
  EXPECT_EQ(store.info(id)->clock_round_trip_ns(), 40'000);
  EXPECT_FALSE(store.setClockOffset(id, 0, 0).ok());
  EXPECT_FALSE(store.setClockOffset(makeUuidV7(), 0, 5).ok());
}

TEST_F(SessionStoreTest, theScoreIsKept) {
  openAndAppend(0);
  ASSERT_OK(ScoreStore(db.writer).put(test::scoreOf(id, "[{\"measure\":\"elapsed_s\"}]")));
  EXPECT_EQ(store.info(id)->score_json(), "[{\"measure\":\"elapsed_s\"}]");
  EXPECT_EQ(ScoreStore(db.writer).put(test::scoreOf(makeUuidV7(), "[]")).error().code, ErrorCode::kNotFound);
}

TEST_F(SessionStoreTest, theSafeMarkNeverMovesBack) {
  openAndAppend(3);
  EXPECT_EQ(*store.safeSeqs(id), 0u);
  ASSERT_OK(store.markSafe(id, 2));
  ASSERT_OK(store.markSafe(id, 1));
  EXPECT_EQ(*store.safeSeqs(id), 2u);
}

TEST_F(SessionStoreTest, openSessionsOfAStationAreThoseNotClosed) {
  openAndAppend(2);
  const Uuid second = makeUuidV7();
  ASSERT_OK(store.open(describe(second), 5));
  auto open = store.openSessions("station-1");
  ASSERT_OK(open);
  ASSERT_EQ(open->size(), 2u);
  EXPECT_EQ((*open)[0].next_seq(), 2u);
  ASSERT_OK(store.close(closeOf(id, 2), 1));
  open = store.openSessions("station-1");
  ASSERT_EQ(open->size(), 1u);
  EXPECT_EQ((*open)[0].session_id(), test::bytesOfId(second));
  EXPECT_TRUE(store.openSessions("station-2")->empty());
}

TEST(SessionStore, aDisabledTraineeCanOnlyContinueAKnownSession) {
  test::TestDb db;
  PeopleStore people(db.writer);
  ASSERT_OK(people.add({"anna", pb::TRAINEE, "", false, 1}));
  SessionStore sessions(db.writer);
  auto d = test::describe(makeUuidV7());  // anna's
  ASSERT_OK(sessions.open(d, 5));
  const auto disabled_unix_ns = d.started_unix_ns() + 1'000;
  ASSERT_OK(people.setDisabled("anna", true, "ada", disabled_unix_ns));
  EXPECT_OK(sessions.open(d, 6));  // the station asks again
  auto earlier = test::describe(makeUuidV7());
  EXPECT_OK(sessions.open(earlier, 7));  // recorded earlier, without the server
  auto later = test::describe(makeUuidV7());
  later.set_started_unix_ns(disabled_unix_ns);
  const auto refused = sessions.open(later, 8);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kDenied);
  EXPECT_NE(refused.error().message.find("'anna' is disabled"), std::string::npos);
  ASSERT_OK(people.setDisabled("anna", false, "ada", disabled_unix_ns + 1));
  EXPECT_OK(sessions.open(later, 9));  // enabled again
}

}  // namespace
}  // namespace needlelab
