// The uplink's own times: its status lines, its probes of the server's clock, and the capture times of live
// frames.
#include <gmock/gmock.h>

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "client/net/uplink/uplink.h"
#include "tests/support/patience.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"
#include "tests/unit/client/net/uplink/fake_server.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

/// The uplink's thread waits for its next status line until the test advances the time; the network has its
/// own time.
class SteppedClock : public LinkClock {
 public:
  static constexpr std::int64_t kUnixAhead_ns = 1'700'000'000'000'000'000;

  SteppedClock() : LinkClock(time_) {}
  [[nodiscard]] std::int64_t unixNs() const override { return steadyNs() + kUnixAhead_ns; }
  Task<> wait(asio::steady_timer& timer, std::chrono::milliseconds time, LinkWait what) override {
    if (what != LinkWait::kStatus) co_return co_await LinkClock::wait(timer, time, what);
    std::uint64_t number = 0;
    timer.expires_at(asio::steady_timer::time_point::max());
    {
      const std::scoped_lock lock(mutex_);
      number = next_++;
      waits_[number] = {steadyNs() + std::chrono::nanoseconds(time).count(), &timer};
    }
    co_await timer.async_wait(kUseTuple);
    const std::scoped_lock lock(mutex_);
    waits_.erase(number);
  }
  void advance(std::chrono::nanoseconds by) {
    time_.advance(by.count());
    const std::scoped_lock lock(mutex_);
    for (const auto& [number, wait] : waits_)
      if (wait.due_ns <= steadyNs())
        asio::post(wait.timer->get_executor(), [this, number = number] {
          const std::scoped_lock inner(mutex_);
          if (const auto found = waits_.find(number); found != waits_.end()) found->second.timer->cancel();
        });
  }
  /// The remaining wait for the next status line; nothing while none waits.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> left() {
    const std::scoped_lock lock(mutex_);
    if (waits_.size() != 1) return std::nullopt;
    return std::chrono::nanoseconds(waits_.begin()->second.due_ns - steadyNs());
  }

 private:
  struct Wait {
    std::int64_t due_ns;
    asio::steady_timer* timer;
  };
  FakeTime time_;
  std::mutex mutex_;
  std::uint64_t next_ = 0;
  std::map<std::uint64_t, Wait> waits_;
};

class UplinkClockTest : public testing::Test {
 protected:
  UplinkClockTest() {
    UplinkConfig config;
    config.client = server_.clientConfig();
    config.client.limits.live_age = 1h;  // a status line is dropped if this machine stalls for longer
    config.clock = clock_;
    uplink_.emplace(config, UplinkEvents{});
  }
  /// Waits until this many lines have arrived and the next one still has its whole wait ahead.
  bool hasLines(std::uint64_t count) {
    return eventually([&] { return server_.statusLines() == count && clock_->left() == 100ms; });
  }

  std::shared_ptr<SteppedClock> clock_ = std::make_shared<SteppedClock>();
  TempFolder folder_;
  FakeServer server_;
  std::optional<Uplink> uplink_;
};

TEST(UplinkState, knowsTheServersTimeUntilTheComputerSlept) {
  constexpr std::int64_t kMinute = 60'000'000'000, kHour = 60 * kMinute;
  UplinkState state;
  EXPECT_FALSE(state.serverUnixNs(1, 2));
  // at the Welcome: steady 5 h, the server's clock 1000 h, this computer's 3 h ahead of it
  state.server_minus_steady_ns = 995 * kHour;
  state.wall_ahead_ns = 3 * kHour;
  EXPECT_EQ(state.serverUnixNs(5 * kHour, 1003 * kHour), 1000 * kHour);
  EXPECT_EQ(state.serverUnixNs(7 * kHour, 1005 * kHour), 1002 * kHour) << "two hours later";
  EXPECT_EQ(state.serverUnixNs(7 * kHour, 1002 * kHour), 1002 * kHour) << "someone set the clock right";
  EXPECT_EQ(state.serverUnixNs(7 * kHour, 1005 * kHour + kMinute - 1), 1002 * kHour);
  EXPECT_FALSE(state.serverUnixNs(7 * kHour, 1005 * kHour + kMinute)) << "it slept for a minute";
}

TEST_F(UplinkClockTest, aStatusLineComesEvery100msSometimesWithAProbe) {
  ASSERT_TRUE(hasLines(1)) << "at once";
  clock_->advance(99ms);
  EXPECT_EQ(clock_->left(), 1ms);
  clock_->advance(1ms);
  ASSERT_TRUE(hasLines(2));
  EXPECT_EQ(server_.probes(), 2u);
  for (std::uint64_t line = 3; line <= 100; ++line) {
    clock_->advance(100ms);
    ASSERT_TRUE(hasLines(line)) << line;
  }
  EXPECT_EQ(server_.probes(), 8u);
  clock_->advance(100ms);
  ASSERT_TRUE(hasLines(101));
  EXPECT_EQ(server_.probes(), 9u);
}

TEST_F(UplinkClockTest, aLiveFrameTellsWhenItsLastSampleWasDue) {
  auto spool = std::move(*Spool::open(folder_.path()));
  const std::shared_ptr<SpoolSession> session = std::move(*spool->create(describeSession(makeUuidV7())));
  uplink_->add(session, true);
  ASSERT_TRUE(eventually([&] { return uplink_->state().connected; }));
  auto samples = samplesFrom(0, 20);
  samples.back().time_ns = clock_->steadyNs() - 30'000'000;
  uplink_->offer({std::make_shared<const std::vector<GestureSample>>(samples), samples.back(), 20, 0, {}});
  clock_->advance(7s);  // the frame waits until someone watches
  pb::Envelope watch;
  watch.mutable_watch_state()->set_watched(true);
  // a watch that arrives before the session is the current one sends nothing
  ASSERT_TRUE(eventually([&] { return server_.sessions().size() == 1; }));
  server_.broadcast(watch);
  ASSERT_TRUE(eventually([&] { return server_.liveFrames() == 1; }));
  EXPECT_EQ(server_.newestCapture_unix_ns(), samples.back().time_ns + SteppedClock::kUnixAhead_ns);
  uplink_.reset();  // must go before its spool
}

}  // namespace
}  // namespace needlelab::test
