// Jumping wall clocks: waits, expiries and sort orders do not depend on them.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <atomic>

#include "client/net/spool/spool_writer.h"
#include "client/net/uplink/uplink.h"
#include "client/net/uplink/uplink_session.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "tests/support/patience.h"
#include "tests/unit/client/net/spool/spool_samples.h"
#include "tests/unit/db/test_db.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {
namespace {
std::atomic<std::int64_t> wall_jump_s = 0;
}
}  // namespace needlelab::test

// replaces libc's function
extern "C" int clock_gettime(clockid_t id, timespec* now) noexcept {
  const long rc = ::syscall(SYS_clock_gettime, id, now);
  if (id == CLOCK_REALTIME) now->tv_sec += needlelab::test::wall_jump_s;
  return static_cast<int>(rc);
}

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
constexpr std::int64_t kDay_s = 86'400;

class ClockJump : public testing::Test {
 protected:
  ~ClockJump() override { wall_jump_s = 0; }
};

TEST_F(ClockJump, theClockOfThisProgramDoesJump) {
  const std::int64_t before = wallNowNs(), steady = steadyNowNs();
  wall_jump_s = kDay_s;
  EXPECT_GT(wallNowNs() - before, 86'000'000'000'000);
  EXPECT_LT(steadyNowNs() - steady, 3'600'000'000'000);
}

TEST_F(ClockJump, sessionIdsKeepTheirOrderWhenTheClockGoesBack) {
  Uuid last{};
  for (int i = 0; i < 3'000; ++i) {
    wall_jump_s = (i / 100 % 3 - 1) * kDay_s;
    const Uuid id = makeUuidV7();
    ASSERT_LT(last, id) << i;
    EXPECT_EQ(id[6] >> 4, 7);
    EXPECT_EQ(id[8] >> 6, 2);
    last = id;
  }
}

TEST_F(ClockJump, aSessionGoesThroughWholeWhileTheClockJumpsByADay) {
  RunningServer server;
  const std::string key = server.addStation("station-1");
  const TempFolder folder;
  auto spool = std::move(*Spool::open(folder.path()));
  auto session = *spool->create(describeSession(makeUuidV7()));
  UplinkConfig config;
  config.client = server.config(stationLogin("station-1", key));
  Uplink uplink(config, {});
  uplink.add(session, true);
  auto ring = std::make_unique<SampleRing>();
  SpoolWriter::Callbacks callbacks;
  callbacks.durable = [&] { uplink.wake(); };
  SpoolWriterOptions options;
  options.rate_hz = 100;  // many chunks
  SpoolWriter writer(*ring, session, options, callbacks);
  for (std::uint64_t tick = 0; tick < 1'000; ++tick) {
    ring->push(sampleAt(tick));
    if (tick % 50 == 0) {
      wall_jump_s = (static_cast<std::int64_t>(tick) / 50 % 3 - 1) * kDay_s;
      std::this_thread::sleep_for(20ms);
    }
  }
  ASSERT_TRUE(writer.finish(kPatience).ok());
  uplink.wake();
  EXPECT_TRUE(uplink.waitUntilDone(kPatience));
  EXPECT_EQ(uplink.state().connections, 1u) << "a jump cost the connection";
  uplink.stop();
  pb::Request request;
  request.mutable_get_session()->set_session_id(bytesOfId(session->id()));
  const auto info = server.asAdmin(request).session();
  EXPECT_EQ(info.state(), pb::SESSION_COMPLETE);
  EXPECT_EQ(info.samples(), 1'000u);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "clock.json")) << "the server's time was noted";
}

TEST_F(ClockJump, tokensAndLockOutsFollowTheSteadyClock) {
  RunningServer server;
  server.addUser("ines", pb::INSTRUCTOR, "correct horse");
  auto first = server.connect(personLogin("ines", "correct horse"));
  ASSERT_TRUE(first.ok()) << first.error().message;
  pb::Login by_token;
  by_token.set_token(first->welcome().token());
  for (const std::int64_t jump : {kDay_s, -kDay_s}) {
    wall_jump_s = jump;
    const auto again = server.connect(by_token);
    EXPECT_TRUE(again.ok()) << again.error().message;
  }
  // a password guesser still has to wait, however the clock jumps
  wall_jump_s = 0;
  for (int i = 0; i < 6; ++i) EXPECT_FALSE(server.connect(personLogin("ines", "guess")).ok());
  for (const std::int64_t jump : {kDay_s, -kDay_s}) {
    wall_jump_s = jump;
    EXPECT_FALSE(server.connect(personLogin("ines", "correct horse")).ok()) << "a jump ends the lock-out";
  }
}

TEST_F(ClockJump, sixtyDaysMoreOrLessRemoveNothingFromTheSpoolAcrossRestarts) {
  const TempFolder folder;
  const SpoolKeep keep{.min_free_bytes = 0};
  {
    auto spool = std::move(*Spool::open(folder.path()));
    for (const bool closed : {true, false}) {
      auto session = *spool->create(describeSession(makeUuidV7()));
      ASSERT_TRUE(session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 10)), 10).ok());
      ASSERT_TRUE(session->sync().ok());
      ASSERT_TRUE(session->end(false).ok());
      if (!closed) continue;
      UplinkSession upload(session);
      upload.onClosed({});
    }
  }
  for (const std::int64_t jump : {60 * kDay_s, -60 * kDay_s, std::int64_t{0}, 60 * kDay_s}) {
    wall_jump_s = jump;
    auto spool = std::move(*Spool::open(folder.path()));
    EXPECT_TRUE(spool->cleanUp(keep).empty());
    EXPECT_EQ(spool->closedButNotSafe().size(), 1u) << jump;
    EXPECT_EQ(spool->unfinished().size(), 1u) << jump;
  }
}

TEST_F(ClockJump, aWrongYearOfAStationIsStoredUnchanged) {
  RunningServer server;
  const std::string key = server.addStation("station-1");
  for (const std::int64_t started_ns :
       {std::int64_t{7'000'000'000}, std::int64_t{4'102'444'800'000'000'000}}) {
    const TempFolder folder;
    auto spool = std::move(*Spool::open(folder.path()));
    auto description = describeSession(makeUuidV7());
    description.set_started_unix_ns(started_ns);
    auto session = *spool->create(description);
    ASSERT_TRUE(session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(0, 10)), 10).ok());
    ASSERT_TRUE(session->sync().ok());
    ASSERT_TRUE(session->end(false).ok());
    UplinkConfig config;
    config.client = server.config(stationLogin("station-1", key));
    Uplink uplink(config, {});
    uplink.add(session, false);
    EXPECT_TRUE(uplink.waitUntilDone(kPatience)) << uplink.state().error;
    uplink.stop();
    pb::Request request;
    request.mutable_get_session()->set_session_id(bytesOfId(session->id()));
    const auto info = server.asAdmin(request).session();
    EXPECT_EQ(info.description().started_unix_ns(), started_ns);
    EXPECT_EQ(info.state(), pb::SESSION_COMPLETE);
    // the server also stores the arrival time by its own clock
    EXPECT_LT(std::abs(info.received_unix_ns() - wallNowNs()), 60'000'000'000);
  }
}

}  // namespace
}  // namespace needlelab::test
