// The Falcon's safety, exact to the tick and the nanosecond, in a simulated world where nothing is late.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/client/device/world/falcon_run.h"

namespace needlelab::test {
namespace {

using Motors = std::array<std::int16_t, 3>;

// the USB thread sends on the whole millisecond, the haptic thread ticks in the middle; an answer comes 0.3
// ms after its command
FalconPlan exactPlan() {
  FalconPlan plan;
  plan.usb_phase_ns = kMs / 2;
  plan.write_ns = kMs / 10;
  plan.reply_ns = 3 * kMs / 10;
  return plan;
}

class FalconWorld : public testing::Test {
 protected:
  void SetUp() override {
    run_.keeps_sent = true;
    run_.begin();
    // from now on a millisecond is one command and one tick
    run_.goOn(kMs / 4);
  }
  void TearDown() override {
    run_.end();
    EXPECT_EQ(run_.broken(), "");
  }
  /// The hand pushes the needle in at 35 mm/s, and goes on for another 0.3 s; the force has faded in.
  void pushIn() {
    run_.hand.since_ns = run_.hand.at_ns;
    run_.hand.stroke_s = 1.6;
    run_.hand.deepest_m = 0.020;
    run_.goOn(450 * kMs);
    ASSERT_GT(run_.haptic->force_N(), 0.5);
  }
  [[nodiscard]] std::int64_t now() { return run_.world.nowNs(); }
  [[nodiscard]] static bool torque(const FalconRun::Sent& sent) { return sent.command.motor != Motors{}; }
  /// Goes on tick by tick until the gate has a fault; the ticks that took.
  int ticksUntilFault(int most) {
    for (int k = 1; k <= most; ++k) {
      run_.goOn(kMs);
      if (run_.haptic->gate().fault() != Fault::kNone) return k;
    }
    return -1;
  }

