#include "client/net/spool/spool_clock.h"

#include <gmock/gmock.h>

#include "client/net/spool/spool.h"
#include "client/net/spool/spool_json.h"
#include "client/net/uplink/uplink_session.h"
#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kHour_ns = std::int64_t{3600} * 1'000'000'000;
constexpr std::int64_t kDay_ns = 24 * kHour_ns;
constexpr std::int64_t kNow_ns = 1'800'000'000'000'000'000;

TEST(SpoolClock, countsServerTimeBetweenLogInsAndAcrossARestart) {
  const TempFolder folder;
  const fs::path file = folder.path() / "clock.json";
  {
    SpoolClock clock(file);
    EXPECT_EQ(clock.nowNs(), 0);
    clock.note(kNow_ns);
    EXPECT_EQ(clock.nowNs(), 0) << "nothing has passed since the first log-in";
    clock.note(kNow_ns + 3 * kHour_ns);
    EXPECT_EQ(clock.nowNs(), 3 * kHour_ns);
  }
  SpoolClock again(file);
  EXPECT_EQ(again.nowNs(), 3 * kHour_ns);
  again.note(kNow_ns + 5 * kHour_ns);
  EXPECT_EQ(again.nowNs(), 5 * kHour_ns);
}

TEST(SpoolClock, aJumpCountsADayAtMostAndNeverBack) {
  const TempFolder folder;
  SpoolClock clock(folder.path() / "clock.json");
  clock.note(kNow_ns);
  clock.note(kNow_ns + 60 * kDay_ns);
  EXPECT_EQ(clock.nowNs(), kDay_ns);
  clock.note(kNow_ns);
  EXPECT_EQ(clock.nowNs(), kDay_ns);
  clock.note(kNow_ns + kHour_ns);
  EXPECT_EQ(clock.nowNs(), kDay_ns + kHour_ns) << "and continues from there";
  for (const std::int64_t none : {std::int64_t{0}, std::int64_t{-1}, INT64_MIN}) clock.note(none);
  EXPECT_EQ(clock.nowNs(), kDay_ns + kHour_ns);
  clock.note(INT64_MAX);
  EXPECT_EQ(clock.nowNs(), 2 * kDay_ns + kHour_ns);
}

TEST(SpoolClock, aDifferenceFromAMinuteOnIsSaidInItsUnit) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  EXPECT_EQ(clockOffText(59 * kSecond_ns), "");
  EXPECT_EQ(clockOffText(60 * kSecond_ns), "this computer's clock is 1 min ahead of the server's");
  EXPECT_EQ(clockOffText(-59 * 60 * kSecond_ns), "this computer's clock is 59 min behind the server's");
  EXPECT_EQ(clockOffText(-5400 * kSecond_ns), "this computer's clock is 1.5 h behind the server's");
  EXPECT_EQ(clockOffText(3 * kDay_ns), "this computer's clock is 3 days ahead of the server's");
}

// Servers whose clocks differ by hours: switching between them must not age the spool's sessions.
TEST(SpoolClock, twoServerClocksAddNoMoreThanLocalTime) {
  constexpr std::int64_t kMinute_ns = 60'000'000'000;
  const TempFolder folder;
  const fs::path file = folder.path() / "clock.json";
  {
    SpoolClock clock(file);
    for (int minute = 0; minute <= 100; ++minute) {
      const std::int64_t ahead_ns = minute % 2 == 0 ? 0 : 3 * kHour_ns;
      clock.note(kNow_ns + minute * kMinute_ns + ahead_ns, kHour_ns + minute * kMinute_ns);
      EXPECT_LE(clock.nowNs(), minute * kMinute_ns);
    }
    // switching to the clock that is behind adds nothing, switching to the other adds only the time that
    // passed
    EXPECT_EQ(clock.nowNs(), 50 * kMinute_ns);
  }
  // with one server all time counts, even while this program was not running
  SpoolClock again(file);
  again.note(kNow_ns + 160 * kMinute_ns, 5 * kMinute_ns);
  EXPECT_EQ(again.nowNs(), 110 * kMinute_ns);
  again.note(kNow_ns + 190 * kMinute_ns, 35 * kMinute_ns);
  EXPECT_EQ(again.nowNs(), 140 * kMinute_ns);
}

TEST(SpoolClock, manyLogInsWithinAMinuteWriteOnceAndLoseNoTime) {
  const TempFolder folder;
  const fs::path file = folder.path() / "clock.json";
  SpoolClock clock(file);
  clock.note(kNow_ns);
  const auto written = fs::last_write_time(file);
  fs::remove(file);
  for (int second = 1; second < 60; ++second) clock.note(kNow_ns + second * std::int64_t{1'000'000'000});
  EXPECT_FALSE(fs::exists(file)) << written.time_since_epoch().count();
  clock.note(kNow_ns + 60 * std::int64_t{1'000'000'000});
  EXPECT_TRUE(fs::exists(file));
  EXPECT_EQ(clock.nowNs(), 60 * std::int64_t{1'000'000'000});
}

TEST(SpoolClock, aDamagedFileBeginsAgainWhichKeepsSessionsLonger) {
  const TempFolder folder;
  for (const std::string& text :
       {std::string(), std::string("{\"seen_ns\": 9}"), sealed("{\"seen_ns\": 9}x"),
        sealed("{\"seen_ns\": -5}"), sealed("[]"), sealed("{\"seen_ns\": 1e300}")}) {
    folder.write("clock.json", text);
    SpoolClock clock(folder.path() / "clock.json");
    EXPECT_EQ(clock.nowNs(), 0) << text;
  }
}

/// A spool with two sessions: the server has closed one, which is in no backup; no server has the other.
class SpoolAge : public testing::Test {
 protected:
  SpoolAge() {
    start();
    spool_->clock().note(kNow_ns);
    for (const bool closed : {true, false}) {
      auto session = *spool_->create(describeSession(makeUuidV7()));
      EXPECT_TRUE(session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 10)), 10).ok());
      EXPECT_TRUE(session->sync().ok());
      EXPECT_TRUE(session->end(false).ok());
      if (!closed) continue;
      UplinkSession upload(session);
      upload.onClosed({});
    }
  }
  void start() {
    spool_.reset();
    spool_ = std::move(*Spool::open(folder_.path()));
  }
  /// Starts with this time on the server's clock.
  std::size_t removedAt(std::int64_t server_unix_ns) {
    start();
    spool_->clock().note(server_unix_ns);
    return spool_->cleanUp({.min_free_bytes = 0}).size();
  }
  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
};

TEST_F(SpoolAge, aJumpOfSixtyDaysRemovesNothing) {
  for (const std::int64_t days : {60, 0, -60, 0, 60})
    EXPECT_EQ(removedAt(kNow_ns + days * kDay_ns), 0u) << days;
  EXPECT_EQ(spool_->closedButNotSafe().size(), 1u);
  EXPECT_EQ(spool_->unfinished().size(), 1u);
}

TEST_F(SpoolAge, aClosedSessionExpiresAfterFourteenDaysAndUnsentOnesStay) {
  for (int day = 1; day <= 14; ++day) EXPECT_EQ(removedAt(kNow_ns + day * kDay_ns), 0u) << day;
  EXPECT_EQ(removedAt(kNow_ns + 15 * kDay_ns), 1u);
  EXPECT_EQ(spool_->closedButNotSafe().size(), 0u);
  for (int day = 16; day <= 100; ++day) EXPECT_EQ(removedAt(kNow_ns + day * kDay_ns), 0u);
  EXPECT_EQ(spool_->unfinished().size(), 1u);
}

}  // namespace
}  // namespace needlelab::test
