// The gate scales force and torque by one share, and no cycle of a hand gains energy from it (FORCE_MODEL.md,
// "Gate").
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "common/haptics/gate/force_gate.h"
#include "common/haptics/geometry.h"
#include "tests/support/random.h"

namespace needlelab::test {
namespace {

constexpr double kHuge = 1e6;
constexpr double kMostGain_J = 1e-4;

Vec3 anyVector(Random& random, double most) {
  return {random.in(-most, most), random.in(-most, most), random.in(-most, most)};
}
Wrench anyWrench(Random& random, double max_N, double max_Nm) {
  return {anyVector(random, max_N), anyVector(random, max_Nm)};
}
Wrench plus(const Wrench& a, const Wrench& b, double share_of_b) {
  return {a.force_N + b.force_N * share_of_b, a.torque_Nm + b.torque_Nm * share_of_b};
}
double product(const Wrench& a, const Wrench& b) {
  return dot(a.force_N, b.force_N) + dot(a.torque_Nm, b.torque_Nm);
}
// the distance of `is` from any multiple of `wanted`, in six dimensions; `share` is the nearest multiple
double offTheLine(const Wrench& is, const Wrench& wanted, double& share) {
  share = product(is, wanted) / product(wanted, wanted);
  const Wrench rest = plus(is, wanted, -share);
  return std::sqrt(product(rest, rest));
}

struct StartedGate {
  ForceGate gate;
  explicit StartedGate(const DeviceLimits& limits = {}) : gate(limits, 1000) {
    for (int k = 0; k <= 200; ++k) tick({});
  }
  Wrench tick(const Wrench& wanted) {
    gate.admit({}, true, 0);
    return gate.guard(wanted).wrench();
  }
  Wrench run(const Wrench& wanted, int ticks) {
    Wrench out;
    for (int k = 0; k < ticks; ++k) out = tick(wanted);
    return out;
  }
};

TEST(ForceGateWrench, thePeakLimitKeepsTheDirectionOfForceAndTorqueTogether) {
  Random random(1);
  DeviceLimits limits;
  limits.continuous_force_N = limits.continuous_torque_Nm = kHuge;
  int by_force = 0, by_torque = 0;
  for (int i = 0; i < 300; ++i) {
    StartedGate r(limits);
    const Wrench wanted = anyWrench(random, 20, 2);
    const double of_force = limits.peak_force_N / norm(wanted.force_N),
                 of_torque = limits.peak_torque_Nm / norm(wanted.torque_Nm);
    const Wrench out = r.run(wanted, 30);
    double share = 0;
    ASSERT_NEAR(offTheLine(out, wanted, share), 0, 1e-12);
    ASSERT_NEAR(share, std::min({1.0, of_force, of_torque}), 1e-12);
    ASSERT_NEAR(r.gate.limitShare(), share, 1e-12);
    ASSERT_EQ((r.gate.flags() & kGatePeakLimited) != 0, share < 1 - 1e-12);
    by_force += of_force < std::min(1.0, of_torque);
    by_torque += of_torque < std::min(1.0, of_force);
  }
  EXPECT_GT(by_force, 30);
  EXPECT_GT(by_torque, 30);
}

TEST(ForceGateWrench, theThermalBudgetKeepsTheDirectionOfForceAndTorqueTogether) {
  Random random(2);
  int limited = 0;
  for (int i = 0; i < 40; ++i) {
    StartedGate r;
    const Wrench wanted = anyWrench(random, 5, 0.4);
    double share = 0, before = 1;
    r.run(wanted, 30);
    for (int k = 0; k < 4000; ++k) {
      ASSERT_NEAR(offTheLine(r.tick(wanted), wanted, share), 0, 1e-12);
      ASSERT_LE(share, before + 1e-12) << "it only falls while the wrench stays";
      before = share;
    }
    limited += (r.gate.flags() & kGateThermalLimited) != 0;
    ASSERT_EQ((r.gate.flags() & kGateThermalLimited) != 0, share < 1 - 1e-12);
  }
  EXPECT_GT(limited, 20);
}

TEST(ForceGateWrench, slewTakesForceAndTorqueTheSameFractionOfTheWay) {
  Random random(3);
  int limited = 0;
  for (int i = 0; i < 300; ++i) {
    StartedGate r;
    const Wrench from = anyWrench(random, 4, 0.3), to = anyWrench(random, 4, 0.3);
    Wrench before = r.run(from, 20);
    ASSERT_EQ(before, from);
    for (int k = 0; k < 20; ++k) {
      const Wrench now = r.tick(to), way = plus(to, before, -1), step = plus(now, before, -1);
      if ((r.gate.flags() & kGateSlewLimited) == 0) {
        ASSERT_EQ(now, to);
        break;
      }
      ++limited;
      double fraction = 0;
      ASSERT_NEAR(offTheLine(step, way, fraction), 0, 1e-12);
      ASSERT_NEAR(std::max(norm(step.force_N) / 2, norm(step.torque_Nm) / 0.1), 1, 1e-9)
          << "no slower than the limits ask for";
      before = now;
    }
    EXPECT_EQ(r.tick(to), to);
  }
  EXPECT_GT(limited, 300);
}

TEST(ForceGateWrench, theShareFallsAtOnceAndRisesOnlyNearZeroWrench) {
  DeviceLimits limits;
  limits.continuous_force_N = limits.continuous_torque_Nm = kHuge;
  StartedGate r(limits);
  const auto tip = [](double f_N, double lever_m) { return Wrench{{f_N, 0, 0}, {0, f_N * lever_m, 0}}; };
  r.run(tip(7.9, 0.1), 30);
  EXPECT_EQ(r.gate.limitShare(), 1.0);
  Wrench out = r.tick(tip(9, 0.1));
  EXPECT_NEAR(out.torque_Nm.y, 0.8, 1e-12) << "in the same tick";
  EXPECT_NEAR(out.force_N.x, 8, 1e-12);

  // in contact it stays, however long it takes
  out = r.run(tip(3, 0.1), 30'000);
  EXPECT_NEAR(out.force_N.x, 3 * 8.0 / 9, 1e-12);
  EXPECT_TRUE(r.gate.flags() & kGatePeakLimited) << "and is said";
  r.run(tip(0.021, 0), 3000);
  r.run(tip(0.019, 0.11), 3000);
  EXPECT_NEAR(r.gate.limitShare(), 8.0 / 9, 1e-12) << "force or torque is above what is next to nothing";
  r.run(tip(0.019, 0.1), 10);
  EXPECT_NEAR(r.gate.limitShare(), 8.0 / 9 + 0.05, 1e-12) << "5 a second";
  r.run({}, 20);
  EXPECT_EQ(r.gate.limitShare(), 1.0);
  EXPECT_EQ(r.gate.flags(), 0u);
  EXPECT_EQ(r.run(tip(3, 0.1), 10), tip(3, 0.1));
}

TEST(ForceGateWrench, aDeviceWithoutTorqueKeepsItsForce) {
  DeviceLimits limits;
  limits.peak_torque_Nm = limits.continuous_torque_Nm = 0;
  StartedGate r(limits);
  EXPECT_EQ(r.run({{2, 0, 0}, {0, 0.3, 0}}, 10), (Wrench{{2, 0, 0}, {}}));
  EXPECT_EQ(r.gate.limitShare(), 1.0);
}

// ---- hands that lean on a spring ----

using Limiter = std::function<Wrench(const Wrench&)>;

Limiter gateOf(const DeviceLimits& limits) {
  return [r = StartedGate(limits)](const Wrench& wanted) mutable { return r.tick(wanted); };
}

// Control: like an earlier gate, force and torque each with their own share.
Limiter separateShares() {
  const DeviceLimits limits;
  struct Part {
    double peak;
    ThermalBudget budget;
    Vec3 limited(Vec3 v) {
      const double wanted = std::min(norm(v), peak), size = std::min(wanted, budget.allowed(wanted));
      budget.spend(size);
      return wanted > 0 ? v * (size / norm(v)) : v;
    }
  };
  Part force{limits.peak_force_N, {limits.peak_force_N, limits.continuous_force_N, 1e-3}};
  Part torque{limits.peak_torque_Nm, {limits.peak_torque_Nm, limits.continuous_torque_Nm, 1e-3}};
  return [force, torque](const Wrench& wanted) mutable {
    return Wrench{force.limited(wanted.force_N), torque.limited(wanted.torque_Nm)};
  };
}

// A hand at the handle of a straight tool along z, in the x-z plane. The tip hangs on springs across the tool
// (x) and along it (z); no force at rest.
class LeaningHand {
 public:
  struct Place {
    double x_m = 0, z_m = 0, turn_rad = 0;
  };
  double lever_m = 0.13, across_N_per_m = 216, along_N_per_m = 0;

  explicit LeaningHand(Limiter limiter) : limiter_(std::move(limiter)) {}

  // moves straight within this time; 1 kHz
  void moveTo(const Place& to, double seconds) {
    const Place from = at_;
    const int ticks = std::max(1, static_cast<int>(seconds * 1000));
    for (int k = 1; k <= ticks; ++k) {
      const double part = static_cast<double>(k) / ticks;
      tick({from.x_m + (to.x_m - from.x_m) * part, from.z_m + (to.z_m - from.z_m) * part,
            from.turn_rad + (to.turn_rad - from.turn_rad) * part});
    }
  }
  void hold(double seconds) { moveTo(at_, seconds); }

  // turn the tool to 3 N aside, wait, carry the handle after the tip, set the tool upright (a cycle that was
  // found)
  void turnWaitCarry(double aside_N, double hold_s) {
    const double aside_m = aside_N / across_N_per_m, turn = std::asin(aside_m / lever_m);
    moveTo({0, 0, -turn}, 0.3);
    hold(hold_s);
    moveTo({-aside_m, 0, -turn}, 0.3);
    for (int k = 1; k <= 300; ++k) {
      const double left = -turn * (1 - k / 300.0);
      tick({lever_m * std::sin(left), 0, left});
    }
  }
  // any cycle that ends at rest; at most 8 N across, 5 N along
  void anyCycle(Random& random, int places) {
    for (int i = 0; i < places; ++i) {
      const double max_m = std::min(0.03, 8 / across_N_per_m), turn = random.in(-0.5, 0.5);
      const double along_m = along_N_per_m > 0 ? std::min(0.02, 5 / along_N_per_m) : 0;
      moveTo({random.in(-max_m, max_m) + lever_m * std::sin(turn), random.in(-1, 1) * along_m, turn},
             random.in(0.3, 0.8));
      hold(random.chance(0.5) ? random.in(0.5, 6) : 0.1);
    }
    moveTo({}, random.in(0.3, 0.8));
    hold(random.chance(0.5) ? 0.05 : random.in(0, 3));
  }
  /// The hand's energy gain since the last call.
  double gain_J() { return std::exchange(work_J_, 0.0); }

 private:
  void tick(const Place& to) {
    const Vec3 handle{to.x_m, 0, to.z_m + lever_m};
    const Vec3 tip = handle - Vec3{std::sin(to.turn_rad), 0, std::cos(to.turn_rad)} * lever_m;
    const Wrench at_tip{{-across_N_per_m * tip.x, 0, -along_N_per_m * tip.z}, {}};
    const Wrench now = limiter_(wrenchAtHandle(at_tip, tip, handle));
    const Wrench mean = plus({now.force_N * 0.5, now.torque_Nm * 0.5}, before_, 0.5);
    work_J_ += dot(mean.force_N, Vec3{to.x_m - at_.x_m, 0, to.z_m - at_.z_m}) +
               mean.torque_Nm.y * (to.turn_rad - at_.turn_rad);
    before_ = now;
    at_ = to;
  }
  Limiter limiter_;
  Place at_;
  Wrench before_;
  double work_J_ = 0;
};

// the largest gain of a cycle that was found, over levers, stiffnesses, forces and times
double mostGainOfFoundCycle_J(const std::function<Limiter()>& limiter) {
  double max_J = -1;
  for (const double lever_m : {0.05, 0.13, 0.2})
    for (const double k_N_per_m : {216.0, 800.0})
      for (const double aside_N : {2.0, 3.0, 5.0})
        for (const double hold_s : {0.5, 2.0, 4.0}) {
          LeaningHand hand(limiter());
          hand.lever_m = lever_m;
          hand.across_N_per_m = k_N_per_m;
          for (int cycle = 0; cycle < 3; ++cycle) {
            hand.turnWaitCarry(aside_N, hold_s);
            max_J = std::max(max_J, hand.gain_J());
          }
        }
  return max_J;
}

double mostGainOfAnyCycle_J(const std::function<Limiter()>& limiter, int hands) {
  Random random(28);
  double max_J = -1;
  for (int i = 0; i < hands; ++i) {
    LeaningHand hand(limiter());
    hand.lever_m = random.chance(0.2) ? 0 : random.in(0, 0.2);
    hand.across_N_per_m = random.in(15, 1000);
    hand.along_N_per_m = random.chance(0.5) ? 0 : random.in(15, 1000);
    for (int cycle = 0; cycle < 3; ++cycle) {
      hand.anyCycle(random, 1 + static_cast<int>(random.below(3)));
      max_J = std::max(max_J, hand.gain_J());
    }
  }
  return max_J;
}

TEST(ForceGateWrench, noCycleOfALeaningHandGainsATenthOfAMillijoule) {
  const auto gate = [] { return gateOf({}); };
  EXPECT_LE(mostGainOfFoundCycle_J(gate), kMostGain_J);
  EXPECT_LE(mostGainOfAnyCycle_J(gate, 40), kMostGain_J);
  LeaningHand patient(gate());
  for (int cycle = 0; cycle < 3; ++cycle) {
    patient.turnWaitCarry(3, 30);
    EXPECT_LE(patient.gain_J(), kMostGain_J);
  }
}

TEST(ForceGateWrench, controlSeparateSharesPayTheHand) {
  EXPECT_GT(mostGainOfFoundCycle_J(separateShares), 1e-3);
  EXPECT_GT(mostGainOfAnyCycle_J(separateShares, 40), 1e-3);
}

TEST(ForceGateWrench, controlWithoutALimitTheHandsWorkIsThatOfSprings) {
  const auto none = [] { return Limiter([](const Wrench& wanted) { return wanted; }); };
  EXPECT_LE(mostGainOfFoundCycle_J(none), 1e-5);
  EXPECT_LE(mostGainOfAnyCycle_J(none, 40), 1e-5);
}

TEST(ForceGateWrench, aShareRisingAtASoftSpringGivesLittleEnergy) {
  LeaningHand hand(gateOf({}));
  hand.lever_m = 0;
  hand.across_N_per_m = 400;
  hand.moveTo({0.02, 0, 0}, 0.3);
  hand.hold(20);
  hand.moveTo({}, 0.01);  // 8 N, and no time to rise
  EXPECT_LT(hand.gain_J(), -0.01) << "this hand pays";
  hand.across_N_per_m = 2;
  hand.moveTo({0.00999, 0, 0}, 0.02);  // 0.02 N
  hand.hold(1);
  hand.moveTo({}, 0.02);
  const double gain_J = hand.gain_J();
  EXPECT_GT(gain_J, 0.3 * kMostGain_J) << "it is the worst there is";
  EXPECT_LE(gain_J, kMostGain_J);
}

}  // namespace
}  // namespace needlelab::test
