// The link goes and comes back, on virtual time, and once with real threads.
#include <atomic>
#include <chrono>
#include <thread>

#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr int kMaintainEvery = 50;  // ticks: 20 times a second

class VirtuoseReconnect : public VirtuoseTest {
 protected:
  // Counts the ticks until a reading is fresh again, with maintain() in between. Returns −1 if it never is.
  int ticksUntilFresh(int most, const Wrench& wanted = {}) {
    for (int k = 0; k < most; ++k) {
      if (k % kMaintainEvery == 0) device_.maintain();
      if (tick(wanted) == DeviceRead::kFresh) return k;
    }
    return -1;
  }
  // in FAULT until a person has acknowledged it and the tip is outside
  void acknowledge() {
    gate_.noteOutside(true);
    gate_.acknowledge();
  }
};

TEST_F(VirtuoseReconnect, aLostLinkIsSaidInTheFirstTickAndIsNotTouchedAnyMore) {
  open();
  ticks(300, {{2, 0, 0}, {}});
  standin_.command("link_down 0.3");
  EXPECT_EQ(tick({{2, 0, 0}, {}}), DeviceRead::kNoUpdate);
  EXPECT_EQ(reading_.condition, static_cast<std::uint32_t>(kDeviceLost));
  EXPECT_EQ(gate_.fault(), Fault::kDeviceLost);
  const std::string complaints = standin_.complaints();
  EXPECT_EQ(complaints, "virtGetPosition:6");
  // Without maintain() the haptic thread does not touch the connection, even when the link is up again.
  ticks(500);
  EXPECT_EQ(reading_.condition, static_cast<std::uint32_t>(kDeviceLost));
  EXPECT_EQ(standin_.complaints(), complaints);
  EXPECT_THAT(device_.status(), HasSubstr("the link is lost and is looked for again"));
  EXPECT_THAT(device_.status(), HasSubstr("virtGetPosition failed with error 6"));
}

TEST_F(VirtuoseReconnect, aShortLossIsMendedWithoutForceUntilAPersonSaysSo) {
  const Wrench two{{2, 0, 0}, {}};
  open();
  ticks(300, two);
  standin_.command("link_down 0.1");
  ticks(150, two);
  const int needed = ticksUntilFresh(200, two);
  ASSERT_GE(needed, 0);
  EXPECT_EQ(device_.status(), "");
  EXPECT_EQ(standin_.state().is_permitted, 1);
  ticks(500, two);
  EXPECT_EQ(standin_.state().commanded[0], 0);  // power is back, but FAULT remains
  acknowledge();
  ticks(300, two);
  EXPECT_EQ(gate_.fault(), Fault::kNone);
  EXPECT_NEAR(standin_.state().felt[0], 2, 1e-3);
}

TEST_F(VirtuoseReconnect, aServiceThatDidNotHearTheEndIsWaitedFor) {
  open();
  ticks(100);
  standin_.command("link_down 0.2");
  // The old connection is closed while the link is down: the service keeps it until its watchdog (2 s)
  // expires.
  const int needed = ticksUntilFresh(4000);
  EXPECT_GT(needed, 1900);
  EXPECT_LT(needed, 2200);
  EXPECT_EQ(gate_.fault(), Fault::kDeviceLost);
}

TEST_F(VirtuoseReconnect, aServiceThatStartsAgainIsFound) {
  open();
  ticks(100);
  standin_.command("daemon 0");
  EXPECT_EQ(ticksUntilFresh(1000), -1);
  EXPECT_THAT(device_.status(),
              HasSubstr("looked for again. Virtuose at 127.0.0.1#53210: connecting failed with error 2"));
  standin_.command("daemon 1");
  EXPECT_GE(ticksUntilFresh(100), 0);
  EXPECT_EQ(device_.status(), "");
}