  FalconRun run_{exactPlan()};
};

TEST_F(FalconWorld, oneCommandAndOneTickEveryMillisecondToTheNanosecond) {
  run_.sent.clear();
  const std::uint64_t ticks = run_.ticks();
  run_.goOn(1'000 * kMs);
  EXPECT_EQ(run_.ticks() - ticks, 1'000u);
  ASSERT_EQ(run_.sent.size(), 1'000u);
  for (std::size_t i = 1; i < run_.sent.size(); ++i)
    ASSERT_EQ(run_.sent[i].at_ns - run_.sent[i - 1].at_ns, kMs);
}

TEST_F(FalconWorld, torqueEndsTwentyMillisecondsAfterTheHapticThreadsLastRequest) {
  pushIn();
  run_.sent.clear();
  run_.haptic->hangUntil(now() + 500 * kMs);
  run_.goOn(200 * kMs);
  // the first command after the last tick takes the request: it and those of the next 20 ms carry torque
  const std::int64_t last_tick_ns = run_.haptic->lastTickNs();
  const auto taken = std::find_if(run_.sent.begin(), run_.sent.end(),
                                  [&](const FalconRun::Sent& sent) { return sent.at_ns >= last_tick_ns; });
  ASSERT_NE(taken, run_.sent.end());
  ASSERT_LT(taken->at_ns - last_tick_ns, kMs);
  int with_torque = 0;
  for (const FalconRun::Sent& sent : run_.sent) {
    EXPECT_EQ(torque(sent), sent.at_ns <= taken->at_ns + 20 * kMs) << sent.at_ns - taken->at_ns;
    if (sent.at_ns >= taken->at_ns && torque(sent)) ++with_torque;
  }
  EXPECT_EQ(with_torque, 21);
  EXPECT_EQ(run_.device->counts().starved_times, 1u);
}

TEST_F(FalconWorld, forceFadesInOverTwoHundredTicks) {
  // the encoders lose their zero in the tissue and find it again
  pushIn();
  run_.falcon->homed = 0x30;
  run_.goOn(25 * kMs);
  EXPECT_EQ(run_.haptic->force_N(), 0);
  EXPECT_EQ(run_.haptic->reading().condition & kDeviceNotReady, kDeviceNotReady);
  run_.falcon->homed = falcon::kInHomed;
  while ((run_.haptic->reading().condition & kDeviceNotReady) != 0) run_.goOn(kMs);
  double most_N = 0;
  for (int tick = 1; tick <= 210; ++tick) {
    const double wanted_N = norm(run_.haptic->tick().report.wrench_W.force_N);
    most_N = std::max(most_N, wanted_N);
    ASSERT_NEAR(run_.haptic->force_N(), std::min(1.0, tick / 200.0) * wanted_N, 1e-9) << tick;
    run_.goOn(kMs);
  }
  EXPECT_GT(most_N, 0.3);
}

TEST_F(FalconWorld, aHoldTakesTheForceAwayWithinTwentyTicks) {
  pushIn();
  run_.falcon->homed = 0x30;
  while ((run_.haptic->reading().condition & kDeviceNotReady) == 0) run_.goOn(kMs);
  const double held_N = norm(run_.haptic->tick().report.wrench_W.force_N);
  for (int tick = 1; tick <= 25; ++tick) {
    ASSERT_NEAR(run_.haptic->force_N(), std::max(0.0, 1 - tick / 20.0) * held_N, 1e-9) << tick;
    // the motors rest as soon as the USB thread knows it
    if (tick > 1) {
      EXPECT_FALSE(torque(run_.sent.back()));
    }
    run_.goOn(kMs);
  }
}

TEST_F(FalconWorld, theSixthBadTickIsAFaultAndItsForceIsGoneTwentyTicksLater) {
  pushIn();
  double at_fault_N = run_.haptic->force_N();
  // the encoders slip: 20 mm and more, too fast for any hand
  run_.jumpGrip(1400);
  for (int k = 0; k < 10 && (run_.haptic->gate().flags() & kGateSampleRejected) == 0; ++k) run_.goOn(kMs);
  for (int bad = 1; bad <= 5; ++bad) {
    ASSERT_EQ(run_.haptic->gate().fault(), Fault::kNone) << bad;
    ASSERT_EQ(run_.haptic->gate().flags() & kGateSampleRejected, kGateSampleRejected) << bad;
    ASSERT_GT(run_.haptic->force_N(), 0.9 * at_fault_N) << "the force is held";
    at_fault_N = run_.haptic->force_N();
    run_.goOn(kMs);
  }
  ASSERT_EQ(run_.haptic->gate().fault(), Fault::kTipTooFast);
  for (int tick = 1; tick <= 25; ++tick) {
    ASSERT_NEAR(run_.haptic->force_N(), at_fault_N * std::max(0.0, 1 - tick / 20.0), 1e-9) << tick;
    run_.goOn(kMs);
  }
}

TEST_F(FalconWorld, twentyOneTicksOfSilenceAreAFault) {
  pushIn();
  run_.falcon->silent = true;
  // one answer may still be on its way
  while (run_.haptic->fresh()) run_.goOn(kMs);
  EXPECT_EQ(ticksUntilFault(50), 20);
  EXPECT_EQ(run_.haptic->gate().fault(), Fault::kDeviceSilent);
}

TEST_F(FalconWorld, aLostDeviceIsLookedForAfterTwentyMillisecondsThenEveryHalfSecond) {
  run_.falcon->looks.clear();
  run_.goOn(10 * kMs);
  const std::int64_t lost_ns = now();
  run_.falcon->unplug();
  run_.goOn(2'200 * kMs);
  ASSERT_EQ(run_.falcon->looks.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_EQ(run_.falcon->looks[i].at_ns, lost_ns + 20 * kMs + static_cast<std::int64_t>(i) * 500 * kMs)
        << i;
  EXPECT_EQ(run_.haptic->gate().fault(), Fault::kDeviceLost);
  // what arrives is opened at once
  run_.sent.clear();
  const std::int64_t back_ns = now();
  run_.plugIn();
  run_.goOn(50 * kMs);
  ASSERT_EQ(run_.falcon->looks.size(), 6u);
  EXPECT_EQ(run_.falcon->looks[5].at_ns, back_ns);
  EXPECT_TRUE(run_.haptic->fresh());
  for (const FalconRun::Sent& sent : run_.sent) EXPECT_FALSE(torque(sent)) << "without an acknowledgement";
}

TEST_F(FalconWorld, theSixthTryThatFindsItOpensIt) {
  // no hotplug: nobody says that it is back
  run_.falcon->looks.clear();
  run_.falcon->unplug();
  const std::int64_t lost_ns = now();
  run_.world.at(lost_ns + 2'100 * kMs, [this] { run_.falcon->plugged = true; });
  run_.goOn(2'500 * kMs);
  EXPECT_FALSE(run_.haptic->fresh());
  run_.goOn(50 * kMs);
  EXPECT_TRUE(run_.haptic->fresh());
  ASSERT_EQ(run_.falcon->looks.size(), 6u);
  EXPECT_EQ(run_.falcon->looks[5].at_ns, lost_ns + 2'520 * kMs);
}

TEST_F(FalconWorld, aSilentDeviceIsTroubleAfterAHundredMillisecondsAndOpenedAgainAfterASecond) {
  run_.falcon->looks.clear();
  run_.falcon->silent = true;
  const std::int64_t silent_ns = now();
  while ((run_.haptic->reading().condition & kDeviceTrouble) == 0) run_.goOn(kMs);
  // it is asked every 6 ms, a tick follows
  EXPECT_GE(now() - silent_ns, 99 * kMs);
  EXPECT_LE(now() - silent_ns, 109 * kMs);
  run_.goOn(1'300 * kMs);
  // the last command waits 100 ms for its answer, then 20 ms of breath
  ASSERT_FALSE(run_.falcon->looks.empty());
  EXPECT_GT(run_.falcon->looks[0].at_ns - silent_ns, 1'119 * kMs);
  EXPECT_LT(run_.falcon->looks[0].at_ns - silent_ns, 1'128 * kMs);
}

TEST_F(FalconWorld, aPowerCutBringsItsFirmwareBackAndWaitsForItsZero) {
  run_.falcon->unplug();
  run_.falcon->runs = false;
  run_.falcon->homed = 0;
  run_.goOn(100 * kMs);
  run_.plugIn();
  run_.goOn(300 * kMs);
  EXPECT_EQ(run_.falcon->loads, 1);
  EXPECT_EQ(run_.haptic->reading().condition, static_cast<std::uint32_t>(kDeviceNotReady));
  run_.falcon->homed = falcon::kInHomed;
  run_.goOn(5 * kMs);
  EXPECT_TRUE(run_.haptic->fresh());
}

TEST_F(FalconWorld, theEndIsOneCommandOfZeroTorqueThatIsAnswered) {
  pushIn();
  run_.sent.clear();
  run_.end();
  const auto isLast = [](const FalconRun::Sent& sent) { return sent.command == falcon::Command{}; };
  EXPECT_EQ(std::count_if(run_.sent.begin(), run_.sent.end(), isLast), 1);
  EXPECT_TRUE(isLast(run_.sent.back()));
  EXPECT_EQ(run_.hand.motors, Motors{});
}

TEST_F(FalconWorld, theEndIsSaidAgainEverySixMillisecondsToADeafDeviceForATenthOfASecond) {
  pushIn();
  run_.falcon->silent = true;
  run_.sent.clear();
  run_.end();
  std::vector<std::int64_t> said_ns;
  for (const FalconRun::Sent& sent : run_.sent)
    if (sent.command == falcon::Command{}) said_ns.push_back(sent.at_ns);
  ASSERT_EQ(said_ns.size(), 17u);
  for (std::size_t i = 1; i < said_ns.size(); ++i) EXPECT_EQ(said_ns[i] - said_ns[i - 1], 6 * kMs);
}

}  // namespace
}  // namespace needlelab::test
