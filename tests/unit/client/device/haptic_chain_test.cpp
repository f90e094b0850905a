#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "client/device/haptic_chain.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/surface.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/random.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

constexpr double kChainRate_hz = 1000;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// a needle that points down; its hub is on the handle, 100 mm to the side
const Pose kTool{{0.1, 0, 0}, {1, 0, 0, 0}};

DeviceReading at(double z_m) {
  DeviceReading reading;
  reading.X_WH = {{-0.1, 0, z_m}, {}};
  return reading;
}

class HapticChainTest : public testing::Test {
 protected:
  // the tip moves down at 10 mm/s from 2 mm above the skin; the gate's start ramp has ended before it arrives
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
  EXPECT_NEAR(sample.torque_W_Nm[1], 0, 1e-12);  // no torque about the tip
  EXPECT_EQ(sample.tick, 999u);
  EXPECT_EQ(sample.time_ns, 7);
  EXPECT_EQ(sample.device_ns, 8);
  EXPECT_EQ(sample.engine_ns, 9);
}

// a device without orientation: the needle stands on the skin of the path in use, which is the arm's
TEST_F(HapticChainTest, inABodyTheAssumedNeedleStandsOnItsSkin) {
  const SceneModel body = *compile(sceneIn(arm()), kChainRate_hz);
  DeviceInfo device;
  device.has_orientation = false;
  HapticChain chain(body, device, Pose{});
  const Vec3 center_m{0, 0, -0.04}, out = normalized(Vec3{0, 0.6, 0.8});  // across the arm, of 40 mm radius
  for (int k = 0; k < 1000; ++k) {
    DeviceReading reading;
    reading.X_WH.p = center_m + out * (0.045 - 1e-5 * k);
    chain.tick(reading, true, 1, 1.0, tick_);
  }
  EXPECT_EQ(tick_.report.layer, 1) << "muscle, below 2 mm of skin";
  EXPECT_NEAR(tick_.report.depth_m, 0.00499, 1e-5);
  EXPECT_NEAR(norm(zAxis(tick_.X_WT.q) + out), 0, 1e-3);
  EXPECT_NEAR(norm(normalized(tick_.report.wrench_W.force_N) - out), 0, 1e-2) << "along the needle";
}

/// Paths that never come.
class NoPaths final : public PathMaker {
 public:
  void ask(const PathAsk&) noexcept override { ++asked; }
  bool take(PathStack*&) noexcept override { return false; }
  void retire(PathStack*) noexcept override {}
  int asked = 0;
};

TEST_F(HapticChainTest, inABodyItWaitsForTheGivenMakersPaths) {
  const SceneModel body = *compile(sceneIn(arm()), kChainRate_hz);
  NoPaths paths;
  HapticChain chain(body, DeviceLimits{}, kTool, &paths);
  for (int k = 0; k < 1000; ++k) chain.tick(at(0.002 - 1e-5 * k), true, 1, 1.0, tick_);
  EXPECT_EQ(paths.asked, 1);
  EXPECT_EQ(norm(tick_.report.wrench_W.force_N), 0) << "no path, no force";
  EXPECT_NEAR(tick_.report.depth_m, 0.00799, 1e-6);
}

