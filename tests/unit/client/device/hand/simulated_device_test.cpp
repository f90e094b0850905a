#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "client/device/hand/simulated_device.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

constexpr double kRate = 1000;

// exact encoders and a hand without damper or tremor, so that a formula predicts the exact result
SimulatedDeviceOptions plainOptions() {
  SimulatedDeviceOptions o;
  o.hand.tremor_m = 0;
  o.hand.damping_Ns_per_m = 0;
  o.hand.rotational_damping_Nms_per_rad = 0;
  o.encoder_step_m = 0;
  o.encoder_step_rad = 0;
  return o;
}

// a hand whose target is `to` almost from the first step
HandPlan jumpTo(const Pose& to, double seconds) {
  return HandPlan(Pose{}).moveIn(to, 1e-9, Motion::kLinear).hold(seconds);
}

// step response of m x'' + b x' + k x = k (ζ < 1), from rest
double stepResponse(double m, double b, double k, double t) {
  const double w0 = std::sqrt(k / m), zeta = b / (2 * std::sqrt(k * m)), wd = w0 * std::sqrt(1 - zeta * zeta);
  return 1 - std::exp(-zeta * w0 * t) * (std::cos(wd * t) + zeta * w0 / wd * std::sin(wd * t));
}

double worstStepError(double integration_hz) {
  SimulatedDeviceOptions o = plainOptions();
  o.integration_hz = integration_hz;
  SimulatedDevice device(o, jumpTo({{0.01, 0, 0}, {}}, 1));
  EXPECT_TRUE(device.open(kRate).ok());
  DeviceReading r;
  double worst = 0;
  for (int k = 0; device.read(r) == DeviceRead::kFresh; ++k) {
    const double expected = 0.01 * stepResponse(0.35, 1.7, 300, k / kRate);
    worst = std::max(worst, std::abs(r.X_WH.p.x - expected));
  }
  return worst;
}

TEST(SimulatedDevice, swingsAsAMassOnASpringWithADamper) {
  const double at_20k = worstStepError(20'000), at_40k = worstStepError(40'000);
  EXPECT_LT(at_20k, 0.01 * 3e-3);
  EXPECT_NEAR(at_40k / at_20k, 0.5, 0.1);  // a first-order method
}

// a first reading of 0 would look like an injection in the next tick
TEST(SimulatedDevice, thePlungerIsWhereThePlanBeginsFromTheFirstReadingOn) {
  HandPlan plan;
  plan.plungerAtStart(0.8).hold(0.1, 0.8);
  SimulatedDevice device(plainOptions(), plan);
  ASSERT_TRUE(device.open(kRate).ok());
  DeviceReading r;
  while (device.read(r) == DeviceRead::kFresh) EXPECT_EQ(r.plunger, 0.8);
}

TEST(SimulatedDevice, turnsAsABallOnASpringWithADamper) {
  SimulatedDeviceOptions o = plainOptions();
  const double angle = 0.1;
  SimulatedDevice device(o, jumpTo({{}, {0, std::sin(angle / 2), 0, std::cos(angle / 2)}}, 0.5));
  ASSERT_TRUE(device.open(kRate).ok());
  DeviceReading r;
  for (int k = 0; device.read(r) == DeviceRead::kFresh; ++k) {
    const double expected = angle * stepResponse(1e-3, 0.01, 2, k / kRate);
    ASSERT_NEAR(2 * std::asin(r.X_WH.q.y), expected, 0.01 * angle) << k;
    ASSERT_NEAR(dot(r.X_WH.q, r.X_WH.q), 1, 1e-14);
    ASSERT_EQ(r.X_WH.q.x, 0);
  }
}

TEST(SimulatedDevice, yieldsToAConstantWrenchAsItsSpringsSay) {
  SimulatedDeviceOptions o = plainOptions();
  o.hand.damping_Ns_per_m = 3;
  o.hand.rotational_damping_Nms_per_rad = 0.05;
  SimulatedDevice device(o, HandPlan(Pose{}).hold(3));
  ASSERT_TRUE(device.open(kRate).ok());
  ForceGate gate(device.info().limits, kRate);
  DeviceReading r;
  while (device.read(r) == DeviceRead::kFresh) {
    ASSERT_TRUE(gate.admit({r.X_WH.p, r.X_WH.q}, true, r.speed_mps));
    device.write(gate.guard({{0.6, -0.3, 0.9}, {0, 0, 0.05}}));
  }
  EXPECT_NEAR(r.X_WH.p.x, 0.6 / 300, 1e-7);
  EXPECT_NEAR(r.X_WH.p.y, -0.3 / 300, 1e-7);
  EXPECT_NEAR(r.X_WH.p.z, 0.9 / 300, 1e-7);
  // the spring's torque is k·2 sin(θ/2)
  EXPECT_NEAR(r.X_WH.q.z, 0.05 / 2 / 2, 1e-6);
  EXPECT_NEAR(r.speed_mps, 0, 1e-6);
}

