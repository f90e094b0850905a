// A station moves from one server to another while the first one hangs with data it had sent: when the first
// continues, it stores and acknowledges none of it.
#include <gtest/gtest.h>

#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/base/text/uuid.h"
#include "db/login/credentials.h"
#include "db/sessions/station_claims.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/db/planted_here.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

constexpr const char* kStation = "station-1";
constexpr std::size_t kSamples = 20;

/// A server's answer about what a station sent.
struct Told {
  Status status;
  Appended appended;
  [[nodiscard]] bool isAcknowledged() const { return status.ok() && appended.taken(); }
  [[nodiscard]] bool isDeposed() const {
    return !status.ok() && status.error().code == ErrorCode::kDeposed && !appended.taken();
  }
};

/// A chunk in transit.
struct Sent {
  explicit Sent(std::uint64_t of) : seq(of), bytes(chunkOf(of, kSamples)) {
    appended.kind = Appended::Kind::kUnknownSession;  // until an answer arrives
  }
  std::uint64_t seq;
  Bytes bytes;
  Appended appended;
  std::promise<Status> done;
};

class Takeover : public testing::Test {
 protected:
  Takeover() {
    auto control = TestDb::must(openAt(address_, Connection::Mode::kWriter));
    EXPECT_OK(StationStore(control).add(kStation, StationKeyBytes{}, 1));
  }
  void TearDown() override { bugPlantedHere().reset(); }

  StationClaim logIn(OneServer& server, const char* name) {
    StationClaim claim;
    EXPECT_OK(server.writer().run([&](Connection& c) -> Status {
      ASSIGN_OR_RETURN(claim, StationClaims(c).raise(kStation, name, 1));
      return {};
    }));
    return claim;
  }
  Status open(OneServer& server, const StationClaim& claim) {
    return server.writer().run([&](Connection& c) -> Status {
      RETURN_IF_ERROR(StationClaims(c).require(&claim));
      const auto opened = SessionStore(c).open(describe(session_), 1);
      return opened ? Status() : Status(opened.error());
    });
  }
  /// Posts it like a connection; does not wait.
  void send(OneServer& server, const StationClaim& claim, Sent& sent) {
    ArrivedChunk chunk{session_, sent.seq, sent.bytes, kStation, &sent.appended};
    chunk.claim = &claim;
    const Status posted = server.writer().postChunk(
        std::move(chunk), [&sent](const Status& status) { sent.done.set_value(status); });
    if (!posted) throw std::runtime_error(posted.error().message);
  }
  static Told waitFor(Sent& sent) {
    const Status status = sent.done.get_future().get();
    return {status, sent.appended};
  }
  Told store(OneServer& server, const StationClaim& claim, std::uint64_t seq) {
    Sent sent(seq);
    send(server, claim, sent);
    return waitFor(sent);
  }
  Result<std::optional<CloseOutcome>> close(OneServer& server, const StationClaim& claim,
                                            std::uint64_t chunks) {
    CloseUnderWay close{closeOf(session_, chunks, kSamples), kStation};
    close.claim = std::make_shared<const StationClaim>(claim);
    return server.service().scoring().closeStep(close);
  }
  /// The number of chunk rows, and of distinct ones.
  std::pair<std::int64_t, std::int64_t> stored() {
    auto reader = TestDb::must(openAt(address_, Connection::Mode::kReader));
    auto row = reader.prepare("SELECT count(*), count(DISTINCT seq) FROM chunks");
    EXPECT_TRUE(TestDb::must(row.step()));
    return {row.integer(0), row.integer(1)};
  }

