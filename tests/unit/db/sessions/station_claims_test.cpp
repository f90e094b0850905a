// If several servers work on one database, the one where a station last logged in stores its sessions.
#include "db/sessions/station_claims.h"

#include <gmock/gmock.h>

#include <deque>
#include <vector>

#include "db/sessions/db_writer.h"
#include "tests/unit/db/planted_here.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// In a transaction, like a log-in.
StationClaim logIn(Connection& writer, const std::string& server, const std::string& station = "station-1") {
  auto transaction = test::TestDb::must(Transaction::begin(writer, Transaction::Kind::kWrite));
  auto claim = test::TestDb::must(StationClaims(writer).raise(station, server, 1));
  EXPECT_OK(transaction.commit());
  return claim;
}

TEST(StationClaims, eachLogInIsNewerThanAllBeforeIt) {
  test::TestDb db;
  StationClaims claims(db.writer);
  EXPECT_FALSE(test::TestDb::must(claims.newest("station-1")).has_value());
  const StationClaim first = logIn(db.writer, "first");
  EXPECT_EQ(first, (StationClaim{"station-1", "first", 1}));
  EXPECT_OK(claims.require(&first));
  const StationClaim elsewhere = logIn(db.writer, "b");
  EXPECT_EQ(elsewhere.epoch, 2);
  EXPECT_EQ(test::TestDb::must(claims.newest("station-1")), elsewhere);
  EXPECT_OK(claims.require(&elsewhere));
  const Status old = claims.require(&first);
  ASSERT_FALSE(old.ok());
  EXPECT_EQ(old.error().code, ErrorCode::kDeposed);
  EXPECT_THAT(old.error().message,
              HasSubstr("station 'station-1' has logged in again since, at the server 'b'"));
  // also at the same server
  const StationClaim again = logIn(db.writer, "b");
  EXPECT_OK(claims.require(&again));
  EXPECT_THAT(claims.require(&elsewhere).error().message, HasSubstr("at this server"));
}

TEST(StationClaims, aDelayedLogInDoesNotSupersedeALaterClaim) {
  test::TestDb db;
  StationClaims claims(db.writer);
  const auto raiseSince = [&](const std::optional<StationClaim>& seen, const std::string& server) {
    auto transaction = test::TestDb::must(Transaction::begin(db.writer, Transaction::Kind::kWrite));
    auto raised = claims.raiseSince(seen, "station-1", server, 1);
    if (raised.ok()) EXPECT_OK(transaction.commit());
    return raised;
  };
  const auto first = test::TestDb::must(raiseSince(std::nullopt, "first"));
  EXPECT_EQ(first.epoch, 1);
  // no log-in in the meantime
  const auto elsewhere = test::TestDb::must(raiseSince(first, "b"));
  EXPECT_EQ(elsewhere.epoch, 2);
  const auto late = raiseSince(first, "first");
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kDeposed);
  EXPECT_THAT(late.error().message, HasSubstr("at the server 'b' while this log-in waited"));
  EXPECT_FALSE(raiseSince(std::nullopt, "first").ok());
  // among one server's log-ins the newest counts; that server ensures this
  EXPECT_EQ(test::TestDb::must(raiseSince(first, "b")).epoch, 3);
}

TEST(StationClaims, stationsHaveTheirOwn) {
  test::TestDb db;
  ASSERT_OK(StationStore(db.writer).add("station-2", StationKeyBytes{}, 1));
  const StationClaim one = logIn(db.writer, "first"), two = logIn(db.writer, "b", "station-2");
  EXPECT_EQ(two.epoch, 1);
  EXPECT_OK(StationClaims(db.writer).require(&one));
  EXPECT_FALSE(StationClaims(db.writer).raise("station-3", "b", 1).ok()) << "there is no such station";
}

// a database that is behind (a lagging standby that was promoted) gives the same number twice
TEST(StationClaims, theSameNumberOfAnotherServerIsAnotherClaim) {
  test::TestDb db;
  const StationClaim lost{"station-1", "first", 1};
  EXPECT_EQ(StationClaims(db.writer).require(&lost).error().code, ErrorCode::kDeposed) << "it has none";
  logIn(db.writer, "b");
  EXPECT_EQ(StationClaims(db.writer).require(&lost).error().code, ErrorCode::kDeposed);
  EXPECT_OK(StationClaims(db.writer).require(nullptr));
}

/// A chunk on its way to the writer, with the log-in that sent it.
struct ClaimedChunk {
  Uuid session{};
  std::uint64_t seq = 0;
  std::optional<StationClaim> claim;
  Bytes bytes = test::chunkOf(seq);
  Appended appended{};
  Status status = Error{ErrorCode::kFailed, "not done"};
};

