// Wrong codes at several servers on one database count as at a single server.
#include "db/service/context/code_tries.h"

#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "db/service/context/export_ledger.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

constexpr std::int64_t kSec_ns = 1'000'000'000;

struct TwoServers {
  TwoServers() : shared_a(db.address, key, "a", &time), shared_b(db.address, key, "b", &time) {}
  test::TestDb db;
  test::FakeTime time{1'000'000 * kSec_ns};
  const LoginKey key{PseudonymKey(PseudonymKey::Hash{})};
  SharedLogins shared_a, shared_b;
  CodesInStore a{shared_a}, b{shared_b};
};

TEST(CodeTries, twoServersLetPassAsManyTriesAsOneInMemory) {
  TwoServers servers;
  CodeGuard one(servers.time);
  std::mt19937 random(7);
  const auto upTo = [&](int most) { return std::uniform_int_distribution<int>(0, most)(random); };
  for (int n = 0; n < 600; ++n) {
    CodesInStore& at = upTo(1) == 0 ? servers.a : servers.b;
    const std::string name = upTo(2) == 0 ? "tim" : "tom";
    switch (upTo(9)) {
      case 0:
        one.forget(name);
        ASSERT_OK(at.forget(name));
        break;
      case 1:
        one.giveBack(name);
        ASSERT_OK(at.giveBack(name));
        break;
      default: {
        const auto wanted = one.begin(name);
        const auto got = at.begin(name);
        ASSERT_OK(got);
        ASSERT_EQ(got->must_wait, wanted.must_wait) << n;
        ASSERT_EQ(got->left, wanted.left) << n;
        ASSERT_EQ(got->then_wait, wanted.then_wait) << n;
      }
    }
    servers.time.advance(upTo(3) == 0 ? upTo(1200) * kSec_ns : kSec_ns);
  }
}

TEST(CodeTries, simultaneousTriesShareTheSequentialLimit) {
  TwoServers servers;
  std::atomic<int> allowed{0};
  std::vector<std::thread> guessers;
  for (CodesInStore* at : {&servers.a, &servers.b, &servers.a, &servers.b})
    guessers.emplace_back([at, &allowed] {
      for (int n = 0; n < 5; ++n) {
        const auto begun = at->begin("tom");
        if (begun.ok() && begun->must_wait.count() == 0) ++allowed;
      }
    });
  for (std::thread& guesser : guessers) guesser.join();
  EXPECT_EQ(allowed.load(), 5);
}

TEST(CodeTries, aClockHoursBehindCausesNoWaitOfHours) {
  TwoServers servers;
  for (int n = 0; n < 5; ++n) ASSERT_OK(servers.a.begin("tom"));
  test::FakeTime behind{servers.time.peekNs() - 3 * 3600 * kSec_ns};
  SharedLogins promoted(servers.db.address, servers.key, "a", &behind);
  const auto begun = CodesInStore(promoted).begin("tom");
  ASSERT_OK(begun);
  EXPECT_GT(begun->must_wait, std::chrono::seconds(0));
  EXPECT_LE(begun->must_wait, CodeGuard::Settings().longest_wait);
}

TEST(SharedLedgers, aReadIsAuditedOnceAcrossServersAndItsPages) {
  TwoServers servers;
  const ExportLedger a(servers.shared_a), b(servers.shared_b), alone;
  const Principal ina{"ina", pb::INSTRUCTOR, true, 5}, max{"max", pb::INSTRUCTOR, true, 5};
  const auto isNew = [&](const ExportLedger& ledger, const Principal& who) {
    return test::TestDb::must(ledger.isNewOnAllServers(servers.db.writer, who, "export"));
  };
  EXPECT_TRUE(isNew(a, ina));
  EXPECT_FALSE(isNew(b, ina));
  EXPECT_TRUE(isNew(b, max));
  EXPECT_TRUE(isNew(alone, ina)) << "one server alone has its own memory";

  const std::string page = a.seal(ina, "export", "row 17");
  EXPECT_EQ(test::TestDb::must(b.open(ina, "export", page)), "row 17");
  EXPECT_FALSE(b.open(max, "export", page).ok());
  EXPECT_FALSE(b.open(ina, "another", page).ok());
  EXPECT_FALSE(alone.open(ina, "export", page).ok());
  EXPECT_FALSE(b.open(ina, "export", alone.seal(ina, "export", "row 17")).ok());
}

}  // namespace
}  // namespace needlelab