  /// The first server has chunks 1 to 3 and is held before its transaction; meanwhile the station logs in at
  /// the other one and sends chunk 1 again. Returns the first one's answer for each when it continues.
  std::vector<Told> goOnAfterATakeover() {
    const StationClaim old = logIn(first_, "first");
    EXPECT_OK(open(first_, old));
    EXPECT_TRUE(store(first_, old, 0).isAcknowledged());
    first_.gate().arm(0);
    std::deque<Sent> sent;
    for (std::uint64_t seq = 1; seq < 4; ++seq) send(first_, old, sent.emplace_back(seq));
    EXPECT_TRUE(first_.gate().waitForHoldOrEnd());
    const StationClaim now = logIn(other_, "b");
    EXPECT_TRUE(store(other_, now, 1).isAcknowledged());
    first_.gate().release();
    std::vector<Told> told;
    for (Sent& each : sent) told.push_back(waitFor(each));
    // the lesson continues at the other one, from the state there
    for (std::uint64_t seq = 2; seq < 4; ++seq) EXPECT_TRUE(store(other_, now, seq).isAcknowledged());
    const auto closed = close(other_, now, 4);
    EXPECT_OK(closed);
    return told;
  }

  TempFolder folder_;
  PostgresBelow dropped_at_end_{folder_.path()};
  StoreAddress address_{folder_.path() / "data" / "needlelab.db", postgresUrlOf(folder_.path() / "data")};
  // random numbers are constant if other tests of this program ran first
  const Uuid session_ = *uuidOf(std::string("takeover-session"));
  OneServer first_{address_}, other_{address_};
};

TEST_F(Takeover, aServerThatStoodStillStoresAndAcknowledgesNothing) {
  for (const Told& told : goOnAfterATakeover()) EXPECT_TRUE(told.isDeposed()) << told.status.error().message;
  EXPECT_EQ(stored(), (std::pair<std::int64_t, std::int64_t>{4, 4}));
}

TEST_F(Takeover, withoutTheFenceItWouldAcknowledgeThem) {
  bugPlantedHere() = PlantedBug::kTakeoverUnfenced;
  std::size_t acknowledged = 0;
  for (const Told& told : goOnAfterATakeover()) acknowledged += told.isAcknowledged() ? 1 : 0;
  EXPECT_GT(acknowledged, 0u) << "the test above would not see the bug";
}

TEST_F(Takeover, itsCloseAndItsBeginningOfASessionAreRefused) {
  const StationClaim old = logIn(first_, "first");
  EXPECT_OK(open(first_, old));
  EXPECT_TRUE(store(first_, old, 0).isAcknowledged());
  for (const bool is_close : {true, false}) {
    first_.gate().arm(0);
    std::future<Status> late = std::async(std::launch::async, [&]() -> Status {
      if (!is_close) return open(first_, old);
      const auto closed = close(first_, old, 1);
      return closed ? Status() : Status(closed.error());
    });
    EXPECT_TRUE(first_.gate().waitForHoldOrEnd());
    const StationClaim now = logIn(other_, "b");
    first_.gate().release();
    const Status told = late.get();
    ASSERT_FALSE(told.ok()) << is_close;
    EXPECT_EQ(told.error().code, ErrorCode::kDeposed);
    auto reader = TestDb::must(openAt(address_, Connection::Mode::kReader));
    EXPECT_EQ(TestDb::must(SessionStore(reader).info(session_)).state(), pb::SESSION_OPEN);
    EXPECT_TRUE(store(other_, now, 0).isAcknowledged());
  }
}

// the other order: data committed before the other log-in are there, and known to it
TEST_F(Takeover, aTransactionThatIsUnderWayEndsBeforeTheOtherLogIn) {
  const StationClaim old = logIn(first_, "first");
  EXPECT_OK(open(first_, old));
  Sent sent(0);
  // held before its COMMIT, with the store's lock
  first_.gate().arm(2);
  send(first_, old, sent);
  EXPECT_TRUE(first_.gate().waitForHoldOrEnd());
  std::future<StationClaim> log_in = std::async(std::launch::async, [&] { return logIn(other_, "b"); });
  EXPECT_EQ(log_in.wait_for(std::chrono::milliseconds(50)), std::future_status::timeout);
  first_.gate().release();
  EXPECT_TRUE(waitFor(sent).isAcknowledged());
  const StationClaim now = log_in.get();
  EXPECT_EQ(now.epoch, old.epoch + 1);
  const Told again = store(other_, now, 0);
  EXPECT_EQ(again.appended.kind, Appended::Kind::kRepeated);
  EXPECT_EQ(stored(), (std::pair<std::int64_t, std::int64_t>{1, 1}));
}

}  // namespace
}  // namespace needlelab::test
