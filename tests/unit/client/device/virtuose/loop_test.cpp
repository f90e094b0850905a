// Whole strokes into a shoulder: gate and engine in a closed loop with the stand-in's mechanics, on virtual
// time.
#include <cmath>

#include "client/device/simulated_device.h"
#include "common/profile/profile.h"
#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

// a needle that points down, straight above the shoulder; the handle's frame is the tip's
constexpr double kOutside_m = 0.02, kInside_m = -0.02;
const Quat kDown{1, 0, 0, 0};
constexpr int kEnd = 3500;  // ticks

HandPlan strokePlan() {
  return HandPlan(Pose{{0, 0, kOutside_m}, kDown})
      .hold(0.4)
      .moveIn({{0, 0, kInside_m}, kDown}, 1.0, Motion::kLinear)
      .hold(0.8)
      .moveIn({{0, 0, kOutside_m}, kDown}, 1.0, Motion::kLinear)
      .hold(0.4);
}

// The same for the stand-in's hand.
const char* const kStroke =
    "0.0 place 0 0 0.02 1 0 0 0\n"
    "0.4 hand 0 0 -0.02 1 0 0 0 1.0\n"
    "2.2 hand 0 0 0.02 1 0 0 0 1.0\n";

// in all the time, at 25 mm/s: from 1.5 s to 2.4 s in the muscle
const char* const kLongWay =
    "0.0 place 0 0 0.02 1 0 0 0\n"
    "0.4 hand 0 0 -0.03 1 0 0 0 2.0\n";

SceneModel shoulder() {
  const auto profile = loadProfile(NEEDLELAB_SAMPLES "/shoulder-adult.json");
  if (!profile.ok()) throw std::runtime_error(profile.error().message);
  return *compile(*sceneSpecOf(*profile), 1000);
}

class VirtuoseLoop : public testing::Test {
 protected:
  void begin(const std::string& script) {
    standin_.script(script);
    const Status status = device_.open(1000);
    ASSERT_TRUE(status.ok()) << status.error().message;
  }
  // Tick k is at k ms. `mask` removes flags, like a backend that does not query them.
  const ChainTick& tick(std::uint32_t mask = 0) {
    if (number_++ > 0) standin_.advance(kTick_s);
    const bool fresh = device_.read(reading_) == DeviceRead::kFresh;
    reading_.condition &= ~mask;
    device_.write(chain_.tick(reading_, fresh, 1, 1.0, now_));
    return now_;
  }
  void until(int number, std::uint32_t mask = 0) {
    while (number_ < number) tick(mask);
  }
  [[nodiscard]] double rendered() const { return norm(now_.rendered_W.force_N); }
  [[nodiscard]] double felt() const {
    const StandinState s = standin_.state();
    return norm(Vec3{s.felt[0], s.felt[1], s.felt[2]});
  }

  Standin standin_;
  DeviceWorld world_;
  VirtuoseDevice device_{standinOptions(), world_, world_};
  SceneModel model_ = shoulder();
  HapticChain chain_{model_, device_.info().limits, Pose{}};
  DeviceReading reading_;
  ChainTick now_;
  int number_ = 0;
};

TEST_F(VirtuoseLoop, aStrokeFeelsAsOnTheSimulatedDevice) {
  SimulatedDeviceOptions options;
  options.hand.tremor_m = 0;
  SimulatedDevice simulated(options, strokePlan());
  ASSERT_TRUE(simulated.open(1000).ok());
  HapticChain other(model_, simulated.info().limits, Pose{});
  DeviceReading other_reading;
  ChainTick other_tick;

  begin(kStroke);
  double worst_m = 0, worst_N = 0, most_N = 0, deepest_m = 0;
  Vec3 asked;  // in the tick before the last
  Vec3 asked_last;
  for (int k = 0; k < kEnd; ++k) {
    tick();
    ASSERT_EQ(simulated.read(other_reading), DeviceRead::kFresh) << k;
    simulated.write(other.tick(other_reading, true, 1, 1.0, other_tick));

    // The current force was commanded two readings ago: one millisecond each for the transfer and the
    // device's cycle.
    const StandinState truth = standin_.state();
    ASSERT_NEAR(truth.felt[2], asked.z, 1e-6) << k;
    asked = asked_last;
    asked_last = now_.rendered_W.force_N;

    worst_m = std::max(worst_m, norm(now_.X_WT.p - other_tick.X_WT.p));
    worst_N = std::max(worst_N, norm(now_.rendered_W.force_N - other_tick.rendered_W.force_N));
    most_N = std::max(most_N, rendered());
    deepest_m = std::min(deepest_m, now_.X_WT.p.z);
  }
  RecordProperty("worst_m", std::to_string(worst_m));
  std::printf(
      "apart from the simulated device by at most %.1f um and %.1f mN; greatest force %.2f N, %.1f mm deep\n",
      worst_m * 1e6, worst_N * 1e3, most_N, deepest_m * 1e3);
  // Two programs compute the same mechanics, with floats between them: allow one encoder step, and its force
  // at 500 N/m.
  EXPECT_LE(worst_m, 20e-6);
  EXPECT_LE(worst_N, 0.02);
  EXPECT_GT(most_N, 1.5);
  EXPECT_LT(deepest_m, -0.012);
  EXPECT_EQ(chain_.gate().fault(), Fault::kNone);
  EXPECT_EQ(standin_.complaints(), "");
  EXPECT_EQ(standin_.state().overruns, 0);
}

