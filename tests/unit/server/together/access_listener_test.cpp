#include "server/together/access_listener.h"

#include <gmock/gmock.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/time/fake_time.h"
#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A database that others change, and a connection to it on the fake clock.
struct FakeDatabase {
  explicit FakeDatabase(test::FakeTime& clock) : time(clock) {}
  test::FakeTime& time;
  std::vector<AccessChange> changes;  ///< by number
  bool answers = true;                ///< whether it can be reached
  bool tells = true;                  ///< whether a NOTIFY arrives
  bool is_told = false;               ///< whether one is waiting
  bool breaks = false;                ///< whether the connection is lost at the next call
  std::string fault;
  int connections = 0;
  std::function<void()> at_listen;  ///< called once the next connection listens
  std::function<void()> at_try;     ///< called on connecting

  void change(const std::string& name, const std::string& server = "") {
    const auto number = static_cast<std::int64_t>(changes.empty() ? 1 : changes.back().number + 1);
    changes.push_back({number, AccessKind::kPerson, name, "password", server});
    is_told = tells;
  }
};

class FakeFeed final : public AccessFeed {
 public:
  explicit FakeFeed(FakeDatabase& database) : db_(database) {}
  Status connect() override {
    if (db_.at_try) db_.at_try();
    if (!db_.answers) return lost();
    db_.breaks = false;
    db_.is_told = false;  // notifications in the meantime are missed
    ++db_.connections;
    if (auto act = std::exchange(db_.at_listen, {})) act();
    return {};
  }
  Result<std::string> fault() override {
    if (isLost()) return lost();
    return db_.fault;
  }
  Result<bool> wait(milliseconds patience) override {
    if (isLost()) return lost();
    if (std::exchange(db_.is_told, false)) return true;
    db_.time.advance(std::chrono::nanoseconds(patience).count());
    return false;
  }
  Result<std::int64_t> last() override {
    if (isLost()) return lost();
    return db_.changes.empty() ? 0 : db_.changes.back().number;
  }
  Result<std::vector<AccessChange>> after(std::int64_t number) override {
    if (isLost()) return lost();
    std::vector<AccessChange> some;
    for (const AccessChange& change : db_.changes)
      if (change.number > number) some.push_back(change);
    return some;
  }

 private:
  [[nodiscard]] bool isLost() const { return db_.breaks || !db_.answers; }
  static Error lost() { return {ErrorCode::kUnavailable, "no connection"}; }
  FakeDatabase& db_;
};

class AccessListenerTest : public testing::Test {
 protected:
  void turns(int count) {
    for (int i = 0; i < count; ++i) listener.turn();
  }
  /// Runs until `done`; returns the time taken on the clock.
  std::int64_t msUntil(const std::function<bool()>& done) {
    const std::int64_t began_ns = time.peekNs();
    for (int i = 0; i < 1000 && !done(); ++i) listener.turn();
    EXPECT_TRUE(done());
    return (time.peekNs() - began_ns) / kMs;
  }