// the error under a constant force decays as e^(−rate·t): slow compared with the spring, so nothing else
// matters
TEST(SimulatedDevice, aCorrectingHandMakesUpForAConstantForce) {
  SimulatedDeviceOptions o = plainOptions();
  o.hand.damping_Ns_per_m = 6;
  o.hand.correction_per_s = 0.8;
  SimulatedDevice device(o, HandPlan(Pose{}).hold(6));
  ASSERT_TRUE(device.open(kRate).ok());
  ForceGate gate(device.info().limits, kRate);
  DeviceReading r;
  double at_1s = 0, at_3s = 0;
  for (int k = 0; device.read(r) == DeviceRead::kFresh; ++k) {
    ASSERT_TRUE(gate.admit({r.X_WH.p, r.X_WH.q}, true, r.speed_mps));
    device.write(gate.guard({{0, 0, 0.9}, {}}));
    if (k == 1000) at_1s = r.X_WH.p.z;
    if (k == 3000) at_3s = r.X_WH.p.z;
  }
  EXPECT_LT(at_1s, 0.9 / 300);
  EXPECT_NEAR(at_3s / at_1s, std::exp(-0.8 * 2), 0.01);
  EXPECT_NEAR(r.X_WH.p.z / at_3s, std::exp(-0.8 * 3), 0.01);
}

TEST(SimulatedDevice, aWrenchActsAfterTheDelayAndHolds) {
  for (const std::uint32_t delay : {0u, 1u, 3u, SimulatedDevice::kMaxDelayTicks}) {
    SimulatedDeviceOptions o = plainOptions();
    o.delay_ticks = delay;
    SimulatedDevice device(o, HandPlan(Pose{}).hold(1));
    ASSERT_TRUE(device.open(kRate).ok());
    ForceGate gate(device.info().limits, kRate);
    GuardedWrench push;
    for (int i = 0; i < 300; ++i) {
      ASSERT_TRUE(gate.admit({}, true, 0));
      push = gate.guard({{1, 0, 0}, {}});
    }
    ASSERT_EQ(push.wrench().force_N.x, 1);
    DeviceReading r;
    // written in tick 2 only; the intervals from tick 2 + delay on have the force
    double v_before = 0;
    for (std::uint32_t k = 0; k < 2 + delay + 6; ++k) {
      ASSERT_EQ(device.read(r), DeviceRead::kFresh);
      if (k == 2) device.write(push);
      if (k <= 2 + delay)
        ASSERT_EQ(r.X_WH.p.x, 0) << "delay " << delay << " tick " << k;
      else
        ASSERT_GT(r.speed_mps, v_before) << "delay " << delay << " tick " << k;
      v_before = r.speed_mps;
    }
    // 1 N for 5 ms on 0.35 kg; the hand's spring has almost no effect yet
    EXPECT_NEAR(r.speed_mps, 5e-3 / 0.35, 5e-3 / 0.35 * 0.02);
  }
}

// 1 N behind a first-order lag on a mass: v = F/m·(t − τ(1 − e^(−t/τ)))
TEST(SimulatedDevice, aLagBringsTheForceInByAnExponential) {
  for (const double lag_s : {1e-3, 8e-3}) {
    SimulatedDeviceOptions o = plainOptions();
    o.lag_s = lag_s;
    o.delay_ticks = 0;
    o.hand.stiffness_N_per_m = o.hand.damping_Ns_per_m = o.limits.damping_Ns_per_m = 0;
    SimulatedDevice device(o, HandPlan(Pose{}).hold(1));
    ASSERT_TRUE(device.open(kRate).ok());
    ForceGate gate(device.info().limits, kRate);
    GuardedWrench push;
    for (int i = 0; i < 300; ++i) {
      ASSERT_TRUE(gate.admit({}, true, 0));
      push = gate.guard({{1, 0, 0}, {}});
    }
    DeviceReading r;
    for (int k = 0; k <= 10; ++k) {
      ASSERT_EQ(device.read(r), DeviceRead::kFresh);
      device.write(push);
    }
    const double t = 0.01, v = (t - lag_s * (1 - std::exp(-t / lag_s))) / 0.35;
    EXPECT_NEAR(r.speed_mps, v, 0.02 * v) << lag_s;
    EXPECT_NEAR(device.forceWork_J(), 0.5 * 0.35 * v * v, 0.05 * 0.5 * 0.35 * v * v) << "kinetic energy";
  }
}