TEST_F(VirtuoseLoop, aHandThatLetsGoInTheTissueHasNoForceUntilItIsBackAndThenSlowly) {
  begin(std::string(kLongWay) + "1.8 dead_man 0\n2.0 dead_man 1\n");
  until(1800);
  const double before = rendered();
  ASSERT_GT(before, 0.7);
  until(1821);
  EXPECT_EQ(rendered(), 0);
  while (number_ < 2000) ASSERT_EQ(norm(tick().rendered_W.force_N), 0) << number_;
  EXPECT_TRUE(now_.gate_flags & kDeviceReleased);
  // back: over 200 ms, no jump, no FAULT
  double last = 0;
  while (number_ < 2210) {
    tick();
    ASSERT_LE(std::abs(rendered() - last), 0.05) << number_;
    last = rendered();
  }
  EXPECT_GT(last, 0.8 * before);
  EXPECT_EQ(now_.fault, Fault::kNone);
}

TEST_F(VirtuoseLoop, aBackendThatDoesNotAskForTheDeadManWouldJumpAtTheHand) {
  begin(std::string(kLongWay) + "1.8 dead_man 0\n2.0 dead_man 1\n");
  until(2000, kDeviceReleased | kDevicePowerOff);
  EXPECT_GT(rendered(), 1);  // commands a force that the hand does not feel …
  EXPECT_EQ(felt(), 0);
  until(2003, kDeviceReleased | kDevicePowerOff);
  EXPECT_GT(felt(), 1);  // … and all of it comes at once
}

TEST_F(VirtuoseLoop, emergencyStopIsAFaultUntilItIsFreeAcknowledgedAndOutside) {
  begin(std::string(kStroke) + "1.5 estop press\n1.6 estop free\n1.6 switch 1\n");
  until(1500);
  ASSERT_GT(rendered(), 1);
  tick();
  EXPECT_EQ(now_.fault, Fault::kEmergencyStop);
  chain_.acknowledge();  // while it is pressed: does not count
  until(1521);
  EXPECT_EQ(rendered(), 0);
  until(1700);
  EXPECT_EQ(now_.fault, Fault::kEmergencyStop);
  EXPECT_EQ(rendered(), 0);
  chain_.acknowledge();
  until(2000);
  EXPECT_EQ(now_.fault, Fault::kEmergencyStop);  // still in the tissue
  until(kEnd);
  EXPECT_EQ(now_.fault, Fault::kNone);
  // and the next stroke is felt again
  standin_.command("hand 0 0 -0.02 1 0 0 0 1.0");
  until(kEnd + 1000);
  EXPECT_GT(rendered(), 1);
  EXPECT_GT(felt(), 1);
}

TEST_F(VirtuoseLoop, overheatingTakesTheForce) {
  begin(std::string(kStroke) + "1.5 overheat 1\n");
  until(1527);  // queried every 6 ticks, gone within 20
  EXPECT_EQ(now_.fault, Fault::kDeviceOverheated);
  EXPECT_EQ(rendered(), 0);
}

TEST_F(VirtuoseLoop, thePowerSwitchIsAHold) {
  begin(std::string(kLongWay) + "1.8 switch 0\n2.0 switch 1\n");
  until(1827);
  EXPECT_EQ(rendered(), 0);
  EXPECT_EQ(now_.fault, Fault::kNone);
  until(2000);
  double last = 0;
  while (number_ < 2210) {
    tick();
    ASSERT_LE(std::abs(rendered() - last), 0.05) << number_;
    last = rendered();
  }
  EXPECT_GT(felt(), 1);
}

TEST_F(VirtuoseLoop, aLinkLostInTheTissueComesBackWithoutForce) {
  begin(std::string(kStroke) + "1.5 link_down 0.1\n");
  until(1500);
  ASSERT_GT(felt(), 1);
  until(1605);
  EXPECT_EQ(now_.fault, Fault::kDeviceLost);
  // The link is down: the device renders its last command until its own watchdog expires.
  EXPECT_GT(felt(), 1);
  device_.maintain();
  until(1610);
  EXPECT_EQ(now_.fault, Fault::kDeviceLost);
  EXPECT_EQ(reading_.condition & kDeviceLost, 0u);  // it answers again …
  EXPECT_EQ(felt(), 0);                             // … and got a zero command at once
  until(1900);
  EXPECT_EQ(felt(), 0);
}

}  // namespace
}  // namespace needlelab::test
