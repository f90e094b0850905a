#include "client/device/haptic_chain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/scenes.h"

namespace needlelab {
namespace {

constexpr double kChainRate_hz = 1000;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// a needle that points down, its hub on the handle, 100 mm beside it
const Pose kTool{{0.1, 0, 0}, {1, 0, 0, 0}};

DeviceReading at(double z_m) {
  DeviceReading reading;
  reading.X_WH = {{-0.1, 0, z_m}, {}};
  return reading;
}

class HapticChainTest : public testing::Test {
 protected:
  // the tip slides down at 10 mm/s from 2 mm above the skin; the gate's start ramp is over before it gets
  // there
  void insert(int ticks) {
    for (int k = 0; k < ticks; ++k) chain_.tick(at(0.002 - 1e-5 * k), true, 1, 1.0, tick_);
  }
  const SceneModel model_ = *compile(test::paperOneDof(), kChainRate_hz);
  HapticChain chain_{model_, DeviceLimits{}, kTool};
  ChainTick tick_;
};

TEST_F(HapticChainTest, theHandleGetsForceAndItsLever) {
  insert(1000);
  EXPECT_NEAR(tick_.report.cutting_N, -1, 1e-9);
  EXPECT_NEAR(tick_.rendered_W.force_N.z, 1, 1e-9);
  EXPECT_NEAR(tick_.rendered_W.torque_Nm.y, -0.1, 1e-9);  // (0.1, 0, 0) × (0, 0, 1)
  const GestureSample sample = sampleOf(tick_, 7, 8, 9);
  EXPECT_NEAR(sample.torque_W_Nm[1], 0, 1e-12);  // about the tip there is none
  EXPECT_EQ(sample.tick, 999u);
  EXPECT_EQ(sample.time_ns, 7);
  EXPECT_EQ(sample.device_ns, 8);
  EXPECT_EQ(sample.engine_ns, 9);
}

TEST_F(HapticChainTest, onlyTheAskedShareIsRendered) {
  insert(1000);
  chain_.tick(at(0.002 - 1e-5 * 1000), true, 1, 0.5, tick_);
  EXPECT_NEAR(tick_.report.wrench_W.force_N.z, 1, 1e-9);
  EXPECT_NEAR(tick_.rendered_W.force_N.z, 0.5, 1e-9);
}

TEST_F(HapticChainTest, missedTicksAreCountedAndNotStepped) {
  insert(10);
  chain_.tick(at(0.0018), true, 4, 1.0, tick_);
  EXPECT_EQ(tick_.tick, 13u);
}

TEST_F(HapticChainTest, aReadingThatIsNoNumberLeavesTheLastPlaceAndForce) {
  insert(1000);
  const ChainTick before = tick_;
  chain_.tick(at(kNaN), true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.X_WT.p, before.X_WT.p);
  EXPECT_EQ(tick_.rendered_W, before.rendered_W);
  EXPECT_EQ(tick_.report.flags, static_cast<std::uint32_t>(kFlagNotStepped));
  EXPECT_TRUE(tick_.gate_flags & kGateSampleRejected);
}

TEST_F(HapticChainTest, aJumpThatIsRejectedIsNoPlaceOfTheTip) {
  insert(1000);
  const ChainTick before = tick_;
  chain_.tick(at(0.4), true, 1, 1.0, tick_);
  EXPECT_TRUE(tick_.gate_flags & kGateSampleRejected);
  EXPECT_EQ(tick_.X_WT.p, before.X_WT.p);
}

TEST_F(HapticChainTest, aFaultStaysUntilItIsAcknowledged) {
  insert(1000);
  for (int k = 0; k < 40; ++k) chain_.tick(at(kNaN), true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.fault, Fault::kSampleNotFinite);
  EXPECT_EQ(norm(tick_.rendered_W.force_N), 0);
  for (int k = 0; k < 40; ++k) chain_.tick(at(0.05), true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.fault, Fault::kSampleNotFinite);
}

TEST_F(HapticChainTest, plungerIsHeldToItsRange) {
  DeviceReading reading = at(0.01);
  reading.plunger = 3;
  chain_.tick(reading, true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.plunger, 1);
  reading.plunger = kNaN;
  chain_.tick(reading, true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.plunger, 1) << "what is no number moves nothing";
  reading.plunger = -2;
  chain_.tick(reading, true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.plunger, 0);
}

TEST_F(HapticChainTest, aDurationBeyondTheFieldIsHeld) {
  insert(1);
  EXPECT_EQ(sampleOf(tick_, 0, std::int64_t{1} << 40, -5).device_ns,
            std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(sampleOf(tick_, 0, 0, -5).engine_ns, 0);
}

}  // namespace
}  // namespace needlelab