class FencedChunks : public testing::Test {
 protected:
  void SetUp() override {
    for (const Uuid& id : {one_, other_}) ASSERT_OK(SessionStore(db_.writer).open(test::describe(id), 1));
    old_ = logIn(db_.writer, "first");
    now_ = logIn(db_.writer, "b");
  }
  void TearDown() override { test::bugPlantedHere().reset(); }

  ClaimedChunk& arrives(const Uuid& session, std::uint64_t seq, const std::optional<StationClaim>& claim) {
    return arrivals_.emplace_back(ClaimedChunk{session, seq, claim});
  }
  static void post(DbWriter& writer, ClaimedChunk& arrival) {
    ArrivedChunk chunk{arrival.session, arrival.seq, arrival.bytes, "station-1", &arrival.appended};
    if (arrival.claim) chunk.claim = &*arrival.claim;
    EXPECT_OK(
        writer.postChunk(std::move(chunk), [&arrival](const Status& status) { arrival.status = status; }));
  }
  /// Stores everything that arrived as one group.
  void store() {
    DbWriter writer(test::TestDb::must(openAt(db_.address, Connection::Mode::kWriter)), {.window = 1h}, {});
    for (ClaimedChunk& arrival : arrivals_) post(writer, arrival);
    writer.stop();
    EXPECT_EQ(writer.counters().commits, 1u);
  }
  static void expectStored(const ClaimedChunk& arrival) {
    ASSERT_OK(arrival.status);
    EXPECT_EQ(arrival.appended.kind, Appended::Kind::kStored);
  }
  static void expectDeposed(const ClaimedChunk& arrival) {
    ASSERT_FALSE(arrival.status.ok()) << "it would be acknowledged";
    EXPECT_EQ(arrival.status.error().code, ErrorCode::kDeposed);
  }
  std::uint64_t next(const Uuid& session) {
    return test::TestDb::must(SessionStore(db_.writer).nextSeq(session));
  }

  test::TestDb db_;
  const Uuid one_ = makeUuidV7(), other_ = makeUuidV7();
  StationClaim old_, now_;
  std::deque<ClaimedChunk> arrivals_;  // their addresses must not change
};

TEST_F(FencedChunks, ofAnOlderLogInAreNotStored) {
  for (std::uint64_t seq = 0; seq < 3; ++seq) {
    arrives(one_, seq, old_);
    arrives(other_, seq, now_);
  }
  store();
  for (const ClaimedChunk& arrival : arrivals_)
    arrival.session == one_ ? expectDeposed(arrival) : expectStored(arrival);
  EXPECT_EQ(next(one_), 0u);
  EXPECT_EQ(next(other_), 3u);
}

// the station has sent them to its current server: they are stored, but must not be acknowledged here
TEST_F(FencedChunks, ofAnOlderLogInAreNotAcknowledgedEvenIfStored) {
  for (std::uint64_t seq = 0; seq < 2; ++seq) arrives(one_, seq, now_);
  for (std::uint64_t seq = 0; seq < 2; ++seq) arrives(one_, seq, old_);
  arrives(one_, 2, now_);
  store();
  for (const ClaimedChunk& arrival : arrivals_)
    arrival.claim == old_ ? expectDeposed(arrival) : expectStored(arrival);
  EXPECT_EQ(next(one_), 3u);
}

TEST_F(FencedChunks, withoutAClaimAreStoredAsByAServerThatIsAlone) {
  arrives(one_, 0, std::nullopt);
  store();
  expectStored(arrivals_.front());
}

TEST_F(FencedChunks, aLogInAmongThemCountsFromItsPlaceOn) {
  arrives(one_, 0, now_);
  arrives(one_, 1, now_);
  StationClaim newer;
  {
    DbWriter writer(test::TestDb::must(openAt(db_.address, Connection::Mode::kWriter)), {.window = 1h}, {});
    post(writer, arrivals_[0]);
    ASSERT_OK(writer.post(
        [&](Connection& connection) -> Status {
          ASSIGN_OR_RETURN(newer, StationClaims(connection).raise("station-1", "c", 2));
          return {};
        },
        {}));
    post(writer, arrivals_[1]);
    writer.stop();
    EXPECT_EQ(writer.counters().commits, 1u);
  }
  expectStored(arrivals_[0]);
  expectDeposed(arrivals_[1]);
  EXPECT_EQ(newer.epoch, now_.epoch + 1);
  EXPECT_EQ(next(one_), 1u);
}

// what the tests above would see without the fence
TEST_F(FencedChunks, aPlantedBugStoresThem) {
  test::bugPlantedHere() = PlantedBug::kTakeoverUnfenced;
  arrives(one_, 0, old_);
  store();
  expectStored(arrivals_.front());
}

}  // namespace
}  // namespace needlelab