TEST(SimulatedDevice, inThePlayTheForceReachesNoHandleAndTheEncodersLead) {
  SimulatedDeviceOptions o = plainOptions();
  o.backlash_m = 0.4e-3;
  SimulatedDevice device(o, HandPlan(Pose{}).hold(5));
  ASSERT_TRUE(device.open(kRate).ok());
  ForceGate gate(device.info().limits, kRate);
  DeviceReading r;
  double turned_s = 0;
  for (int k = 0; k < 4000; ++k) {
    ASSERT_EQ(device.read(r), DeviceRead::kFresh);
    const double ahead_m = r.X_WH.p.x - device.handle().X_WH.p.x;
    if (k == 1999) EXPECT_NEAR(ahead_m, 0.2e-3, 1e-12);
    if (k >= 2000 && turned_s == 0 && ahead_m < -0.2e-3 + 1e-12) turned_s = 1e-3 * (k - 2000);
    ASSERT_TRUE(gate.admit({}, true, 0));
    device.write(gate.guard({{k < 2000 ? 0.03 : -0.03, 0, 0}, {}}));
  }
  // 0.03 N moves motors that damp 1.7 N·s/m at 18 mm/s
  EXPECT_NEAR(turned_s, 0.4e-3 / (0.03 / 1.7), 0.008);
  EXPECT_NEAR(device.handle().X_WH.p.x, -0.03 / 300, 1e-6) << "then all of it holds the hand's spring";
}

TEST(SimulatedDevice, aChangedGripHoldsByItsShareFromItsTimeOn) {
  SimulatedDeviceOptions o = plainOptions();
  o.hand.grip_changes_s = 1.5;
  o.hand.grip_share = 0.25;
  SimulatedDevice device(o, HandPlan(Pose{}).hold(4));
  ASSERT_TRUE(device.open(kRate).ok());
  ForceGate gate(device.info().limits, kRate);
  DeviceReading r;
  for (int k = 0; device.read(r) == DeviceRead::kFresh; ++k) {
    if (k == 1499) EXPECT_NEAR(r.X_WH.p.x, 0.6 / 300, 10e-6);
    ASSERT_TRUE(gate.admit({}, true, 0));
    device.write(gate.guard({{0.6, 0, 0}, {}}));
  }
  EXPECT_NEAR(r.X_WH.p.x, 0.6 / 75, 10e-6);
}

TEST(SimulatedDevice, encodersRoundToTheNearestStep) {
  SimulatedDeviceOptions o;
  o.encoder_step_m = 30e-6;
  o.encoder_step_rad = 1e-3;
  const HandPlan plan =
      HandPlan({{0.1, -0.2, 0.05}, {}})
          .moveIn({{0.12, -0.25, 0.0}, orientationAlong({0.2, 0.1, 1})}, 1, Motion::kMinJerk);
  SimulatedDevice device(o, plan);
  ASSERT_TRUE(device.open(kRate).ok());
  DeviceReading r;
  int moved = 0;
  for (Vec3 before{}; device.read(r) == DeviceRead::kFresh; before = r.X_WH.p) {
    const Pose& truth = device.handle().X_WH;
    for (const auto& [seen, exact] : {std::pair{r.X_WH.p.x, truth.p.x}, std::pair{r.X_WH.p.y, truth.p.y},
                                      std::pair{r.X_WH.p.z, truth.p.z}}) {
      ASSERT_LE(std::abs(seen - exact), 15e-6 * (1 + 1e-9));
      ASSERT_NEAR(std::remainder(seen, 30e-6), 0, 1e-15);
    }
    const Quat d = r.X_WH.q * conjugate(truth.q);
    ASSERT_LE(2 * norm(Vec3{d.x, d.y, d.z}), 1.1e-3);
    ASSERT_NEAR(dot(r.X_WH.q, r.X_WH.q), 1, 1e-14);
    moved += before != r.X_WH.p;
  }
  EXPECT_GT(moved, 500);
}

TEST(SimulatedDevice, dryFrictionHoldsAgainstALesserForce) {
  for (const double pull_N : {0.09, 0.15}) {
    SimulatedDeviceOptions o = plainOptions();
    o.dry_friction_N = 0.1;
    SimulatedDevice device(o, jumpTo({{pull_N / 300, 0, 0}, {}}, 1));
    ASSERT_TRUE(device.open(kRate).ok());
    DeviceReading r;
    while (device.read(r) == DeviceRead::kFresh) {
    }
    if (pull_N < 0.1) {
      EXPECT_EQ(r.X_WH.p.x, 0);
    } else {
      // It moves, and sticks where the spring is weaker than the friction.
      EXPECT_GE(r.X_WH.p.x, (pull_N - 0.1) / 300 * 0.99);
      EXPECT_LE(std::abs(r.X_WH.p.x - pull_N / 300), 0.1 / 300);
      EXPECT_EQ(r.speed_mps, 0);
    }
  }
}

