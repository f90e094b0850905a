// The observer's arithmetic, and its input gestures.
#include "client/sim/stability/gestures/passivity_observer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "client/sim/stability/gestures/passivity_gesture.h"
#include "tests/stability/search/shrink.h"

namespace needlelab::test {
namespace {

constexpr double kStiffness_N_per_m = 100;

// a tip on the z axis with a force along it
TipSample tipAt(double z_m) {
  return {{0, 0, z_m}, {}};
}
StepReport forceOf(double force_N, std::uint32_t flags = 0) {
  StepReport report;
  report.wrench_W.force_N = {0, 0, force_N};
  report.flags = flags;
  return report;
}

TEST(Observer, aSpringReturnsTheEnergyItStored) {
  PassivityObserver observer(kStiffness_N_per_m);
  const auto pressed = [&](double z) { observer.add(tipAt(z), forceOf(-kStiffness_N_per_m * z), 1); };
  for (int k = 0; k <= 50; ++k) pressed(1e-3 * k);
  EXPECT_NEAR(observer.record().net_J, -0.5 * kStiffness_N_per_m * 0.05 * 0.05, 1e-12);
  for (int k = 49; k >= 0; --k) pressed(1e-3 * k);
  EXPECT_NEAR(observer.record().net_J, 0, 1e-12);
  EXPECT_NEAR(observer.record().worst_step_N, 0, 1e-12);
  EXPECT_DOUBLE_EQ(observer.record().max_force_N, 5);
}

TEST(Observer, whatCuttingTookDoesNotPayForALaterInsertion) {
  PassivityObserver observer(kStiffness_N_per_m);
  // an insertion that takes 1 N over 10 mm, then one that gives 0.1 N over 1 mm
  observer.add(tipAt(0), forceOf(0), 1);
  observer.add(tipAt(0), forceOf(-1, kFlagEntry), 1);
  observer.add(tipAt(0.01), forceOf(-1), 1);
  observer.add(tipAt(0.01), forceOf(0, kFlagExit), 1);
  observer.add(tipAt(0.01), forceOf(0.1, kFlagEntry), 1);
  observer.add(tipAt(0.011), forceOf(0.1), 1);
  observer.add(tipAt(0.011), forceOf(0, kFlagExit), 1);
  EXPECT_NEAR(observer.record().net_J, -0.01 + 1e-4, 1e-9);
  EXPECT_NEAR(observer.record().worst_running_J, 1e-4, 1e-9);
  EXPECT_EQ(observer.record().insertions, 2u);
}

TEST(Observer, countsTorqueTimesTurn) {
  PassivityObserver observer(kStiffness_N_per_m);
  StepReport report;
  report.wrench_W.torque_Nm = {0.1, 0, 0};
  const int ticks = 1000;
  for (int k = 0; k <= ticks; ++k) {
    const double half = 0.5 * 0.7 * k / ticks;  // turns by 0.7 rad about x
    observer.add({{0, 0, 0}, {std::sin(half), 0, 0, std::cos(half)}}, report, 1);
  }
  EXPECT_NEAR(observer.record().net_J, 0.07, 1e-6);
}

TEST(Observer, aStepIsWhatNoSpringExplains) {
  const auto step = [](double way_m, double change_N, double slant, double clamping_N_per_m) {
    PassivityObserver observer(kStiffness_N_per_m);
    observer.add(tipAt(0), forceOf(0), slant);
    StepReport report = forceOf(change_N);
    report.clamping_stiffness_N_per_m = clamping_N_per_m;
    observer.add(tipAt(way_m), report, slant);
    return observer.record().worst_step_N;
  };
  EXPECT_NEAR(step(0, 0.3, 1, 0), 0.3, 1e-12);
  EXPECT_NEAR(step(1e-3, 0.3, 1, 0), 0.2, 1e-12);
  EXPECT_NEAR(step(1e-3, 0.3, 1, 50), 0.1, 1e-12);
  EXPECT_NEAR(step(1e-3, 0.3, 0.5, 0), 0.1, 1e-12);
}

TEST(Observer, aForceThatIsNoNumberIsFound) {
  PassivityObserver observer(kStiffness_N_per_m);
  observer.add(tipAt(0), forceOf(0), 1);
  observer.add(tipAt(0), forceOf(std::nan("")), 1);
  EXPECT_FALSE(observer.record().finite);
}

TEST(RandomGesture, sameSeedSameGestureOtherSeedAnother) {
  const auto same = [](const PassivityGesture& a, const PassivityGesture& b) {
    return a.profile.SerializeAsString() == b.profile.SerializeAsString() &&
           a.strokes.size() == b.strokes.size();
  };
  const PassivityGesture a = randomGesture(5);
  EXPECT_TRUE(same(a, randomGesture(5)));
  EXPECT_FALSE(same(a, randomGesture(6)));
}

TEST(RandomGesture, startsAndEndsOutsideAndIsNoFasterThanAHand) {
  std::set<StrokeKind> kinds;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const PassivityGesture gesture = randomGesture(seed);
    EXPECT_LT(gesture.start.depth_m, 0);
    EXPECT_LT(gesture.strokes.back().depth_m, 0);
    for (const PassivityStroke& stroke : gesture.strokes) kinds.insert(stroke.kind);
    PassivityGesture still = gesture;
    still.tremor_m = still.encoder_step_m = 0;
    const auto samples = samplesOf(still);
    for (std::size_t k = 1; k < samples.size(); ++k)
      ASSERT_LE(norm(samples[k].p_WT_m - samples[k - 1].p_WT_m), 0.1501e-3) << seed << " " << k;
  }
  EXPECT_EQ(kinds.size(), kStrokeNames.size() - 1);  // all except `start`
}

TEST(RoundNumber, givesTheDecimalThatAPersonWouldWrite) {
  EXPECT_EQ(roundedTo(0.0123456, 3), 0.0123);
  EXPECT_EQ(roundedTo(-187.4, 1), -200);
  EXPECT_EQ(roundedTo(0, 3), 0);
  EXPECT_EQ(significantDigits(0), 0);
  EXPECT_EQ(significantDigits(300), 1);
  EXPECT_EQ(significantDigits(-0.125), 3);
}

}  // namespace
}  // namespace needlelab::test
