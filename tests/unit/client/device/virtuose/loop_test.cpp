// Whole strokes into a shoulder: gate and engine in a closed loop with the stand-in's mechanics, one call per
// tick.
#include "client/device/hand/simulated_device.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

// a needle that points down, straight above the shoulder; the handle's frame equals the tip's
SceneModel shoulder() {
  const auto profile = loadProfile(NEEDLELAB_SAMPLES "/shoulder-adult.json");
  if (!profile.ok()) throw std::runtime_error(profile.error().message);
  return *compile(*sceneSpecOf(*profile), 1000);
}

class VirtuoseLoop : public VirtuoseTest {
 protected:
  // `mask` removes flags, like a backend that does not query them
  const ChainTick& step(std::uint32_t mask = 0) {
    if (number_++ > 0) standin_.advance(kTick_s);
    const bool fresh = device_.read(reading_) == DeviceRead::kFresh;
    reading_.condition &= ~mask;
    device_.write(chain_.tick(reading_, fresh, 1, 1.0, now_));
    return now_;
  }

  SceneModel model_ = shoulder();
  HapticChain chain_{model_, device_.info().limits, Pose{}};
  ChainTick now_;
  int number_ = 0;
};

TEST_F(VirtuoseLoop, aStrokeFeelsAsOnTheSimulatedDevice) {
  const Quat down{1, 0, 0, 0};
  SimulatedDeviceOptions options;
  options.hand.tremor_m = 0;
  SimulatedDevice simulated(options, HandPlan(Pose{{0, 0, 0.02}, down})
                                         .hold(0.4)
                                         .moveIn({{0, 0, -0.02}, down}, 1.0, Motion::kLinear)
                                         .hold(0.8)
                                         .moveIn({{0, 0, 0.02}, down}, 1.0, Motion::kLinear)
                                         .hold(0.4));
  ASSERT_TRUE(simulated.open(1000).ok());
  HapticChain other(model_, simulated.info().limits, Pose{});
  DeviceReading other_reading;
  ChainTick other_tick;

  standin_.script(
      "0.0 place 0 0 0.02 1 0 0 0\n0.4 hand 0 0 -0.02 1 0 0 0 1.0\n2.2 hand 0 0 0.02 1 0 0 0 1.0\n");
  open();
  double worst_m = 0, worst_N = 0, max_N = 0, deepest_m = 0;
  Vec3 asked, asked_last;  // in the last tick but one, and in the last
  for (int k = 0; k < 3500; ++k) {
    step();
    ASSERT_EQ(simulated.read(other_reading), DeviceRead::kFresh) << k;
    simulated.write(other.tick(other_reading, true, 1, 1.0, other_tick));
    // The current force was commanded two readings ago: the transfer and the device's cycle take one
    // millisecond each.
    ASSERT_NEAR(standin_.state().felt[2], asked.z, 1e-6) << k;
    asked = asked_last;
    asked_last = now_.rendered_W.force_N;
    worst_m = std::max(worst_m, norm(now_.X_WT.p - other_tick.X_WT.p));
    worst_N = std::max(worst_N, norm(now_.rendered_W.force_N - other_tick.rendered_W.force_N));
    max_N = std::max(max_N, norm(now_.rendered_W.force_N));
    deepest_m = std::min(deepest_m, now_.X_WT.p.z);
  }
  // Two programs compute the same mechanics, with floats between them: allow one encoder step, and its force
  // at 500 N/m.
  EXPECT_LE(worst_m, 20e-6);
  EXPECT_LE(worst_N, 0.02);
  EXPECT_GT(max_N, 1.5);
  EXPECT_LT(deepest_m, -0.012);
  EXPECT_EQ(chain_.gate().fault(), Fault::kNone);
  EXPECT_EQ(standin_.complaints(), "");
  EXPECT_EQ(standin_.state().overruns, 0);
}

TEST_F(VirtuoseLoop, aBackendIgnoringTheDeadManSwitchJumps) {
  standin_.script(
      "0.0 place 0 0 0.02 1 0 0 0\n0.4 hand 0 0 -0.03 1 0 0 0 2.0\n1.8 dead_man 0\n2.0 dead_man 1\n");
  open();
  while (number_ < 2000) step(kDeviceReleased | kDevicePowerOff);
  EXPECT_GT(norm(now_.rendered_W.force_N), 1);  // commands a force that the hand does not feel …
  EXPECT_EQ(standin_.feltForce_N(), 0);
  while (number_ < 2003) step(kDeviceReleased | kDevicePowerOff);
  EXPECT_GT(standin_.feltForce_N(), 1);  // … and all of it comes at once
}

}  // namespace
}  // namespace needlelab::test
