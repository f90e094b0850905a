// The gate with the conditions that the device reports: device faults, holds, external faults, and how they
// end.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "common/haptics/gate/force_gate.h"
#include "tests/support/random.h"

namespace needlelab::test {
namespace {

constexpr double kFall = 1.0 / 20, kRise = 1.0 / 200;  // shares per tick at 1 kHz

TipSample tipHeldAt(double z) {
  return {{0, 0, z}, {}};
}

// A gate and its inputs for each tick.
struct Bench {
  ForceGate gate{DeviceLimits{}, 1000};
  double z = 0, speed = 0, wanted_N = 0;
  bool fresh = true, outside = false;
  std::uint32_t condition = 0;
  std::int64_t elapsed = 1;
  bool admitted = false;

  double tick() {
    if (gate.fault() != Fault::kNone && fresh) gate.noteOutside(outside);
    admitted = gate.admit(tipHeldAt(z), fresh, speed, elapsed, condition);
    const double out = gate.guard({{wanted_N, 0, 0}, {}}).wrench().force_N.x;
    if (admitted) gate.noteOutside(outside);
    return out;
  }
  double run(int ticks) {
    double out = 0;
    for (int k = 0; k < ticks; ++k) out = tick();
    return out;
  }
  // The start-up is over and the gate renders 3 N.
  Bench& running() {
    wanted_N = 3;
    run(400);
    EXPECT_EQ(gate.fault(), Fault::kNone);
    return *this;
  }
};

const std::pair<std::uint32_t, Fault> kOwnFaults[] = {{kDeviceEmergencyStop, Fault::kEmergencyStop},
                                                      {kDeviceLost, Fault::kDeviceLost},
                                                      {kDeviceOverheated, Fault::kDeviceOverheated},
                                                      {kDeviceTrouble, Fault::kDeviceTrouble}};

TEST(ForceGateCondition, aDeviceFaultCountsAtOnceEvenWithoutASample) {
  for (const auto& [flag, fault] : kOwnFaults)
    for (const bool fresh : {true, false}) {
      Bench b;
      b.running();
      b.condition = flag;
      b.fresh = fresh;
      for (int k = 1; k <= 20; ++k) {
        ASSERT_NEAR(b.tick(), 3.0 * (1 - k * kFall), 1e-9) << "a straight line, from the first tick on";
        ASSERT_EQ(b.gate.fault(), fault);
        ASSERT_FALSE(b.admitted);
      }
      EXPECT_EQ(b.run(500), 0.0);
    }
}

TEST(ForceGateCondition, ticksMissedBeforeAnOutsideFaultDoNotShortenItsRamp) {
  Bench b;
  b.running();
  b.gate.raiseFromOutside(Fault::kProgramTrouble);
  b.elapsed = 10;
  EXPECT_NEAR(b.tick(), 3.0 * (1 - kFall), 1e-9) << "as for a fault that the gate itself finds";
  b.elapsed = 4;
  EXPECT_NEAR(b.tick(), 3.0 * (1 - 5 * kFall), 1e-9) << "what it misses in the ramp is";
}

TEST(ForceGateCondition, theContinuousLimitCountsTimeAcrossMissedTicks) {
  Bench b;
  b.wanted_N = 10;
  b.elapsed = 3;  // two of three ticks are missed; the device continues with its last force
  double energy = 0;
  std::vector<double> per_s(1, 0.0);
  for (int k = 0; k < 30'000; k += 3) {
    const double out = b.tick();
    energy += out * out * 3e-3;
    if ((k + 3) / 1000 != k / 1000) {
      per_s.push_back(energy);
      if (per_s.size() > 10) {
        EXPECT_LE(per_s.back() - per_s[per_s.size() - 11], 10 * 3.0 * 3.0 * 1.02) << k;
      }
    }
  }
  EXPECT_GT(energy, 0.5 * 30 * 3.0 * 3.0) << "and it is used, though the share stays while the force does";
}

TEST(ForceGateCondition, reportedOnlyConditionsRemoveNoForce) {
  Bench b;
  b.running();
  b.condition = kDeviceSaturated | kDeviceOverrun;
  for (int k = 0; k < 100; ++k) ASSERT_EQ(b.tick(), 3.0);
  EXPECT_EQ(b.gate.flags(), 0u);
}

TEST(ForceGateCondition, theEmergencyStopNamesTheFaultAndLaterOnesDoNot) {
  Bench b;
  b.running();
  b.condition = kDeviceFaultFlags;
  b.tick();
  EXPECT_EQ(b.gate.fault(), Fault::kEmergencyStop);
  Bench later;
  later.running();
  later.condition = kDeviceOverheated;
  later.tick();
  later.condition = kDeviceEmergencyStop;
  later.tick();
  EXPECT_EQ(later.gate.fault(), Fault::kDeviceOverheated);
  EXPECT_EQ(later.gate.faultsRaised(), 1u);
}

TEST(ForceGateCondition, anAcknowledgementBeforeTheFirstTickWithoutTheCauseDoesNotCount) {
  // without a tick between, found by a simulated run: the cause ended while the device was read, after the
  // acknowledgement
  for (const auto& [ticks, lasts] : {std::pair{1, false}, {50, false}, {50, true}}) {
    for (const auto& [flag, fault] : kOwnFaults) {
      Bench b;
      b.running();
      b.outside = true;
      b.condition = flag;
      b.run(ticks);
      b.gate.acknowledge();
      if (lasts) {
        b.tick();
        EXPECT_TRUE(b.gate.causeLasts());
      }
      EXPECT_FALSE(b.gate.acknowledged());
      b.condition = 0;
      EXPECT_EQ(b.run(500), 0.0) << "nothing starts by itself when the cause goes";
      EXPECT_EQ(b.gate.fault(), fault);
      EXPECT_FALSE(b.gate.causeLasts());
      // now it counts
      b.gate.acknowledge();
      for (int k = 1; k <= 200; ++k) ASSERT_NEAR(b.tick(), 3.0 * k * kRise, 1e-9);
      EXPECT_EQ(b.gate.fault(), Fault::kNone);
    }
  }
}

TEST(ForceGateCondition, acknowledgedInTheTissueItWaitsForTheNeedleToBeOutside) {
  Bench b;
  b.running();
  b.condition = kDeviceEmergencyStop;
  b.run(30);
  b.condition = 0;
  b.run(2);
  b.gate.acknowledge();
  EXPECT_EQ(b.run(1000), 0.0);
  EXPECT_TRUE(b.gate.acknowledged());
  b.outside = true;
  b.tick();
  EXPECT_EQ(b.gate.fault(), Fault::kNone);
  EXPECT_TRUE(b.admitted) << "the first tick of the new start is the one that is outside";
}

TEST(ForceGateCondition, theTipMustBeOutsideAgainAfterTheAcknowledgement) {
  Bench b;
  b.running();
  b.condition = kDeviceTrouble;
  b.run(30);
  b.condition = 0;
  b.outside = true;
  b.run(10);
  b.outside = false;
  b.run(10);
  b.gate.acknowledge();
  EXPECT_EQ(b.run(300), 0.0) << "the first sample after a fault is never inside the tissue";
  EXPECT_EQ(b.gate.fault(), Fault::kDeviceTrouble);
}

TEST(ForceGateCondition, anEmergencyStopInTheMiddleOfSilenceIsNamed) {
  Bench b;
  b.running();
  b.fresh = false;
  b.run(10);
  b.condition = kDeviceEmergencyStop;
  b.tick();
  EXPECT_EQ(b.gate.fault(), Fault::kEmergencyStop);
  // While the device is silent, the end of the condition alone does not end the FAULT.
  b.condition = 0;
  b.run(30);
  EXPECT_TRUE(b.gate.causeLasts()) << "the device is still silent";
  b.gate.acknowledge();
  b.tick();
  EXPECT_FALSE(b.gate.acknowledged());
}

TEST(ForceGateCondition, aFaultWithinTheStartRampGoesFromWhereItIs) {
  Bench b;
  b.wanted_N = 3;
  const double reached = b.run(60);
  ASSERT_NEAR(reached, 3 * 60 * kRise, 1e-9);
  b.condition = kDeviceLost;
  for (int k = 1; k <= 20; ++k) ASSERT_NEAR(b.tick(), reached * (1 - k * kFall), 1e-9);
  EXPECT_EQ(b.tick(), 0.0);
}

TEST(ForceGateCondition, aHoldRemovesAndRestoresForceByItself) {
  for (const std::uint32_t flag : {kDeviceReleased, kDevicePowerOff, kDeviceNotReady}) {
    Bench b;
    b.running();
    b.condition = flag;
    for (int k = 1; k <= 20; ++k) {
      ASSERT_NEAR(b.tick(), 3 * (1 - k * kFall), 1e-9);
      ASSERT_TRUE(b.admitted) << "the engine continues: the needle is where it is";
      ASSERT_EQ(b.gate.fault(), Fault::kNone);
    }
    for (int k = 0; k < 3000; ++k) ASSERT_EQ(b.tick(), 0.0);
    b.condition = 0;
    for (int k = 1; k <= 200; ++k) ASSERT_NEAR(b.tick(), 3 * k * kRise, 1e-9);
    EXPECT_EQ(b.tick(), 3.0);
    EXPECT_EQ(b.gate.flags() & kGateStartRamp, 0u);
    EXPECT_EQ(b.gate.faultsRaised(), 0u);
  }
}

// |out_k − out_{k−1}| ≤ 1/20 of the wanted force + the change of the wanted force, whatever the device
// reports
TEST(ForceGateCondition, noHoldHoweverItComesAndGoesMakesAForceStep) {
  Random random(4);
  for (int run = 0; run < 50; ++run) {
    Bench b;
    b.running();
    double before = b.tick(), wanted_before = b.wanted_N;
    int left = 0;
    for (int k = 0; k < 3000; ++k) {
      if (--left < 0) {
        left = static_cast<int>(random.below(run % 2 == 0 ? 3 : 300));
        b.condition = random.chance(0.5) ? std::uint32_t{kDeviceReleased} : 0;
      }
      b.wanted_N = std::clamp(wanted_before + random.in(-0.02, 0.02), 0.0, 2.9);
      const double now = b.tick();
      ASSERT_LE(std::abs(now - before),
                std::max(b.wanted_N, wanted_before) * kFall + std::abs(b.wanted_N - wanted_before) + 1e-9);
      ASSERT_LE(now, b.wanted_N + 1e-12);
      before = now;
      wanted_before = b.wanted_N;
    }
  }
}

TEST(ForceGateCondition, aHoldThatFlickersEachTickLeavesNextToNothing) {
  Bench b;
  b.running();
  for (int k = 0; k < 200; ++k) {
    b.condition = k % 2 == 0 ? std::uint32_t{kDeviceReleased} : 0;
    const double now = b.tick();
    if (k > 45) {
      ASSERT_LE(now, 3 * kRise + 1e-12);
    }
  }
}

TEST(ForceGateCondition, holdsAndFaultsOverlapWithoutEndingEachOther) {
  Bench b;
  b.running();
  b.condition = kDeviceTrouble | kDeviceReleased;
  b.run(30);
  EXPECT_EQ(b.gate.fault(), Fault::kDeviceTrouble);
  b.condition = kDeviceReleased;
  b.outside = true;
  EXPECT_EQ(b.run(100), 0.0);
  EXPECT_EQ(b.gate.fault(), Fault::kDeviceTrouble) << "no hold ends a fault";
  b.gate.acknowledge();
  EXPECT_EQ(b.run(100), 0.0) << "the fault is over, no one holds the handle";
  EXPECT_EQ(b.gate.fault(), Fault::kNone);
  b.condition = 0;
  EXPECT_NEAR(b.tick(), 3 * kRise, 1e-9);
}

TEST(ForceGateCondition, aFaultWithinAHoldsFallGoesOnFalling) {
  Bench b;
  b.running();
  b.condition = kDeviceReleased;
  const double reached = b.run(10);
  ASSERT_NEAR(reached, 1.5, 1e-9);
  b.condition = kDeviceReleased | kDeviceEmergencyStop;
  for (int k = 1; k <= 20; ++k) ASSERT_NEAR(b.tick(), reached * (1 - k * kFall), 1e-9);
}

TEST(ForceGateCondition, aDeviceThatIsNotReadyMayBeSilentOthersMayNot) {
  Bench b;
  b.running();
  b.condition = kDeviceNotReady;
  b.fresh = false;
  EXPECT_EQ(b.run(5000), 0.0);
  EXPECT_EQ(b.gate.fault(), Fault::kNone) << "it looks for its zero";
  b.condition = kDeviceReleased;
  b.run(30);
  EXPECT_EQ(b.gate.fault(), Fault::kDeviceSilent);
}

TEST(ForceGateCondition, theThermalBudgetHoldsOverHolds) {
  Bench b;
  b.running();
  b.wanted_N = 6;
  std::vector<double> squares;
  for (int k = 0; k < 40'000; ++k) {
    b.condition = k / 1500 % 2 == 0 ? 0 : std::uint32_t{kDeviceReleased};
    const double now = b.tick();
    squares.push_back(now * now);
  }
  double sum = 0, worst = 0;
  for (std::size_t k = 0; k < squares.size(); ++k) {
    sum += squares[k];
    if (k >= 10'000) sum -= squares[k - 10'000];
    worst = std::max(worst, std::sqrt(sum / 10'000));
  }
  EXPECT_LE(worst, 3.0 + 1e-6);
  EXPECT_GT(worst, 2.5) << "and time without force gives the budget back";
}

TEST(ForceGateCondition, anOutsideFaultLastsAsLongAsItIsRaised) {
  Bench b;
  b.running();
  b.outside = true;
  for (int k = 1; k <= 100; ++k) {
    b.gate.raiseFromOutside(Fault::kProgramTrouble);
    b.gate.acknowledge();
    ASSERT_NEAR(b.tick(), std::max(0.0, 3 * (1 - k * kFall)), 1e-9);
    ASSERT_EQ(b.gate.fault(), Fault::kProgramTrouble);
    ASSERT_FALSE(b.gate.acknowledged());
  }
  b.tick();
  b.gate.acknowledge();
  EXPECT_NEAR(b.tick(), 3 * kRise, 1e-9);
  EXPECT_EQ(b.gate.faultsRaised(), 1u);
}

TEST(ForceGateCondition, aTipThatGoesOnJumpingIsACauseThatLasts) {
  Bench b;
  b.running();
  b.outside = true;
  b.z = 0.5;
  b.run(6);
  ASSERT_EQ(b.gate.fault(), Fault::kTipTooFast);
  for (int k = 0; k < 200; ++k) {
    b.z = k % 2 == 0 ? 0.0 : 0.5;
    b.gate.acknowledge();
    b.tick();
  }
  EXPECT_EQ(b.gate.fault(), Fault::kTipTooFast);
  EXPECT_TRUE(b.gate.causeLasts());
  b.tick();
  b.gate.acknowledge();
  b.tick();
  EXPECT_EQ(b.gate.fault(), Fault::kNone);
}

TEST(ForceGateCondition, excessSpeedAtTheAcknowledgementRemainsOneFault) {
  Bench b;
  b.running();
  b.outside = true;
  b.speed = 2;
  b.run(50);
  b.gate.acknowledge();
  b.run(10);
  EXPECT_EQ(b.gate.fault(), Fault::kDeviceTooFast);
  EXPECT_EQ(b.gate.faultsRaised(), 1u);
}

TEST(ForceGateCondition, afterAStallOfTheLoopTheForceFadesInAgain) {
  Bench b;
  b.running();
  b.elapsed = 21;  // 20 missed: the watchdog's limit, no fault yet
  EXPECT_EQ(b.tick(), 3.0);
  b.elapsed = 22;
  EXPECT_NEAR(b.tick(), 3 * (1 - kFall), 1e-9) << "beyond it: silence, though the device reports as ever";
  EXPECT_EQ(b.gate.fault(), Fault::kNone);
  b.elapsed = 1;
  for (int k = 2; k <= 20; ++k) ASSERT_NEAR(b.tick(), 3 * (1 - k * kFall), 1e-9);
  for (int k = 1; k <= 200; ++k) ASSERT_NEAR(b.tick(), 3 * k * kRise, 1e-9);
  EXPECT_EQ(b.tick(), 3.0);
}

TEST(ForceGateCondition, missedTicksOfASilentDeviceCountAsSilence) {
  Bench b;
  b.running();
  b.fresh = false;
  b.elapsed = 21;
  b.tick();
  EXPECT_EQ(b.gate.fault(), Fault::kDeviceSilent) << "in the first tick after 20 missed ones";
}

TEST(ForceGateCondition, missedTicksDoNotMakeTheRampLater) {
  Bench b;
  b.running();
  b.condition = kDeviceLost;
  b.elapsed = 15;  // missed before the fault: does not count for the ramp
  EXPECT_NEAR(b.tick(), 3 * (1 - kFall), 1e-9);
  b.elapsed = 10;
  EXPECT_NEAR(b.tick(), 3 * (1 - 11 * kFall), 1e-9);
  b.elapsed = 9;
  EXPECT_EQ(b.tick(), 0.0);
}

TEST(ForceGateCondition, underFuzzForceStaysLimitedAndNeverReturnsByItself) {
  Random random(77);
  Bench b;
  b.running();
  double before = 3;
  int faults = 0, ends = 0;
  for (int k = 0; k < 300'000; ++k) {
    b.condition = random.chance(0.99) ? b.condition : 0;
    if (random.chance(0.003)) b.condition ^= 1u << (22 + random.below(9));
    b.fresh = random.chance(0.98);
    b.elapsed = random.chance(0.98) ? 1 : static_cast<std::int64_t>(random.below(60));
    b.outside = random.chance(0.5);
    b.wanted_N = std::clamp(b.wanted_N + random.in(-0.1, 0.1), 0.0, 12.0);
    const bool acknowledged = random.chance(0.02);
    if (acknowledged) b.gate.acknowledge();
    const Fault was = b.gate.fault();
    const bool stood = b.gate.acknowledged();
    const double now = b.tick();
    const Fault is = b.gate.fault();
    faults += was == Fault::kNone && is != Fault::kNone;
    if (was != Fault::kNone && is == Fault::kNone) {
      ++ends;
      ASSERT_TRUE(stood && b.outside && b.fresh && (b.condition & kDeviceFaultFlags) == 0);
      ASSERT_LE(now, 12 * kRise);
    }
    ASSERT_TRUE(std::isfinite(now));
    ASSERT_LE(std::abs(now), 10 + 1e-9);
    ASSERT_LE(now - before, 2 + 1e-9);
    if (b.elapsed <= 1) {  // the ramp falls faster only after missed ticks
      ASSERT_LE(before - now, 2 + 1e-9);
    }
    if (is != Fault::kNone) {
      ASSERT_LE(now, before);
    }
    before = now;
  }
  EXPECT_GT(faults, 50);
  EXPECT_GT(ends, 50);
}

}  // namespace
}  // namespace needlelab::test