TEST(SimulatedDevice, aMissedTickIsTimeThatPasses) {
  SimulatedDeviceOptions o;
  const HandPlan plan = HandPlan(Pose{}).moveIn({{0, 0, -0.05}, {}}, 0.4, Motion::kMinJerk).hold(0.1);
  SimulatedDevice every(o, plan), some(o, plan);
  ASSERT_TRUE(every.open(kRate).ok());
  ASSERT_TRUE(some.open(kRate).ok());
  DeviceReading a, b;
  for (int k = 0; every.read(a) == DeviceRead::kFresh; ++k) {
    if (k % 7 != 0) continue;
    if (k > 0) {
      ASSERT_EQ(some.skip(6), 6u);
    }
    ASSERT_EQ(some.read(b), DeviceRead::kFresh);
    ASSERT_EQ(a.X_WH, b.X_WH) << k;
  }
  EXPECT_LT(some.skip(1'000'000'000), 7u) << "the plan is over";
  EXPECT_EQ(some.read(b), DeviceRead::kFinished);
}

TEST(SimulatedDevice, endsWithItsPlanAndOpensAgain) {
  SimulatedDevice device(plainOptions(), HandPlan(Pose{}).hold(0.1));
  DeviceReading r;
  EXPECT_EQ(device.read(r), DeviceRead::kNoUpdate);  // not open
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(device.open(kRate).ok());
    int ticks = 0;
    while (device.read(r) == DeviceRead::kFresh) ++ticks;
    EXPECT_NEAR(ticks, 101, 1);
    EXPECT_EQ(device.read(r), DeviceRead::kFinished);
    device.close();
    device.close();
  }
}

TEST(SimulatedDevice, sameSeedSameBitsOtherSeedOthers) {
  const auto run = [](std::uint64_t seed) {
    SimulatedDeviceOptions o;
    o.hand.seed = seed;
    o.X_HT = {{0, 0, 0.15}, {}};
    SimulatedDevice device(o, insertionPlan({0, 0, 0}, {0.1, 0, -1}, 0.02, {}));
    EXPECT_TRUE(device.open(kRate).ok());
    DeviceReading r;
    std::uint64_t hash = 14695981039346656037u;
    while (device.read(r) == DeviceRead::kFresh)
      for (const double v : {device.handle().X_WH.p.x, device.handle().X_WH.p.y, device.handle().X_WH.p.z,
                             r.X_WH.q.x, r.X_WH.q.y, r.X_WH.q.z, r.X_WH.q.w, r.speed_mps}) {
        std::uint64_t bits = 0;
        std::memcpy(&bits, &v, sizeof bits);
        hash = (hash ^ bits) * 1099511628211u;
      }
    return hash;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
  EXPECT_EQ(run(1), 878675270668644973u) << "the bits of the simulated device have changed";
}

TEST(SimulatedDevice, openNamesTheBadOption) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto message = [](auto change, double rate = kRate) {
    SimulatedDeviceOptions o;
    change(o);
    SimulatedDevice device(o, HandPlan(Pose{}).hold(1));
    const Status status = device.open(rate);
    return status.ok() ? std::string("accepted") : status.error().message;
  };
  EXPECT_THAT(message([](auto& o) { o.hand.stiffness_N_per_m = -1; }),
              HasSubstr("hand stiffness in N/m: -1"));
  EXPECT_THAT(message([&](auto& o) { o.hand.tremor_m = nan; }), HasSubstr("hand tremor in m: nan"));
  EXPECT_THAT(message([](auto& o) { o.limits.apparent_mass_kg = 0; }), HasSubstr("mass in kg: 0"));
  EXPECT_THAT(message([](auto& o) { o.delay_ticks = 16; }),
              HasSubstr("delay in ticks: 16 is out of range [0, 15]"));
  EXPECT_THAT(message([](auto& o) { o.encoder_step_m = 1; }), HasSubstr("encoder step in m: 1"));
  EXPECT_THAT(message([](auto&) {}, 10), HasSubstr("rate in Hz: 10"));
  EXPECT_EQ(message([](auto&) {}), "accepted");
}

}  // namespace
}  // namespace needlelab