TEST_F(HapticChainTest, eachPressOfTheCapButtonSwitchesTheCapOnce) {
  SceneSpec scene = paperOneDof();
  scene.effects |= bitOf(Effect::kPalpation);
  useUsualNumbers(effectEntry(Effect::kPalpation), scene);
  const SceneModel model = *compile(scene, kChainRate_hz);
  HapticChain chain(model, DeviceLimits{}, kTool);
  chain.beginCapped();
  const auto capped = [&](bool pressed, bool fresh = true) {
    DeviceReading reading = at(0.01);
    reading.buttons = pressed ? 1u << kCapButton | 1u : 1u;
    chain.tick(reading, fresh, 1, 1.0, tick_);
    return (tick_.report.flags & kFlagCapped) != 0;
  };
  EXPECT_TRUE(capped(false));
  EXPECT_FALSE(capped(true));
  EXPECT_FALSE(capped(true)) << "held";
  capped(false, false);  // no reading, no release
  EXPECT_FALSE(capped(true));
  EXPECT_FALSE(capped(false));
  EXPECT_TRUE(capped(true));
  chain.switchCap();
  EXPECT_FALSE(capped(true)) << "as a key does";
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

// On the far side of a limb the fixture still guides a needle that went through; after a FAULT the needle is
// free.
TEST(HapticChainFault, aFaultRemovesAllForceFromANeedleInALimb) {
  SceneSpec scene = allEffects();
  scene.limb = SphereLimb{{0, 0, -0.013}, 0.013};
  const SceneModel model = *compile(scene, 1000);
  HapticChain chain(model, DeviceLimits{}, Pose{});
  ChainTick tick;
  const auto go = [&](Vec3 p_W_m, std::uint32_t condition = 0) {
    DeviceReading reading;
    reading.X_WH = {p_W_m, orientationAlong({0, 0, -1})};
    reading.condition = condition;
    chain.tick(reading, true, 1, 1.0, tick);
  };
  for (int k = 0; k <= 800; ++k) go({0, 0, 0.005 - 5e-5 * k});
  const Vec3 beyond{0.005, 0, -0.035};
  for (int k = 0; k <= 100; ++k) go({5e-5 * k, 0, beyond.z});
  ASSERT_LT(tick.report.depth_m, 0);
  ASSERT_GT(norm(tick.rendered_W.force_N), 0.3) << "it is through";
  for (int k = 0; k < 50; ++k) go(beyond, kDeviceEmergencyStop);
  go(beyond);
  chain.acknowledge();
  for (int k = 0; k < 400; ++k) {
    go(beyond);
    ASSERT_EQ(norm(tick.rendered_W.force_N), 0) << k;
  }
  EXPECT_EQ(tick.fault, Fault::kNone);
  EXPECT_EQ(tick.report.layer, -1);
  // from there it enters as from any side
  for (int k = 0; k <= 300; ++k) go(beyond + Vec3{0, 0, 5e-5 * k});
  EXPECT_GT(tick.report.insertion_m, 0.002);
}

// During the FAULT the needle is taken to the arm's side, under the plane of the path that was in use. There
// it is outside: the restart is allowed, without force, and it enters as from any side.
TEST(HapticChainFault, inABodyARestartAsksTheBodyWhetherTheTipIsOutside) {
  const SceneModel body = *compile(sceneIn(arm()), kChainRate_hz);
  HapticChain chain(body, DeviceLimits{}, Pose{});
  ChainTick tick;
  const auto go = [&](Vec3 p_W_m, Vec3 axis, std::uint32_t condition = 0) {
    DeviceReading reading;
    reading.X_WH = {p_W_m, orientationAlong(axis)};
    reading.condition = condition;
    chain.tick(reading, true, 1, 1.0, tick);
  };
  const Vec3 down{0, 0, -1}, aside{0, -1, 0};
  for (int k = 0; k <= 500; ++k) go({0, 0, 0.01 - 5e-5 * k}, down);
  ASSERT_GT(norm(tick.rendered_W.force_N), 0.3) << "in the tissue";
  // out, and round the arm to its side, 20 mm from the skin
  for (int k = 0; k <= 400; ++k) go({0, 0, -0.015 + 1e-4 * k}, down, kDeviceEmergencyStop);
  for (int k = 0; k <= 600; ++k) go({0, 1e-4 * k, 0.025}, down, kDeviceEmergencyStop);
  for (int k = 0; k <= 650; ++k) go({0, 0.06, 0.025 - 1e-4 * k}, aside, kDeviceEmergencyStop);
  const Vec3 beside{0, 0.06, -0.04};
  go(beside, aside);
  chain.acknowledge();
  for (int k = 0; k < 400; ++k) {
    go(beside, aside);
    ASSERT_EQ(norm(tick.rendered_W.force_N), 0) << k;
  }
  EXPECT_EQ(tick.fault, Fault::kNone);
  EXPECT_EQ(tick.report.layer, -1);
  for (int k = 0; k <= 500; ++k) go(beside + aside * (5e-5 * k), aside);
  EXPECT_NEAR(tick.report.insertion_m, 0.005, 1e-4);
}

TEST_F(HapticChainTest, plungerIsHeldToItsRange) {
  DeviceReading reading = at(0.01);
  reading.plunger = 3;
  chain_.tick(reading, true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.plunger, 1);
  reading.plunger = kNaN;
  chain_.tick(reading, true, 1, 1.0, tick_);
  EXPECT_EQ(tick_.plunger, 1) << "NaN moves nothing";
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

// A device that measures no orientation and renders no torque runs the same scenes.

constexpr double kAxisRate_hz = 1000;

DeviceInfo pointDevice() {
  DeviceInfo info;
  info.renders_torque = info.has_orientation = false;
  return info;
}

DeviceReading at(Vec3 p) {
  DeviceReading reading;
  reading.X_WH = {p, {}};
  return reading;
}

Vec3 axisOf(const ChainTick& tick) {
  return zAxis(tick.X_WT.q);
}

TEST(AssumedAxis, theRotationTakesZToTheAxisEverywhere) {
  Random random(3);
  for (int k = 0; k < 2000; ++k) {
    Vec3 axis = {random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)};
    if (k % 4 == 0) axis.z *= 1e-12;  // where the two paths meet
    if (k % 4 == 1) axis = {1e-9 * axis.x, 1e-9 * axis.y, k % 8 < 4 ? 1.0 : -1.0};
    if (norm(axis) < 1e-3) continue;
    axis = normalized(axis);
    const Quat q = rotationOfAxis(axis);
    ASSERT_NEAR(dot(q, q), 1, 1e-15);
    ASSERT_LE(norm(zAxis(q) - axis), 1e-15) << axis.x << " " << axis.y << " " << axis.z;
  }
  for (const Vec3 axis : {Vec3{0, 0, 1}, Vec3{0, 0, -1}}) EXPECT_EQ(zAxis(rotationOfAxis(axis)), axis);
}

// a path through each kind of limb: its entry point, and the outward direction there, by formula
struct Path {
  Limb limb;
  Vec3 from, to;
};
const Path kPaths[] = {
    {PlaneLimb{{0, 0, 0}, {0.3, -0.2, 2}}, {0.01, 0, 0.01}, {-0.01, 0.004, -0.012}},
    {SphereLimb{{0.02, 0.01, -0.05}, 0.04}, {0.03, 0.03, 0.02}, {0.02, 0.015, -0.03}},
    {CapsuleLimb{{0, -0.1, -0.05}, {0, 0.1, -0.05}, 0.04}, {0.02, 0.01, 0.01}, {0.005, 0.02, -0.04}},
    {CapsuleLimb{{0, -0.1, -0.05}, {0, 0.1, -0.05}, 0.04}, {0.01, 0.16, -0.05}, {0, 0.11, -0.05}},
};

class PointDevice : public testing::TestWithParam<Path> {
 protected:
  PointDevice() {
    SceneSpec spec = allEffects();
    spec.limb = GetParam().limb;
    spec.effects &= ~bitOf(Effect::kOrientationLimit);
    model_ = *compile(spec, kAxisRate_hz);
  }
  // from the start to the end of the path and back again
  Vec3 place(int k) const {
    const double share = k <= kTicks ? double(k) / kTicks : double(2 * kTicks - k) / kTicks;
    return GetParam().from + (GetParam().to - GetParam().from) * share;
  }
  static constexpr int kTicks = 1500;
  SceneModel model_;
};

TEST_P(PointDevice, theAxisIsTheInwardNormalAtEntryAndFromTwoMillimetresOnTheLineFromThere) {
  HapticChain chain(model_, pointDevice(), {});
  SimState state{};  // of the same engine, for P0
  StepReport report;
  ChainTick tick;
  Vec3 before = place(0), at_entry;
  bool inside = false;
  int entries = 0, ticks_inside = 0, pointing = 0;
  double force_N = 0;
  for (int k = 0; k < 2 * kTicks; ++k) {
    const Vec3 p = place(k);
    chain.tick(at(p), true, 1, 1.0, tick);
    ASSERT_EQ(tick.X_WT.p, p);
    const double depth_m = signedDepth(model_.limb, p);
    if (depth_m > 0 && !inside) {
      // P0 by its definition, δ by the limb's formula
      const double earlier_m = signedDepth(model_.limb, before);
      const Vec3 P0 = before + (p - before) * (earlier_m / (earlier_m - depth_m));
      at_entry = -surfaceNormal(model_.limb, P0, p - before);
      ++entries;
      ASSERT_TRUE(tick.report.flags & kFlagEntry);
    }
    inside = depth_m > 0;
    const Vec3 arm = p - state.p_entry_W_m;
    if (state.inside && norm(arm) >= 2e-3) {
      at_entry = normalized(arm);
      ++pointing;
    }
    const Vec3 expected = inside ? at_entry : -surfaceNormal(model_.limb, p, {0, 0, -1});
    ASSERT_LE(norm(axisOf(tick) - expected), 1e-14) << "tick " << k;
    step(model_, {tick.X_WT.p, tick.X_WT.q}, state, report);
    if (inside) {
      ++ticks_inside;
      force_N = std::max(force_N, norm(tick.rendered_W.force_N));
    }
    ASSERT_EQ(tick.rendered_W.torque_Nm, Vec3{}) << "never asked";
    ASSERT_EQ(tick.torque_at_tip_Nm, Vec3{});
    before = p;
  }
  EXPECT_EQ(entries, 1);
  EXPECT_GT(ticks_inside, 500);
  EXPECT_GT(pointing, 300);
  EXPECT_GT(force_N, 0.5) << "and it is felt";
}

// The engine gives the same bits if the axis −n is set explicitly, since u is −n.
TEST_P(PointDevice, theEngineGoesAlongTheNormal) {
  HapticChain chain(model_, pointDevice(), {});
  ChainTick tick;
  SimState state{};
  StepReport report;
  for (int k = 0; k < 2 * kTicks; ++k) {
    chain.tick(at(place(k)), true, 1, 1.0, tick);
    step(model_, {tick.X_WT.p, tick.X_WT.q}, state, report);
    ASSERT_EQ(report.wrench_W, tick.report.wrench_W);
    if (state.inside && report.flags & kFlagEntry) {
      ASSERT_LE(norm(state.u_W - axisOf(tick)), 1e-15);
      ASSERT_NEAR(state.slant, 1, 1e-4) << "P0 has come after the tip along a round skin";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Limbs, PointDevice, testing::ValuesIn(kPaths));

TEST(PointDeviceChain, theToolsOffsetAppliesInWAndItsRotationIsIgnored) {
  const SceneModel model = *compile(paperOneDof(), kAxisRate_hz);
  const Pose X_HT{{0.01, -0.02, -0.15}, normalized(Quat{0.3, 0.1, 0, 1})};
  HapticChain chain(model, pointDevice(), X_HT);
  ChainTick tick;
  // the tip goes 7 mm into the tissue while the handle stays 0.14 m above it
  for (int k = 0; k < 450; ++k) chain.tick(at({0, 0, 0.152 - 2e-5 * k}), true, 1, 1.0, tick);
  EXPECT_EQ(tick.X_WT.p, (Vec3{0, 0, 0.152 - 2e-5 * 449} + X_HT.p));
  EXPECT_LE(norm(axisOf(tick) - Vec3{0, 0, -1}), 1e-15);
  EXPECT_NEAR(tick.rendered_W.force_N.z, 1, 1e-9) << "the tip's force, at the handle";
  EXPECT_EQ(tick.rendered_W.torque_Nm, Vec3{});
  EXPECT_EQ(sampleOf(tick, 0, 0, 0).torque_W_Nm[0], 0);
}

TEST(PointDeviceChain, withoutTorqueTheLeverIsIgnoredAndTheRenderedForceRecorded) {
  const SceneModel model = *compile(paperOneDof(), kAxisRate_hz);
  DeviceInfo info;
  info.renders_torque = false;
  const Pose X_HT{{0.1, 0, 0}, {1, 0, 0, 0}};
  HapticChain chain(model, info, X_HT);
  ChainTick tick;
  for (int k = 0; k < 1000; ++k) chain.tick(at({-0.1, 0, 0.002 - 1e-5 * k}), true, 1, 1.0, tick);
  EXPECT_NEAR(tick.rendered_W.force_N.z, 1, 1e-9);
  EXPECT_EQ(tick.rendered_W.torque_Nm, Vec3{});
  // 1 N up at the handle, 0.1 m beside the tip: about the tip −(0.1, 0, 0) × (0, 0, 1)
  EXPECT_NEAR(sampleOf(tick, 0, 0, 0).torque_W_Nm[1], 0.1, 1e-9);
}

TEST(PointDeviceChain, aDeviceThatRendersNothingIsComputedWithTorqueForTheRecord) {
  const SceneModel model = *compile(paperOneDof(), kAxisRate_hz);
  DeviceInfo recording;
  recording.renders_force = recording.renders_torque = false;
  HapticChain chain(model, recording, {{0.1, 0, 0}, {1, 0, 0, 0}});
  ChainTick tick;
  for (int k = 0; k < 1000; ++k) chain.tick(at({-0.1, 0, 0.002 - 1e-5 * k}), true, 1, 1.0, tick);
  EXPECT_NEAR(tick.rendered_W.torque_Nm.y, -0.1, 1e-9);
}

TEST(PointDeviceChain, startingInsideGivesNoForceAndAFiniteAxis) {
  SceneSpec spec = paperOneDof();
  spec.limb = SphereLimb{{0, 0, 0}, 0.05};
  const SceneModel model = *compile(spec, kAxisRate_hz);
  HapticChain chain(model, pointDevice(), {});
  ChainTick tick;
  // at the very centre, where a sphere has no normal
  for (int k = 0; k < 300; ++k) {
    chain.tick(at({}), true, 1, 1.0, tick);
    ASSERT_TRUE(isFinite(tick.X_WT.q));
    ASSERT_NEAR(norm(axisOf(tick)), 1, 1e-12);
    ASSERT_EQ(norm(tick.rendered_W.force_N), 0);
  }
}

TEST(PointDeviceChain, aNonFiniteReadingIsRejectedAsUsual) {
  const SceneModel model = *compile(paperOneDof(), kAxisRate_hz);
  HapticChain chain(model, pointDevice(), {});
  ChainTick tick;
  for (int k = 0; k < 300; ++k) chain.tick(at({0, 0, 0.001 - 1e-5 * k}), true, 1, 1.0, tick);
  const ChainTick good = tick;
  chain.tick(at({0, std::numeric_limits<double>::quiet_NaN(), 0}), true, 1, 1.0, tick);
  EXPECT_TRUE(tick.gate_flags & kGateSampleRejected);
  EXPECT_EQ(tick.X_WT, good.X_WT);
  // An orientation that is not measured may have any value.
  DeviceReading reading = at({0, 0, 0.001 - 1e-5 * 300});
  reading.X_WH.q = {9, 9, 9, 9};
  chain.tick(reading, true, 1, 1.0, tick);
  EXPECT_EQ(tick.report.phase, Phase::kInserting);
}

// a spring of 500 N/m, pressed while the gate fades in, then released: without the control the handle gets
// more energy than it gave
double givenInTheFadeIn_J(bool with_control, bool no_orientation = false) {
  SceneSpec spec = paperOneDof();
  for (LayerSpec& layer : spec.layers) layer.cutting_force_N = 4;
  const SceneModel model = *compile(spec, kChainRate_hz);
  DeviceInfo device = no_orientation ? pointDevice() : DeviceInfo{"desktop", {}, true, true, true};
  HapticChain chain(model, device, no_orientation ? Pose{} : kTool);
  if (with_control) {
    PassivitySettings settings;
    settings.delay_ticks = 0;
    chain.controlPassivity(settings);
  }
  ChainTick tick;
  double given_J = 0, acting_N = 0, before_m = 0.0005;
  for (int k = 0; k < 300; ++k) {
    const double z_m = 0.0005 - 0.005 * std::sin(std::numbers::pi * k / 300);
    given_J += acting_N * (z_m - before_m);
    before_m = z_m;
    DeviceReading reading = at(z_m);
    // an orientation that is not measured may have any value, and so may a bad reading
    if (no_orientation) reading.X_WH.q = {kNaN, 9, 9, kNaN};
    chain.tick(reading, k % 50 != 49, 1, 1.0, tick);
    acting_N = tick.rendered_W.force_N.z;
  }
  EXPECT_TRUE(std::isfinite(given_J));
  EXPECT_EQ(chain.passivity() != nullptr, with_control);
  return given_J;
}

TEST(PassivityInTheChain, theFadeInReturnsNoMoreThanItTook) {
  EXPECT_GT(givenInTheFadeIn_J(false), 0.5e-3) << "control";
  EXPECT_LT(givenInTheFadeIn_J(true), 0.15e-3);
  EXPECT_LT(givenInTheFadeIn_J(true, true), 0.15e-3);
}

TEST(PassivityInTheChain, anOrdinaryInsertionIsTheSameToTheBit) {
  const SceneModel model = *compile(paperOneDof(), kChainRate_hz);
  HapticChain bare(model, DeviceLimits{}, kTool), controlled(model, DeviceLimits{}, kTool);
  controlled.controlPassivity({});
  ChainTick one, other;
  for (int k = 0; k < 2000; ++k) {
    const double z_m = 0.002 - 1e-5 * std::min(k, 2000 - k);
    bare.tick(at(z_m), true, 1, 1.0, one);
    controlled.tick(at(z_m), true, 1, 1.0, other);
    ASSERT_EQ(one.rendered_W, other.rendered_W) << k;
  }
}

// 4.8 N on bone of 600 N/m are 19 mJ: more than the tank's own 5
TEST(PassivityInTheChain, aPressOnBoneIsGivenBackToTheBit) {
  SceneSpec spec = paperOneDof();
  spec.layers[0].thickness_m = 0.012;
  spec.layers.push_back(spec.layers[0]);
  spec.layers.back().is_bone = true;
  spec.effects |= bitOf(Effect::kBone);
  spec.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = 600;
  const SceneModel model = *compile(spec, kChainRate_hz);
  HapticChain bare(model, DeviceLimits{}, {}), controlled(model, DeviceLimits{}, {});
  controlled.controlPassivity({});
  ChainTick one, other;
  double most_N = 0;
  for (int k = 0; k < 2400; ++k) {
    DeviceReading reading;
    reading.X_WH = {{0, 0, 0.004 - 2e-5 * std::min(k, 2400 - k)}, {1, 0, 0, 0}};
    bare.tick(reading, true, 1, 1.0, one);
    controlled.tick(reading, true, 1, 1.0, other);
    ASSERT_EQ(one.rendered_W, other.rendered_W) << k;
    most_N = std::max(most_N, one.rendered_W.force_N.z);
  }
  EXPECT_GT(most_N, 4.8);
}

}  // namespace
}  // namespace needlelab::test
