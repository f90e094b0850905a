// The gate between engine and device (FORCE_MODEL.md, "Gate").
#include "common/haptics/gate/force_gate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/support/random.h"

namespace needlelab::test {
namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInf = std::numeric_limits<double>::infinity();

TipSample tipAt(double z) {
  return {{0, 0, z}, {}};
}
Wrench force(double f_N, double t_Nm = 0) {
  return {{f_N, 0, 0}, {0, t_Nm, 0}};
}

// A gate after its start-up.
struct Running {
  ForceGate gate;
  double z = 0;
  explicit Running(double rate_hz = 1000, const DeviceLimits& limits = {}) : gate(limits, rate_hz) {
    for (int k = 0; k <= static_cast<int>(0.2 * rate_hz); ++k) tick({});
  }
  Wrench tick(const Wrench& wanted, bool fresh = true, double speed = 0) {
    gate.admit(tipAt(z), fresh, speed);
    return gate.guard(wanted).wrench();
  }
  double settle(double f_N) {
    double out = 0;
    for (int k = 0; k < 50; ++k) out = tick(force(f_N)).force_N.x;
    return out;
  }
};

// The change from `from` to `to`; `may_fall`: from the nearest fraction of `from`.
double change(Vec3 from, Vec3 to, bool may_fall) {
  const double square = dot(from, from);
  const double part = may_fall && square > 0 ? std::clamp(dot(from, to) / square, 0.0, 1.0) : 1;
  return norm(to - from * part);
}

TEST(ForceGate, aDefaultGuardedWrenchIsZero) {
  EXPECT_EQ(GuardedWrench().wrench(), Wrench{});
}

TEST(ForceGate, forceFadesInOverAFifthOfASecond) {
  for (const double rate_hz : {500.0, 1000.0, 4000.0}) {
    ForceGate gate(DeviceLimits{}, rate_hz);
    double before = 0;
    const int ticks = static_cast<int>(0.2 * rate_hz);
    for (int k = 1; k <= ticks; ++k) {
      ASSERT_TRUE(gate.admit(tipAt(0), true, 0));
      const double now = gate.guard(force(1.0)).wrench().force_N.x;
      ASSERT_NEAR(now, static_cast<double>(k) / ticks, 1e-9);
      ASSERT_TRUE(gate.flags() & kGateStartRamp);
      ASSERT_GE(now, before);
      before = now;
    }
    for (int k = 0; k < 2; ++k) {
      gate.admit(tipAt(0), true, 0);
      EXPECT_NEAR(gate.guard(force(1.0)).wrench().force_N.x, 1.0, 1e-12);
    }
    EXPECT_FALSE(gate.flags() & kGateStartRamp);
  }
}

TEST(ForceGate, whatIsWithinLimitsGoesThroughUntouched) {
  Running r;
  const Wrench wanted{{0.5, -0.4, 0.3}, {0.01, 0.02, -0.03}};
  r.tick(wanted);
  EXPECT_EQ(r.tick(wanted), wanted);
  EXPECT_EQ(r.gate.flags(), 0u);
  EXPECT_EQ(r.gate.fault(), Fault::kNone);
}

TEST(ForceGate, magnitudeIsLimitedKeepingItsDirection) {
  Running r;
  const Vec3 direction = normalized(Vec3{1, -2, 2}), about = normalized(Vec3{3, 1, 0});
  Wrench out;
  bool limited = false;
  for (int k = 0; k < 20; ++k) {
    out = r.tick({direction * 25, about * 3});
    limited = limited || (r.gate.flags() & kGatePeakLimited);
    ASSERT_LE(norm(out.force_N), 10 + 1e-12);
    ASSERT_LE(norm(out.torque_Nm), 0.8 + 1e-12);
  }
  EXPECT_TRUE(limited);
  EXPECT_NEAR(norm(normalized(out.force_N) - direction), 0, 1e-12);
  EXPECT_NEAR(norm(normalized(out.torque_Nm) - about), 0, 1e-12);
  EXPECT_NEAR(norm(out.force_N), norm(out.torque_Nm) * 25 / 3, 1e-9) << "one share, here the torque's";
  EXPECT_GT(norm(out.torque_Nm), 0.75) << "20 ms of peak torque are within the thermal budget";
}

TEST(ForceGate, slewIsTwoNewtonsAndATenthNewtonMetreAMillisecond) {
  for (const double rate_hz : {250.0, 1000.0, 5000.0}) {
    Running r(rate_hz);
    const double ms = 1000 / rate_hz;
    Wrench before = r.tick({});
    bool limited = false;
    for (int k = 0; k < 200; ++k) {
      const Wrench wanted = k / 20 % 2 ? force(9, 0.7) : force(-9, -0.7);
      const Wrench now = r.tick(wanted);
      limited = limited || (r.gate.flags() & kGateSlewLimited);
      ASSERT_LE(norm(now.force_N - before.force_N), 2 * ms + 1e-9);
      ASSERT_LE(norm(now.torque_Nm - before.torque_Nm), 0.1 * ms + 1e-9);
      before = now;
    }
    EXPECT_TRUE(limited);
  }
}

TEST(ForceGate, tenSecondRmsNeverExceedsTheContinuousLimit) {
  for (const int pattern : {0, 1, 2, 3}) {
    Running r;
    std::vector<double> squares, torque_squares;
    Random random(8);
    double level = 10;
    for (int k = 0; k < 40'000; ++k) {
      if (pattern == 1) level = k / 3000 % 2 ? 0.0 : 10.0;  // 3 s on, 3 s off
      if (pattern == 2 && k % 500 == 0) level = random.in(0, 10);
      if (pattern == 3) level = k < 9000 ? 2.9 : 10.0;  // almost the whole budget, then the peak
      const Wrench out = r.tick(force(level, 0.08 * level));
      squares.push_back(normSquared(out.force_N));
      torque_squares.push_back(normSquared(out.torque_Nm));
    }
    double sum = 0, torque_sum = 0, worst = 0, torque_worst = 0;
    for (std::size_t k = 0; k < squares.size(); ++k) {
      sum += squares[k];
      torque_sum += torque_squares[k];
      if (k >= 10'000) {
        sum -= squares[k - 10'000];
        torque_sum -= torque_squares[k - 10'000];
      }
      worst = std::max(worst, std::sqrt(sum / 10'000));
      torque_worst = std::max(torque_worst, std::sqrt(torque_sum / 10'000));
    }
    EXPECT_LE(worst, 3.0 + 1e-6) << "pattern " << pattern;
    EXPECT_LE(torque_worst, 0.2 + 1e-6) << "pattern " << pattern;
    EXPECT_GT(worst, 2.0) << "and the budget is put to use";
  }
}

TEST(ForceGate, theThermalLimitAppliesSmoothlyIsFlaggedAndEnds) {
  Running r;
  double before = r.settle(6), least = 1;
  bool said = false;
  for (int k = 0; k < 15'000; ++k) {
    const double now = r.tick(force(6)).force_N.x;
    ASSERT_LE(std::abs(now - before), 0.02) << "no step when it sets in or goes";
    before = now;
    if (now < 6 - 1e-9) {
      said = said || (r.gate.flags() & kGateThermalLimited);
      ASSERT_TRUE(r.gate.flags() & kGateThermalLimited);
      ASSERT_LT(r.gate.limitShare(), 1.0);
      least = std::min(least, r.gate.limitShare());
    }
  }
  EXPECT_TRUE(said);
  EXPECT_GT(least, 1.4 / 6) << "it is let down to what can be held, not to nothing";
  for (int k = 0; k < 11'000; ++k) r.tick({});
  EXPECT_NEAR(r.settle(6), 6.0, 1e-9) << "after 10 s of rest all of it is there again";
}

TEST(ForceGate, theContinuousLimitCanBeHeldForGood) {
  for (const double rate_hz : {333.0, 1000.0}) {
    Running r(rate_hz);
    r.settle(2.94);
    for (int k = 0; k < static_cast<int>(40 * rate_hz); ++k) {
      ASSERT_NEAR(r.tick(force(2.94, 0.196)).force_N.x, 2.94, 1e-12) << "second " << k / rate_hz;
      ASSERT_FALSE(r.gate.flags() & kGateThermalLimited);
    }
    double least = 3;
    for (int k = 0; k < static_cast<int>(40 * rate_hz); ++k)
      least = std::min(least, r.tick(force(3)).force_N.x);
    EXPECT_GT(least, 2.8);
  }
}

// The heat of every 10 s, summed tick by tick, stays within that of the continuous magnitude.
TEST(ForceGate, theHeatOfEveryTenSecondsStaysWithinTheBudget) {
  for (const double peak : {10.0, 100.0}) {
    constexpr double kHeldForGood = 3, kBudgetRate_hz = 500;
    constexpr std::size_t kTenSeconds = 5000;
    ThermalBudget budget(peak, kHeldForGood, 1 / kBudgetRate_hz);
    Random random(9);
    std::vector<double> heat;
    double sum = 0, worst = 0;
    while (heat.size() < 100'000) {
      const double wanted = random.chance(0.5) ? 0 : peak;
      for (std::uint64_t left = 25 + random.below(random.chance(0.5) ? 200 : 4900); left > 0; --left) {
        const double given = std::min(wanted, budget.allowed(wanted));
        budget.spend(given);
        heat.push_back(given * given / kBudgetRate_hz);
        sum += heat.back() - (heat.size() > kTenSeconds ? heat[heat.size() - 1 - kTenSeconds] : 0);
        worst = std::max(worst, sum);
      }
    }
    EXPECT_LE(worst, kHeldForGood * kHeldForGood * 10 * (1 + 1e-9)) << peak;
    EXPECT_GT(worst, kHeldForGood * kHeldForGood * 10 * 0.8) << peak;
  }
}

TEST(ForceGate, aRejectedSampleHoldsTheForceAndAGoodOneResumes) {
  const std::vector<TipSample> bad = {
      {{kNaN, 0, 0}, {}}, {{0, kInf, 0}, {}}, {{0, 0, 0}, {0, 0, 0, kNaN}}, tipAt(1.0)};
  for (const auto& sample : bad) {
    Running r;
    ASSERT_NEAR(r.settle(2), 2, 1e-12);
    for (int k = 0; k < 5; ++k) {
      ASSERT_FALSE(r.gate.admit(sample, true, 0)) << "the tick must not be stepped";
      ASSERT_EQ(r.gate.guard(force(9)).wrench().force_N.x, 2.0) << "held; the wanted force is ignored";
      ASSERT_TRUE(r.gate.flags() & kGateSampleRejected);
      ASSERT_EQ(r.gate.fault(), Fault::kNone);
    }
    ASSERT_TRUE(r.gate.admit(tipAt(0), true, 0));
    EXPECT_NEAR(r.gate.guard(force(2.5)).wrench().force_N.x, 2.5, 1e-12);
    EXPECT_EQ(r.gate.fault(), Fault::kNone);
  }
}

TEST(ForceGate, theSixthRejectedSampleIsAFaultAndRemovesTheForce) {
  for (const double rate_hz : {250.0, 1000.0, 3000.0}) {
    Running r(rate_hz);
    r.settle(4);
    for (int k = 0; k < 5; ++k) {
      r.gate.admit({{kNaN, 0, 0}, {}}, true, 0);
      (void)r.gate.guard({});
    }
    ASSERT_EQ(r.gate.fault(), Fault::kNone);
    r.gate.admit({{kNaN, 0, 0}, {}}, true, 0);
    ASSERT_EQ(r.gate.fault(), Fault::kSampleNotFinite);
    double before = 4;
    const int ticks = static_cast<int>(0.02 * rate_hz);
    for (int k = 0; k < ticks; ++k) {
      const double now = r.gate.guard(force(9)).wrench().force_N.x;
      ASSERT_LT(now, before) << "it ramps down";
      ASSERT_NEAR(before - now, 4.0 / ticks, 1e-9) << "evenly";
      ASSERT_TRUE(r.gate.flags() & kGateFaulted);
      before = now;
      r.gate.admit(tipAt(0), true, 0);
    }
    EXPECT_EQ(before, 0.0);
  }
}

TEST(ForceGate, aFaultEndsOnlyOutsideAndAcknowledged) {
  const auto faulted = [] {
    Running r;
    r.settle(3);
    r.tick(force(3), true, 2.0);
    EXPECT_EQ(r.gate.fault(), Fault::kDeviceTooFast);
    for (int k = 0; k < 100; ++k) r.tick(force(3));
    return r;
  };
  Running neither = faulted();
  EXPECT_EQ(neither.settle(3), 0.0);

  Running only_outside = faulted();
  only_outside.gate.noteOutside(true);
  EXPECT_EQ(only_outside.settle(3), 0.0);

  Running only_seen = faulted();
  only_seen.gate.noteOutside(false);
  only_seen.gate.acknowledge();
  EXPECT_EQ(only_seen.settle(3), 0.0);
  EXPECT_EQ(only_seen.gate.fault(), Fault::kDeviceTooFast);

  // Once also outside it restarts, and the force fades in as at start-up.
  only_seen.gate.noteOutside(true);
  ASSERT_TRUE(only_seen.gate.admit(tipAt(0), true, 0));
  EXPECT_EQ(only_seen.gate.fault(), Fault::kNone);
  double out = 0;
  for (int k = 1; k <= 200; ++k) {
    out = only_seen.gate.guard(force(3)).wrench().force_N.x;
    ASSERT_NEAR(out, 3.0 * k / 200, 1e-9);
    only_seen.gate.admit(tipAt(0), true, 0);
  }
}

// also if no sample before the fault was good
TEST(ForceGate, aTipThatJumpsKeepsAFaultUntilItRests) {
  ForceGate gate({}, 1000);
  for (int k = 0; k < 300 && gate.fault() == Fault::kNone; ++k) {
    gate.admit({{kNaN, 0, 0}, {}}, true, 0);
    (void)gate.guard({});
  }
  ASSERT_EQ(gate.fault(), Fault::kSampleNotFinite);
  const auto tick = [&](double z) {
    gate.acknowledge();
    gate.noteOutside(true);
    gate.admit(tipAt(z), true, 0);
    (void)gate.guard({});
  };
  for (int k = 0; k < 100; ++k) tick(k % 2 == 0 ? 0.0 : 0.5);
  EXPECT_EQ(gate.fault(), Fault::kSampleNotFinite);
  for (int k = 0; k < 100; ++k) tick(0.5);
  EXPECT_EQ(gate.fault(), Fault::kNone);
}

TEST(ForceGate, anAcknowledgementFromBeforeTheFaultDoesNotCount) {
  Running r;
  r.gate.acknowledge();
  r.tick(force(1), true, 2.0);
  ASSERT_EQ(r.gate.fault(), Fault::kDeviceTooFast);
  for (int k = 0; k < 100; ++k) {
    r.gate.noteOutside(true);
    r.tick(force(1));
  }
  EXPECT_EQ(r.gate.fault(), Fault::kDeviceTooFast);
}

TEST(ForceGate, tipSpeedIsTheDistanceOverAllElapsedTicks) {
  Running r;
  r.z = 0.0049;  // 4.9 m/s
  EXPECT_TRUE(r.gate.admit(tipAt(r.z), true, 0));
  EXPECT_FALSE(r.gate.admit(tipAt(r.z + 0.0051), true, 0)) << "5.1 m/s";
  // one rejected tick later the same place is 2.55 m/s since the last good sample
  EXPECT_TRUE(r.gate.admit(tipAt(r.z + 0.0051), true, 0));
  // after three missed ticks: 4 periods for 19 mm
  EXPECT_TRUE(r.gate.admit(tipAt(r.z + 0.0051 + 0.019), true, 0, 4));
  EXPECT_FALSE(r.gate.admit(tipAt(r.z + 0.0051 + 0.019 + 0.021), true, 0, 4));
}

TEST(ForceGate, teleportFaults) {
  Running r;
  r.settle(2);
  for (int k = 0; k < 6; ++k) r.gate.admit(tipAt(0.5), true, 0);
  EXPECT_EQ(r.gate.fault(), Fault::kTipTooFast);
}

TEST(ForceGate, aDeviceAboveItsThresholdFaultsAtOnce) {
  for (const double speed : {1.61, 100.0, kInf, kNaN}) {
    Running r;
    r.settle(2);
    EXPECT_TRUE(r.gate.admit(tipAt(0), true, 1.59));
    (void)r.gate.guard(force(2));
    EXPECT_FALSE(r.gate.admit(tipAt(0), true, speed)) << speed;
    EXPECT_EQ(r.gate.fault(), Fault::kDeviceTooFast);
  }
}

TEST(ForceGate, aDeviceSilentForMoreThan20msIsAFault) {
  for (const double rate_hz : {500.0, 1000.0, 3000.0}) {
    Running r(rate_hz);
    r.settle(2);
    int ticks = 0;
    while (r.gate.fault() == Fault::kNone && ticks < 1000) {
      ASSERT_FALSE(r.gate.admit(tipAt(0), false, 0));
      (void)r.gate.guard(force(2));
      ++ticks;
    }
    EXPECT_EQ(r.gate.fault(), Fault::kDeviceSilent);
    EXPECT_EQ(ticks, 0.02 * rate_hz + 1) << rate_hz;
  }
}

TEST(ForceGate, lateUpdatesNowAndThenAreNoFault) {
  Running r;
  r.settle(2);
  for (int k = 0; k < 2000; ++k) {
    const double out = r.tick(force(2), k % 4 != 0).force_N.x;
    ASSERT_EQ(out, 2.0);
  }
  EXPECT_EQ(r.gate.fault(), Fault::kNone);
}

TEST(ForceGate, aForceThatIsNotANumberNeverReachesTheDevice) {
  for (const double bad : {kNaN, kInf, -kInf}) {
    Running r;
    ASSERT_NEAR(r.settle(2), 2, 1e-12);
    const Wrench out = r.tick({{0, bad, 0}, {}});
    EXPECT_TRUE(isFinite(out.force_N));
    EXPECT_LT(norm(out.force_N), 2.0);
    EXPECT_EQ(r.gate.fault(), Fault::kForceNotFinite);
    Running t;
    EXPECT_TRUE(isFinite(t.tick({{}, {bad, 0, 0}}).torque_Nm));
    EXPECT_EQ(t.gate.fault(), Fault::kForceNotFinite);
  }
}

TEST(ForceGate, aQuaternionThatIsNoRotationIsRejected) {
  for (const Quat q : {Quat{0, 0, 0, 0}, Quat{0, 0, 0, 1.01}, Quat{1, 1, 1, 1}}) {
    Running r;
    EXPECT_FALSE(r.gate.admit({{0, 0, 0}, q}, true, 0));
    EXPECT_TRUE(r.gate.flags() & kGateSampleRejected);
  }
}

TEST(ForceGate, missedTicksCountTowardsAFaultsRamp) {
  // found by simulated runs: a hold that began, or a stall that ended, during the ramp delayed it
  for (const std::uint32_t condition : {0u, static_cast<std::uint32_t>(kDeviceNotReady)}) {
    Running r;
    r.settle(2);
    r.gate.admit(tipAt(0), true, 0, 1, kDeviceLost);
    EXPECT_NEAR(r.gate.guard({}).wrench().force_N.x, 2 * 0.95, 1e-9);
    r.gate.admit(tipAt(0), true, 0, 5, condition);
    EXPECT_NEAR(r.gate.guard({}).wrench().force_N.x, 2 * 0.70, 1e-9) << condition;
    r.gate.admit(tipAt(0), true, 0, 30, 0);
    EXPECT_EQ(r.gate.guard({}).wrench().force_N.x, 0) << condition;
  }
}

TEST(ForceGate, missedTicksCountTowardsAHoldsRampAfterAStall) {
  // found by simulated runs: the stall restarted the ramp and delayed it by 20 more ticks
  for (const std::uint32_t condition : {0u, static_cast<std::uint32_t>(kDeviceReleased)}) {
    Running r;
    r.settle(2);
    r.gate.admit(tipAt(0), true, 0, 1, kDeviceReleased);
    EXPECT_NEAR(r.gate.guard(force(2)).wrench().force_N.x, 2 * 0.95, 1e-9);
    r.gate.admit(tipAt(0), true, 0, 100, condition);
    EXPECT_EQ(r.gate.guard(force(2)).wrench().force_N.x, 0) << condition;
  }
  // a stall before the hold does not count for it; one in the ramp after a stall does
  Running r;
  r.settle(2);
  r.gate.admit(tipAt(0), true, 0, 100, kDeviceReleased);
  EXPECT_NEAR(r.gate.guard(force(2)).wrench().force_N.x, 2 * 0.95, 1e-9);
  Running again;
  again.settle(2);
  again.gate.admit(tipAt(0), true, 0, 100, 0);
  EXPECT_NEAR(again.gate.guard(force(2)).wrench().force_N.x, 2 * 0.95, 1e-9);
  again.gate.admit(tipAt(0), true, 0, 100, 0);
  EXPECT_EQ(again.gate.guard(force(2)).wrench().force_N.x, 0);
}

TEST(ForceGate, missedTicksMayFallFasterThanTheSlewLimit) {
  // found by simulated runs: 2 N per tick delayed a ramp with missed ticks beyond its 20 ms
  const std::uint32_t fault = kDeviceLost, hold = kDeviceReleased, stall = 0;
  for (const std::uint32_t condition : {fault, hold, stall}) {
    Running r;
    for (int k = 0; k < 50; ++k) r.tick(force(6, 0.6));
    const auto next = [&](std::int64_t elapsed) {
      r.gate.admit(tipAt(0), true, 0, elapsed, condition);
      return r.gate.guard(force(6, 0.6)).wrench();
    };
    const auto expectShare = [&](const Wrench& wrench, double share) {
      EXPECT_NEAR(wrench.force_N.x, 6 * share, 1e-9) << condition;
      EXPECT_NEAR(wrench.torque_Nm.y, 0.6 * share, 1e-9) << condition;
    };
    expectShare(next(condition == stall ? 30 : 1), 0.95);
    expectShare(next(10), 0.45);
    expectShare(next(50), 0);
  }
}

TEST(ForceGate, missedTicksGiveAForceThatTurnsRoundNoGreaterStep) {
  for (const std::uint32_t condition : {static_cast<std::uint32_t>(kDeviceReleased), 0u}) {
    Running r;
    r.settle(6);
    r.gate.admit(tipAt(0), true, 0, 1, kDeviceReleased);
    EXPECT_NEAR(r.gate.guard(force(6)).wrench().force_N.x, 6 * 0.95, 1e-9);
    // during the hold the share falls to 0.45, and then 2 N of the change remain; afterwards the share rises
    r.gate.admit(tipAt(0), true, 0, 10, condition);
    EXPECT_NEAR(r.gate.guard(force(-6)).wrench().force_N.x, 6 * (condition != 0 ? 0.45 : 0.95) - 2, 1e-9);
    EXPECT_TRUE(r.gate.flags() & kGateSlewLimited);
  }
}

TEST(ForceGate, everyFaultHasItsOwnWords) {
  std::vector<std::string> seen;
  for (int i = 0; i <= 11; ++i) {
    const std::string text = faultText(static_cast<Fault>(i));
    EXPECT_FALSE(text.empty());
    for (const auto& other : seen) EXPECT_NE(text, other);
    seen.push_back(text);
  }
}

TEST(ForceGate, underFuzzNothingIsEverOverALimit) {
  Random random(2026);
  for (const double rate_hz : {300.0, 1000.0, 4000.0}) {
    ForceGate gate(DeviceLimits{}, rate_hz);
    const double ms = 1000 / rate_hz;
    const auto hostile = [&](double usual) {
      static constexpr std::array<double, 8> kOdd = {0, 1e308, -1e308, 1e-308, 1e9, -1, 1, 5};
      if (random.chance(0.02)) return random.chance(0.5) ? kNaN : kInf;
      if (random.chance(0.02)) return kOdd[random.below(kOdd.size())];
      return random.in(-usual, usual);
    };
    Wrench before;
    int faults = 0, restarts = 0, admitted = 0;
    bool in_fault = false;
    for (int k = 0; k < 100'000; ++k) {
      const TipSample sample{
          {hostile(1e-3), hostile(1e-3), hostile(1e-3)},
          random.chance(0.99) ? Quat{} : Quat{hostile(1), hostile(1), hostile(1), hostile(1)}};
      const auto elapsed = static_cast<std::int64_t>(random.chance(0.9) ? 1 : random.below(50));
      const bool good =
          gate.admit(sample, random.chance(0.9), random.chance(0.999) ? 0.1 : hostile(3), elapsed);
      admitted += good;
      const double size = random.chance(0.9) ? 3 : 100;
      const Wrench wanted = random.chance(0.999)
                                ? Wrench{{random.in(-size, size), 1, 2}, {0, random.in(-1, 1), 0}}
                                : Wrench{{hostile(5), 0, 0}, {hostile(1), 0, 0}};
      const Wrench out = gate.guard(wanted).wrench();
      ASSERT_TRUE(isFinite(out.force_N) && isFinite(out.torque_Nm));
      ASSERT_LE(norm(out.force_N), 10 + 1e-9);
      ASSERT_LE(norm(out.torque_Nm), 0.8 + 1e-9);
      // after missed ticks a ramp may have dropped any part of the force at once
      const bool may_fall = elapsed > 1;
      ASSERT_LE(change(before.force_N, out.force_N, may_fall), 2 * ms + 1e-9);
      ASSERT_LE(change(before.torque_Nm, out.torque_Nm, may_fall), 0.1 * ms + 1e-9);
      before = out;
      const bool now = gate.fault() != Fault::kNone;
      faults += now && !in_fault;
      restarts += !now && in_fault;
      in_fault = now;
      gate.noteOutside(random.chance(0.3));
      if (random.chance(0.1)) gate.acknowledge();
    }
    EXPECT_GT(faults, 20);
    EXPECT_GT(restarts, 20);
    EXPECT_GT(admitted, 10'000);
  }
}

}  // namespace
}  // namespace needlelab::test