  test::FakeTime time{5'000 * kMs};
  FakeDatabase db{time};
  std::vector<std::string> told, faults;
  int looks_at_all = 0;
  AccessListener listener{
      std::make_unique<FakeFeed>(db),
      "own",
      {},
      {[this](const std::vector<AccessChange>& changes) {
         for (const AccessChange& change : changes) told.push_back(change.name);
       },
       [this] { ++looks_at_all; }, [this](std::string fault) { faults.push_back(fault); }},
      time};
};

TEST_F(AccessListenerTest, aChangeIsDeliveredInTheTurnItArrives) {
  turns(1);
  db.change("anna");
  turns(1);
  EXPECT_THAT(told, ElementsAre("anna"));
  turns(50);
  EXPECT_THAT(told, ElementsAre("anna")) << "once";
  EXPECT_EQ(listener.hearing().changes, 1u);
}

TEST_F(AccessListenerTest, changesBeforeTheFirstConnectionAreIgnored) {
  db.change("anna");
  turns(3);
  EXPECT_THAT(told, IsEmpty());
  EXPECT_EQ(looks_at_all, 1) << "who logged in meanwhile is looked at";
}

// A connection pooler, or a NOTIFY that was not sent.
TEST_F(AccessListenerTest, aChangeWithoutNoticeIsDeliveredWithinASecond) {
  turns(1);
  db.tells = false;
  for (int n = 0; n < 20; ++n) {
    db.change("p" + std::to_string(n));
    const auto told_before = told.size();
    EXPECT_LE(msUntil([&] { return told.size() > told_before; }), 1'100);
  }
}

TEST_F(AccessListenerTest, changesDuringADisconnectionAreReadAfterwards) {
  turns(1);
  db.breaks = true;
  turns(1);
  EXPECT_FALSE(listener.hearing().is_connected);
  db.change("anna");
  // and one between LISTEN and the query after it
  db.at_listen = [this] { db.change("bert"); };
  EXPECT_LE(msUntil([this] { return told.size() == 2; }), 200);
  EXPECT_THAT(told, ElementsAre("anna", "bert"));
  EXPECT_EQ(looks_at_all, 2) << "numbers may be lost, too: all accounts are looked at";
  EXPECT_EQ(listener.hearing().connections, 2u);
}

TEST_F(AccessListenerTest, pausesBetweenConnectionsGrowUpToASecond) {
  db.answers = false;
  turns(1);
  int tries = 0;
  db.at_try = [&tries] { ++tries; };
  const std::int64_t began_ns = time.peekNs();
  while (time.peekNs() - began_ns < 20'000 * kMs) listener.turn();
  EXPECT_LE(tries, 24);
  EXPECT_GE(tries, 18);
  db.answers = true;
  EXPECT_LE(msUntil([this] { return db.connections == 1; }), 1'100);
}

TEST_F(AccessListenerTest, aServerThatLostNumbersRestartsTheCount) {
  for (const char* name : {"a", "b", "c"}) db.change(name);
  turns(1);
  db.breaks = true;
  turns(1);
  db.changes.resize(1);  // a lagging standby was promoted
  EXPECT_LE(msUntil([this] { return db.connections == 2; }), 200);
  turns(1);
  db.change("d");
  turns(1);
  EXPECT_THAT(told, ElementsAre("d"));
}

TEST_F(AccessListenerTest, itsOwnChangesAreDeliveredASecondLater) {
  turns(1);
  db.change("anna", "own");
  db.change("bert", "other");
  turns(1);
  EXPECT_THAT(told, ElementsAre("bert"));
  const auto took = msUntil([this] { return told.size() == 2; });
  EXPECT_GE(took, 900);
  EXPECT_LE(took, 1'100);
  EXPECT_THAT(told, ElementsAre("bert", "anna"));
}

TEST_F(AccessListenerTest, isDeafAfterThreeSecondsOfSilenceAndReportsIt) {
  EXPECT_FALSE(listener.hearing().is_deaf) << "it has only begun";
  EXPECT_LT(listener.hearing().silence_s, 0);
  turns(1);
  EXPECT_FALSE(listener.hearing().is_deaf);
  EXPECT_EQ(listener.hearing().fault, "");
  db.answers = false;
  const auto took = msUntil([this] { return listener.hearing().is_deaf; });
  EXPECT_GE(took, 1'900);
  EXPECT_LE(took, 3'200);
  EXPECT_THAT(listener.hearing().fault,
              HasSubstr("changes of access at other servers are not heard: no con"));
  ASSERT_EQ(faults.size(), 1u) << "a line for the outage, not for each try";
  db.answers = true;
  (void)msUntil([this] { return !listener.hearing().is_deaf; });
  EXPECT_EQ(faults.back(), "");
}

TEST_F(AccessListenerTest, unreliableNumbersRecheckAllAccountsEachSecond) {
  turns(1);
  db.fault = "a trigger is missing";
  const auto took = msUntil([this] { return !listener.hearing().fault.empty(); });
  EXPECT_LE(took, 10'200);
  EXPECT_THAT(faults, ElementsAre("a trigger is missing"));
  const int before = looks_at_all;
  const std::int64_t began_ns = time.peekNs();
  while (time.peekNs() - began_ns < 5'000 * kMs) listener.turn();
  EXPECT_GE(looks_at_all - before, 4);
  EXPECT_FALSE(listener.hearing().is_deaf);
}

TEST(AccessListenerThread, endsSoonEvenWithoutAnAnswer) {
  test::FakeTime clock;
  FakeDatabase db(clock);
  db.answers = false;
  AccessListener listener(std::make_unique<FakeFeed>(db), "own", {},
                          {[](const std::vector<AccessChange>&) {}, [] {}, [](const std::string&) {}}, clock);
  listener.start();
  listener.stop();
  EXPECT_FALSE(listener.hearing().is_connected);
}

}  // namespace
}  // namespace needlelab
