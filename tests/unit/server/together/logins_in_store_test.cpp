// Two servers on one database: what one knows of log-ins applies at the other.
#include "server/together/logins_in_store.h"

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "db/people/people.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using test::TestDb;
using Milliseconds = std::chrono::milliseconds;

constexpr std::int64_t kSec = 1'000'000'000;

LoginGuard::Settings fewTries() {
  LoginGuard::Settings s;
  s.allowed_per_name = 3;
  s.first_wait = Milliseconds(10'000);
  s.longest_wait = Milliseconds(60'000);
  s.allowed_per_address = 6;
  s.refill_address = Milliseconds(2'000);
  s.allowed_everywhere = 8;
  s.refill_everywhere = Milliseconds(5'000);
  return s;
}

/// The state of one server; its own clock may be anything.
struct OneServer {
  OneServer(TestDb& db, TimeSource& database_clock, std::int64_t own_now_ns, const std::string& name)
      : own_time(own_now_ns),
        readers(db.address),
        shared(db.address, key, name, &database_clock),
        logins({io, turns, readers, shared}, {.guard = fewTries()}, own_time) {}
  ~OneServer() {
    pool.join();
    io.poll();
  }

  template <typename T>
  T wait(Task<T> task) {
    std::optional<T> result;
    const auto run = [&]() -> Task<> {
      T got = co_await std::move(task);
      result.emplace(std::move(got));
    };
    asio::co_spawn(io, run(), rethrow);
    while (!result) {
      io.restart();
      io.run_one_for(std::chrono::seconds(1));
    }
    return std::move(*result);
  }
  LoginState::Try begin(const std::string& name, const std::string& address) {
    return TestDb::must(wait(logins.begin(name, address)));
  }
  std::string issue(const std::string& name, std::int64_t number = 0) {
    return TestDb::must(wait(logins.issue({{name, pb::INSTRUCTOR, true, number}, 0}))).token;
  }
  bool finds(const std::string& token) { return TestDb::must(wait(logins.find(token, "here"))).has_value(); }
  /// Like admitting a request: the token is known, and checked in the database.
  bool lets(const std::string& token) {
    const auto holder = TestDb::must(wait(logins.find(token, "here")));
    return holder && TestDb::must(logins.check(token, holder->who)());
  }
  std::int64_t leftMs(const std::string& token) {
    return std::chrono::duration_cast<Milliseconds>(wait(logins.left(token))).count();
  }

  const LoginKey key{PseudonymKey(PseudonymKey::Hash{})};
  asio::io_context io{1};
  asio::thread_pool pool{1};
  FairPool turns{pool, 1};
  test::FakeTime own_time;
  ReaderPool readers;
  SharedLogins shared;
  LoginsInStore logins;
};

class LoginsInStoreTest : public testing::Test {
 protected:
  LoginsInStoreTest() {
    for (const char* name : {"anna", "bert"})
      EXPECT_OK(PeopleStore(db.writer).add({name, pb::INSTRUCTOR, "hash", false, 7}));
  }
  void advance(std::int64_t by_ns) {
    time.advance(by_ns);
    a.own_time.advance(by_ns);
    b.own_time.advance(by_ns);
  }

  TestDb db;
  test::FakeTime time{1'000'000 * kSec};  ///< the database's
  // their clocks differ by hours from each other and from the database's
  OneServer a{db, time, 5'000 * kSec, "a"}, b{db, time, 99'000'000 * kSec, "b"};
};

TEST_F(LoginsInStoreTest, triesAtTwoServersWaitAsThoseAtOneDo) {
  LoginGuard one(fewTries());
  std::mt19937 random(11);
  const auto upTo = [&](int most) { return std::uniform_int_distribution<int>(0, most)(random); };
  int waited = 0, passed = 0;
  for (int n = 0; n < 500; ++n) {
    OneServer& at = upTo(1) == 0 ? a : b;
    const std::string name = "person p" + std::to_string(upTo(3)), address = "net" + std::to_string(upTo(3));
    const std::int64_t now_ns = time.peekNs();
    const auto standing = TestDb::must(at.wait(at.logins.standing(name, address)));
    ASSERT_EQ(standing.wait, one.mustWait(name, address, now_ns)) << n;
    ASSERT_EQ(standing.knows_person, one.knows(name, address)) << n;
    ASSERT_EQ(standing.knows_address, one.knowsAddress(address)) << n;
    auto tried = at.begin(name, address);
    ASSERT_EQ(tried.wait, standing.wait);
    if (tried.wait.count() > 0) {
      ++waited;
    } else {
      ++passed;
      const int outcome = upTo(9);
      if (outcome == 0) {
        one.succeeded(name, address, now_ns);
        ASSERT_OK(at.wait(at.logins.succeeded(std::move(tried))));
      } else if (outcome == 1) {
        ASSERT_OK(at.wait(at.logins.abandoned(std::move(tried))));
      } else {
        const bool begins = one.failed(name, address, now_ns);
        const auto locked = TestDb::must(at.wait(at.logins.failed(std::move(tried))));
        ASSERT_EQ(locked.has_value(), begins) << n;
        if (locked) ASSERT_EQ(*locked, one.mustWait(name, address, now_ns));
      }
    }
    advance(upTo(4) == 0 ? upTo(80) * kSec : upTo(3) * kSec);
  }
  EXPECT_GT(waited, 50);
  EXPECT_GT(passed, 50);
}

TEST_F(LoginsInStoreTest, triesUnderWayAtTheOtherServerCount) {
  std::vector<LoginState::Try> under_way;
  for (int n = 0; n < 5; ++n) {
    OneServer& at = n % 2 == 0 ? a : b;
    auto tried = at.begin("person anna", "lab");
    if (tried.wait.count() == 0) under_way.push_back(std::move(tried));
  }
  EXPECT_EQ(under_way.size(), 3u) << "as many as one server lets pass";
  // one was right: the person starts over, and the others' counts at this address are cleared
  ASSERT_OK(a.wait(a.logins.succeeded(std::move(under_way.back()))));
  const auto standing = TestDb::must(b.wait(b.logins.standing("person anna", "lab")));
  EXPECT_EQ(standing.wait.count(), 0);
  EXPECT_TRUE(standing.knows_person);
}

TEST_F(LoginsInStoreTest, aTokenOfOneServerIsValidAtTheOther) {
  const std::string token = a.issue("@1");
  EXPECT_TRUE(b.lets(token));
  EXPECT_EQ(b.leftMs(token), 15 * 60'000);
  const auto holder = TestDb::must(b.wait(b.logins.find(token, "here")));
  EXPECT_EQ(holder->who.name, "@1");
  EXPECT_EQ(holder->who.access_number, 0);
  EXPECT_EQ(holder->password_ns, time.peekNs()) << "of the database's clock";
  EXPECT_TRUE(b.logins.mayBeToken(token));
  EXPECT_EQ(a.logins.formKey(), b.logins.formKey());
  advance(15 * 60 * kSec);
  EXPECT_FALSE(a.finds(token));
  EXPECT_FALSE(b.finds(token));
}

TEST_F(LoginsInStoreTest, whatIsNoTokenIsNotLookedFor) {
  std::string token = a.issue("@1");
  token[3] = static_cast<char>(token[3] ^ 1);
  ASSERT_OK(db.writer.script("ALTER TABLE login_tokens RENAME TO gone"));
  for (const std::string& text : {token, std::string(), std::string(32, 'x')}) {
    EXPECT_FALSE(b.finds(text));
    EXPECT_FALSE(b.logins.mayBeToken(text));
  }
  ASSERT_OK(db.writer.script("ALTER TABLE gone RENAME TO login_tokens"));
}

TEST_F(LoginsInStoreTest, usingATokenAtOneServerLengthensItAtTheOther) {
  const std::string token = a.issue("@1");
  EXPECT_EQ(b.leftMs(token), 15 * 60'000);
  advance(10 * 60 * kSec);
  a.logins.renew(token);
  while (a.leftMs(token) <= 5 * 60'000) {
    a.io.restart();
    a.io.run_one_for(std::chrono::seconds(1));
  }
  EXPECT_EQ(a.leftMs(token), 15 * 60'000);
  EXPECT_EQ(b.leftMs(token), 5 * 60'000) << "as it knew it";
  advance(6 * 60 * kSec);
  EXPECT_EQ(b.leftMs(token), 9 * 60'000) << "asks the database before it lets it end";
}

TEST_F(LoginsInStoreTest, aLogOutEndsTheTokenAtAllServers) {
  const std::string token = a.issue("@1"), other = a.issue("@1");
  EXPECT_TRUE(b.lets(token));
  ASSERT_OK(a.wait(a.logins.end(token)));
  EXPECT_FALSE(a.lets(token));
  EXPECT_FALSE(b.lets(token)) << "it is kept here, and asked for at each use";
  EXPECT_TRUE(b.lets(other));
  // long-running use without requests is notified
  EXPECT_GT(b.leftMs(token), 0);
  EXPECT_EQ(b.logins.forget("@1"), std::nullopt);
  EXPECT_EQ(b.leftMs(token), 0);
  EXPECT_GT(b.leftMs(other), 0);
}

TEST_F(LoginsInStoreTest, anAccountChangeEndsItsTokensAtEachServer) {
  const std::string token = a.issue("@1"), bert = a.issue("@2");
  EXPECT_TRUE(b.lets(token));
  ASSERT_OK(PeopleStore(db.writer).setPasswordHash("@1", "another"));
  EXPECT_FALSE(a.lets(token));
  EXPECT_FALSE(b.lets(token));
  EXPECT_TRUE(b.lets(bert));
  const auto late = a.wait(a.logins.issue({{"@1", pb::INSTRUCTOR, true, 0}, 0}));
  ASSERT_FALSE(late.ok()) << "the old password was checked before the change";
  EXPECT_EQ(late.error().code, ErrorCode::kConflict);
  EXPECT_TRUE(b.lets(a.issue("@1", 1)));
}

TEST_F(LoginsInStoreTest, aDatabaseOutageBlocksLogInsAndLivePagesContinue) {
  const std::string token = a.issue("@1"), unknown = a.key.makeToken();
  EXPECT_TRUE(b.lets(token));
  ASSERT_OK(db.writer.script("ALTER TABLE login_tokens RENAME TO gone"));
  EXPECT_FALSE(b.wait(b.logins.find(unknown, "here")).ok());
  EXPECT_FALSE(b.logins.check(token, {})().ok());
  EXPECT_GT(b.leftMs(token), 0);
  b.logins.forget("@1");
  EXPECT_EQ(b.leftMs(token), 0) << "something changed, and no one can say what";
  ASSERT_OK(db.writer.script("ALTER TABLE gone RENAME TO login_tokens"));
}

TEST_F(LoginsInStoreTest, aStandbysSlowClockDoesNotExtendLogIns) {
  const std::string token = a.issue("@1");
  for (int n = 0; n < 3; ++n) (void)a.begin("person anna", "lab");
  test::FakeTime behind{time.peekNs() - 3 * 3600 * kSec};
  OneServer promoted(db, behind, 1'000 * kSec, "c");
  EXPECT_LE(promoted.leftMs(token), 15 * 60'000);
  EXPECT_GT(promoted.leftMs(token), 0);
  EXPECT_LE(promoted.begin("person anna", "lab").wait, fewTries().longest_wait);
}

TEST_F(LoginsInStoreTest, tidyingKeepsWhatCounts) {
  const std::string token = a.issue("@1");
  for (int n = 0; n < 3; ++n) (void)a.begin("person anna", "lab");
  a.logins.tidy();
  (void)a.leftMs(token);
  EXPECT_TRUE(b.finds(token));
  EXPECT_GT(b.begin("person anna", "lab").wait.count(), 0);
}

}  // namespace
}  // namespace needlelab