TEST_F(VirtuoseReconnect, theWatchdogsCutIsMended) {
  open();
  ticks(100);
  standin_.advance(2.5);  // the loop stalled
  EXPECT_EQ(tick(), DeviceRead::kNoUpdate);
  EXPECT_EQ(reading_.condition, static_cast<std::uint32_t>(kDeviceLost));
  EXPECT_GE(ticksUntilFresh(100), 0);
}

TEST_F(VirtuoseReconnect, aDeviceThatRefusesForASecondIsOpenedAnew) {
  open();
  ticks(100);
  standin_.command("fail virtGetSpeed 11");
  for (int k = 0; k < 999; ++k) {
    tick();
    ASSERT_EQ(reading_.condition, static_cast<std::uint32_t>(kDeviceTrouble)) << k;
    device_.maintain();
  }
  tick();
  tick();
  EXPECT_EQ(reading_.condition, static_cast<std::uint32_t>(kDeviceLost));
  standin_.command("fail virtGetSpeed 0");
  EXPECT_GE(ticksUntilFresh(100), 0);
  EXPECT_EQ(reading_.condition, 0u);
}

TEST_F(VirtuoseReconnect, whatIsNotThereAtTheStartIsSaidAndMayComeLater) {
  standin_.command("daemon 0");
  const Status status = device_.open(1000);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable);
  for (const char* part : {"127.0.0.1#53210", "device is on", "Ethernet cable", "service running"})
    EXPECT_THAT(status.error().message, HasSubstr(part));
  EXPECT_EQ(tick(), DeviceRead::kNoUpdate);
  standin_.command("daemon 1");
  open();
  EXPECT_EQ(tick(), DeviceRead::kFresh);
}

TEST_F(VirtuoseReconnect, closingALostDeviceLeavesNothingOpen) {
  open();
  ticks(10);
  standin_.command("daemon 0");
  ticks(10);
  device_.maintain();
  device_.close();
  EXPECT_EQ(device_.status(), "");
  standin_.command("daemon 1");
  EXPECT_EQ(standin_.state().open_contexts, 0);
  device_.maintain();  // and it is not opened behind the owner's back
  EXPECT_EQ(standin_.state().open_contexts, 0);
}

// the hand-over between the haptic thread and maintain, for ThreadSanitizer
TEST_F(VirtuoseReconnect, threadsHandTheConnectionOverCleanly) {
  standin_.useRealTime();
  VirtuoseOptions options = standinOptions();
  options.keep_alive = 1ms;
  options.first_retry = options.longest_retry = 1ms;
  options.timeout_s = 0.005;
  VirtuoseDevice device(options);
  ASSERT_TRUE(device.open(1000).ok());

  std::atomic<bool> done{false};
  std::atomic<int> fresh{0}, lost{0};
  std::thread haptic([&] {
    DeviceReading reading;
    while (!done.load()) {
      if (device.read(reading) == DeviceRead::kFresh)
        fresh.fetch_add(1);
      else if ((reading.condition & kDeviceLost) != 0)
        lost.fetch_add(1);
      device.write({});
      std::this_thread::sleep_for(500us);
    }
    device.write({});
  });
  std::thread keeper([&] {
    while (!done.load()) {
      device.maintain();
      static_cast<void>(device.status());
      std::this_thread::sleep_for(1ms);
    }
  });
  // a busy machine may need long; what never comes is ended by ctest
  const auto awaitFive = [](const std::atomic<int>& count) {
    const int before = count.load();
    while (count.load() < before + 5) std::this_thread::sleep_for(1ms);
  };
  for (int round = 0; round < 10; ++round) {
    awaitFive(fresh);
    standin_.command("daemon 0");
    awaitFive(lost);
    standin_.command("daemon 1");
  }
  awaitFive(fresh);
  done.store(true);
  haptic.join();
  keeper.join();
  device.close();
  EXPECT_EQ(standin_.state().open_contexts, 0);
}

}  // namespace
}  // namespace needlelab::test
