// The Virtuose in a simulated world: haptic thread, keep-alive, keeper and device, exact to the tick.
#include <cmath>

#include "tests/support/gate_rules.h"
#include "tests/support/haptic_thread.h"
#include "tests/support/scenes.h"
#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

/// The device's own controller: a cycle each millisecond.
class StandinCycles final : public Turns {
 public:
  StandinCycles(TimeSource& time, Standin& standin) : time_(time), standin_(standin) {}
  std::optional<std::int64_t> turn() noexcept override {
    if (stop) return std::nullopt;
    standin_.advance(kTick_s);
    return time_.nowNs() + kMs;
  }
  void rest(std::int64_t until_ns) noexcept override { time_.sleepUntilNs(until_ns); }
  bool stop = false;

 private:
  TimeSource& time_;
  Standin& standin_;
};

class VirtuoseWorld : public testing::Test {
 protected:
  void SetUp() override {
    standin_.command("place 0 0 0.01 1 0 0 0");
    const Status done = device_.open(1000);
    ASSERT_TRUE(done.ok()) << done.error().message;
    cycles_running_ = world_.start(cycles_, {"virtuose", 0});
    goOn(kMs / 2);
    rules_ = std::make_unique<GateRules>(device_.info().limits,
                                         [](const std::string& what) { ADD_FAILURE() << what; });
    haptic_.on_tick = [this] {
      ++ticks_;
      rules_->check(haptic_);
    };
    keeper_ = std::make_unique<DeviceMaintenance>(device_, world_, world_);
    haptic_running_ = world_.start(haptic_, {"haptic", 0});
  }
  void TearDown() override {
    haptic_.stop();
    haptic_running_.reset();
    keeper_.reset();
    device_.close();
    cycles_.stop = true;
    cycles_running_.reset();
  }
  void goOn(std::int64_t for_ns) { world_.sleepForNs(for_ns); }
  void pushIn() {
    // 20 mm/s, for another 0.9 s
    standin_.command("hand 0 0 -0.03 1 0 0 0 2.0");
    goOn(1'100 * kMs);
    ASSERT_GT(haptic_.force_N(), 0.4);
  }
  [[nodiscard]] Fault fault() const { return haptic_.gate().fault(); }
  [[nodiscard]] double felt_N() const {
    const StandinState state = standin_.state();
    return norm(Vec3{state.felt[0], state.felt[1], state.felt[2]});
  }
  void acknowledgeOutside() {
    standin_.command("hand 0 0 0.01 1 0 0 0 0.1");
    goOn(400 * kMs);
    haptic_.acknowledge();
    goOn(5 * kMs);
  }
  static VirtuoseOptions options() {
    VirtuoseOptions options;
    options.library = kStandinLibrary;
    return options;
  }

  Standin standin_;
  DeviceWorld world_;
  StandinCycles cycles_{world_, standin_};
  VirtuoseDevice device_{options(), world_, world_};
  SceneModel model_ = *compile(paperOneDof(), 1000);
  HapticThread haptic_{world_, device_, model_};
  std::unique_ptr<GateRules> rules_;
  std::unique_ptr<DeviceMaintenance> keeper_;
  std::unique_ptr<RunningTurns> cycles_running_, haptic_running_;
  int ticks_ = 0;
};

TEST_F(VirtuoseWorld, fiveBadTicksAreBridgedTheSixthIsAFault) {
  pushIn();
  // the next tick is in half a millisecond
  for (const int bad : {1, 5}) {
    standin_.command("bad_turn 1.1");
    for (int k = 1; k <= bad; ++k) {
      goOn(kMs);
      ASSERT_EQ(haptic_.gate().flags() & kGateSampleRejected, kGateSampleRejected) << k;
      ASSERT_EQ(fault(), Fault::kNone) << k;
      ASSERT_GT(haptic_.force_N(), 0.4) << "the force is held";
    }
    standin_.command("bad_turn 1");
    goOn(20 * kMs);
    ASSERT_EQ(fault(), Fault::kNone);
  }
  standin_.command("bad_turn 1.1");
  for (int k = 1; k <= 5; ++k) {
    goOn(kMs);
    ASSERT_EQ(fault(), Fault::kNone) << k;
  }
  const double at_fault_N = haptic_.force_N();
  for (int k = 1; k <= 25; ++k) {
    goOn(kMs);
    ASSERT_EQ(fault(), Fault::kOrientationInvalid);
    ASSERT_NEAR(haptic_.force_N(), at_fault_N * std::max(0.0, 1 - k / 20.0), 1e-9) << k;
  }
}

TEST_F(VirtuoseWorld, aReleasedHandleLosesTheForceIn20TicksAndGetsItBackOver200) {
  pushIn();
  standin_.command("dead_man 0");
  while ((haptic_.reading().condition & kDeviceReleased) == 0) goOn(kMs);
  for (int tick = 1; tick <= 20; ++tick) {
    const double wanted_N = norm(haptic_.tick().report.wrench_W.force_N);
    ASSERT_NEAR(haptic_.force_N(), std::max(0.0, 1 - tick / 20.0) * wanted_N, 1e-6) << tick;
    goOn(kMs);
  }
  goOn(100 * kMs);
  EXPECT_EQ(haptic_.force_N(), 0);
  standin_.command("dead_man 1");
  while ((haptic_.reading().condition & kDeviceHoldFlags) != 0) goOn(kMs);
  double most_N = 0;
  for (int tick = 1; tick <= 210; ++tick) {
    const double wanted_N = norm(haptic_.tick().report.wrench_W.force_N);
    most_N = std::max(most_N, wanted_N);
    ASSERT_NEAR(haptic_.force_N(), std::min(1.0, tick / 200.0) * wanted_N, 1e-9) << tick;
    goOn(kMs);
  }
  EXPECT_GT(most_N, 0.3);
}

TEST_F(VirtuoseWorld, aLostServiceIsLookedForEverMoreRarelyUpToFiveSeconds) {
  goOn(100 * kMs);
  standin_.command("daemon 0");
  std::vector<std::int64_t> tries_ns;
  long openings = standin_.state().openings;
  for (int ms = 0; ms < 30'000 && tries_ns.size() < 8; ++ms) {
    goOn(kMs);
    if (const long now = standin_.state().openings; now != openings) {
      ASSERT_EQ(now, openings + 1);
      openings = now;
      tries_ns.push_back(world_.nowNs());
    }
  }
  ASSERT_EQ(tries_ns.size(), 8u);
  const std::int64_t waits_ms[] = {500, 1000, 2000, 4000, 5000, 5000, 5000};
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ((tries_ns[i + 1] - tries_ns[i]) / kMs, waits_ms[i]) << i;
  EXPECT_EQ(fault(), Fault::kDeviceLost);

  // it is back: the next try finds it, and the waits begin anew
  standin_.command("daemon 1");
  goOn(4'990 * kMs);
  EXPECT_FALSE(haptic_.fresh());
  goOn(20 * kMs);
  EXPECT_TRUE(haptic_.fresh());
  standin_.command("daemon 0");
  openings = standin_.state().openings;
  const auto tries = [&] { return standin_.state().openings - openings; };
  goOn(480 * kMs);  // 490 ms after it was opened
  EXPECT_EQ(tries(), 0);
  goOn(20 * kMs);
  EXPECT_EQ(tries(), 1);
  goOn(480 * kMs);
  EXPECT_EQ(tries(), 1);
  goOn(20 * kMs);
  EXPECT_EQ(tries(), 2);
}

TEST_F(VirtuoseWorld, aHungHapticThreadIsCutByTheDevicesOwnWatchdogAfterTwoSeconds) {
  pushIn();
  haptic_.hangUntil(world_.nowNs() + 3'000 * kMs);
  goOn(2 * kMs);
  const std::int64_t last_tick_ns = haptic_.lastTickNs();
  while (felt_N() > 0 && world_.nowNs() < last_tick_ns + 2'900 * kMs) goOn(kMs);
  // a command of the middle of a millisecond counts from that cycle on
  EXPECT_NEAR(static_cast<double>(world_.nowNs() - last_tick_ns), 2e9, 3.5e6);
  // it comes back, finds its link lost, and the keeper opens it anew
  goOn(1'200 * kMs);
  EXPECT_EQ(fault(), Fault::kDeviceLost);
  EXPECT_TRUE(haptic_.fresh());
  EXPECT_EQ(haptic_.force_N(), 0);
  acknowledgeOutside();
  EXPECT_EQ(fault(), Fault::kNone);
}

TEST_F(VirtuoseWorld, aShortSilenceOfTheLoopFadesTheForceOutAndInAgain) {
  pushIn();
  haptic_.hangUntil(world_.nowNs() + 100 * kMs);
  goOn(kMs);
  const int ticks = ticks_;
  goOn(50 * kMs);
  ASSERT_EQ(ticks_, ticks);
  while (ticks_ == ticks) goOn(kMs);
  EXPECT_EQ(fault(), Fault::kNone);
  EXPECT_GT(haptic_.elapsedTicks(), 90);
  for (int tick = 1; tick < 20; ++tick) goOn(kMs);
  EXPECT_EQ(haptic_.force_N(), 0);
  goOn(200 * kMs);
  EXPECT_NEAR(haptic_.force_N(), norm(haptic_.tick().report.wrench_W.force_N), 1e-9);
}

}  // namespace
}  // namespace needlelab::test
