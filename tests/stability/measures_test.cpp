// The measures of a run, compared with hand-calculated numbers.
#include "client/sim/stability/loop/measures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace needlelab {
namespace {

constexpr double kRate = 1000;

std::vector<double> sine(double hz, double amplitude, double seconds) {
  std::vector<double> signal;
  for (int i = 0; i < static_cast<int>(seconds * kRate); ++i)
    signal.push_back(amplitude * std::sin(2 * std::numbers::pi * hz * i / kRate));
  return signal;
}

// |H| of a Butterworth high-pass after the bilinear transform with its corner prewarped
double highPassGain(double hz, double corner_hz, int order) {
  const double ratio =
      std::tan(std::numbers::pi * corner_hz / kRate) / std::tan(std::numbers::pi * hz / kRate);
  return 1 / std::sqrt(1 + std::pow(ratio, 2 * order));
}

TEST(BandPassed, hasTheGainOfAButterworthHighPass) {
  for (const int order : {2, 4, 6, 8})
    for (const double hz : {10.0, 30.0, 50.0, 80.0, 200.0, 400.0}) {
      const auto passed = bandPassed(sine(hz, 1, 4), kRate, {50, 500, order});
      // the first second is the filter's transient
      const double rms = rmsOf(std::span(passed).subspan(1000));
      EXPECT_NEAR(rms * std::numbers::sqrt2, highPassGain(hz, 50, order), 2e-3)
          << hz << " Hz, order " << order;
    }
}

TEST(BandPassed, aConstantForceGivesZero) {
  const std::vector<double> still(500, 3.7);
  for (const double value : bandPassed(still, kRate, {})) EXPECT_EQ(value, 0);
}

TEST(BandPassed, removesWhatIsAboveTheBand) {
  const auto passed = bandPassed(sine(400, 1, 2), kRate, {50, 200, 4});
  EXPECT_LT(rmsOf(std::span(passed).subspan(1000)), 0.02);
}

PlantRun runOf(const std::vector<double>& force_N, const std::vector<double>& x_m) {
  PlantRun run{kRate, 500, {}, Fault::kNone};
  for (std::size_t i = 0; i < force_N.size(); ++i) {
    PlantTick tick;
    tick.time_s = static_cast<double>(i) / kRate;
    tick.stepped = true;
    tick.seen.p_WT_m = {0, 0, -x_m[i]};
    tick.report.wrench_W.force_N = {0, 0, force_N[i]};
    run.ticks.push_back(tick);
  }
  return run;
}

TEST(UnexplainedStep, isWhatTheSpringsDoNotExplain) {
  // 0.1 mm against 500 N/m explains 0.05 N of the step of 0.2 N
  PlantRun run = runOf({0, 0.05, 0.25}, {0, 1e-4, 2e-4});
  EXPECT_NEAR(maxUnexplainedStep_N(run), 0.15, 1e-12);
  // the fixture's stiffness explains more of it, in two ways: across, and by its push
  run.ticks[2].report.clamping_stiffness_N_per_m = 400;
  EXPECT_NEAR(maxUnexplainedStep_N(run), 0.07, 1e-12);
  // and so does a slanted path
  EXPECT_NEAR(unexplainedStep_N(run.ticks[1].seen.p_WT_m, run.ticks[1].report, run.ticks[2].seen.p_WT_m,
                                run.ticks[2].report, 500, 0.8),
              0.0375, 1e-12);
  // the hole follows by more than the way: 2 · 400 N/m · 0.15 mm; not where the insertion begins or ends
  run.ticks[1].report.insertion_m = 0.02;
  run.ticks[2].report.insertion_m = 0.01985;
  EXPECT_NEAR(maxUnexplainedStep_N(run), 0.03, 1e-12);
  run.ticks[2].report.flags = kFlagExit;
  EXPECT_NEAR(maxUnexplainedStep_N(run), 0.07, 1e-12);
}

TEST(UnexplainedStep, aDeclaredReleaseExplainsAFallAndNoRise) {
  const auto released = [](std::vector<double> cutting_N, double way_m, StepFlag flag) {
    PlantRun run = runOf(cutting_N, {0, way_m});
    for (std::size_t i = 0; i < cutting_N.size(); ++i) run.ticks[i].report.cutting_N = cutting_N[i];
    run.ticks[1].report.flags = flag;
    return maxUnexplainedStep_N(run);
  };
  for (const StepFlag flag : {kFlagExit, kFlagLayerChange, kFlagRupture, kFlagTurn}) {
    EXPECT_EQ(released({2, 1}, 0, flag), 0) << "a fall of any size";
    EXPECT_NEAR(released({1, 2}, 1e-4, flag), 0.95, 1e-12) << "0.1 mm against 500 N/m explain 0.05 N";
    EXPECT_NEAR(released({-1, 0.4}, 0, flag), 0.4, 1e-12) << "beyond zero it is a rise again";
  }
  EXPECT_EQ(released({2, 1}, 0, kFlagTorque), 1) << "no release";
}

TEST(UnexplainedStep, aReleaseThatUncoversAForceAgainstItIsNoRise) {
  // attracted by 0.4 N with 0.25 N of friction; the next layer does not attract
  PlantRun run = runOf({0.15, -0.25}, {0, 0});
  run.ticks[0].report.attracted_N = 0.4;
  run.ticks[0].report.friction_N = run.ticks[1].report.friction_N = -0.25;
  run.ticks[1].report.flags = kFlagLayerChange;
  EXPECT_NEAR(maxUnexplainedStep_N(run), 0, 1e-12);
  run.ticks[1].report.friction_N = run.ticks[1].report.wrench_W.force_N.z = -0.55;
  EXPECT_NEAR(maxUnexplainedStep_N(run), 0.3, 1e-12) << "friction that rose meanwhile is one";
}

TEST(UnexplainedStep, passesOverTicksThatWereNotStepped) {
  PlantRun turned = runOf({0, 1}, {0, 0});
  turned.ticks[1].report.flags = kFlagTurn | kFlagEntry;  // not a release
  EXPECT_EQ(maxUnexplainedStep_N(turned), 1);
  PlantRun missed = runOf({0, 5, 0}, {0, 0, 0});
  missed.ticks[1].stepped = false;
  EXPECT_EQ(maxUnexplainedStep_N(missed), 0);
}

TEST(TicksIn, takesTheHalfOpenWindow) {
  const PlantRun run = runOf(std::vector<double>(10, 0), std::vector<double>(10, 0));
  EXPECT_EQ(ticksIn(run, {0.002, 0.005}).size(), 3U);
  EXPECT_EQ(ticksIn(run, {0.002, 0.005}).front().time_s, 0.002);
  EXPECT_TRUE(ticksIn(run, {5, 6}).empty());
  EXPECT_EQ(peakToPeak(forceAlong(ticksIn(run, {5, 6}), {0, 0, 1})), 0);
}

TEST(ChatterOf, isTheRmsInTheBandOfTheWindowAlongTheDirection) {
  // quiet for a second, then a vibration of 0.2 N at 100 Hz
  std::vector<double> force_N(1000, 2.0);
  for (const double value : sine(100, 0.2, 3)) force_N.push_back(2 + value);
  const PlantRun run = runOf(force_N, std::vector<double>(force_N.size(), 0));
  const double expected_N = 0.2 / std::numbers::sqrt2 * highPassGain(100, 50, 4);
  EXPECT_NEAR(chatterOf(run, {0, 0, 1}, {2, 4}, {}), expected_N, 1e-4);
  // an oblique direction sees its share, a perpendicular one sees nothing
  EXPECT_NEAR(chatterOf(run, {0.6, 0, 0.8}, {2, 4}, {}), 0.8 * expected_N, 1e-4);
  EXPECT_EQ(chatterOf(run, {1, 0, 0}, {2, 4}, {}), 0);
  EXPECT_EQ(chatterOf(run, {0, 0, 1}, {0, 1}, {}), 0);
  EXPECT_EQ(chatterOf(run, {0, 0, 1}, {9, 10}, {}), 0) << "an empty window";
  // ten ticks per period: the maximum is at 72 degrees
  EXPECT_NEAR(maxForce_N(run), 2 + 0.2 * std::sin(0.4 * std::numbers::pi), 1e-9);
}

TEST(AllFinite, looksAtForcesPlaceAndEnergy) {
  const PlantRun good = runOf({0, 1, 2}, {0, 0, 0});
  EXPECT_TRUE(allFinite(good));
  EXPECT_TRUE(allFinite(runOf({}, {})));
  for (const double bad : {std::nan(""), static_cast<double>(INFINITY)}) {
    PlantRun force = good, torque = good, place = good, energy = good;
    force.ticks[2].report.wrench_W.force_N.y = bad;
    torque.ticks[1].report.wrench_W.torque_Nm.x = bad;
    place.ticks[0].p_W_m.z = bad;
    energy.ticks[1].energy_J = bad;
    for (const PlantRun* run : {&force, &torque, &place, &energy}) EXPECT_FALSE(allFinite(*run));
  }
}

TEST(Grows, tellsASwellingSwingFromAnEvenAndADyingOne) {
  const auto swing = [](double per_s) {
    std::vector<double> signal = sine(20, 1, 2);
    for (std::size_t i = 0; i < signal.size(); ++i)
      signal[i] *= std::exp(per_s * static_cast<double>(i) / kRate);
    return signal;
  };
  EXPECT_TRUE(grows(swing(1), 0.05));
  EXPECT_FALSE(grows(swing(0), 0.05));
  EXPECT_FALSE(grows(swing(-1), 0.05));
  EXPECT_FALSE(grows({}, 0.05));
}

// a wall that relaxes by 2 N a second while the force swings by ± 0.5 N at 10 Hz: 0.3 s are three periods
TEST(AboutSlowPart, keepsTheSwingAndNotTheCreep) {
  auto signal = sine(10, 0.5, 2);
  for (std::size_t i = 0; i < signal.size(); ++i) signal[i] += 3 - 2e-3 * static_cast<double>(i);
  const auto swing = aboutSlowPart(signal, 150);
  EXPECT_NEAR(peakToPeak(std::span(swing).subspan(150, 1700)), 1, 5e-3);
}

// a swing of 7 Hz that gives 2 mJ a second, after an insertion that took 100 mJ
TEST(EnergyInASecond, isWhatIsGivenAndNotWhatSwings) {
  std::vector<PlantTick> ticks(6000);
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    const double t = static_cast<double>(k) / kRate;
    ticks[k].grip_J = t < 1 ? -0.1 * t : -0.1 + 2e-3 * (t - 1) + 0.01 * std::sin(14 * std::numbers::pi * t);
  }
  EXPECT_NEAR(greatestInASecond_J(std::span(ticks).subspan(1000), kRate).value_or(0), 2e-3, 1e-6);
  EXPECT_EQ(greatestInASecond_J(std::span(ticks).first(1000), kRate), std::nullopt);
  EXPECT_EQ(greatestInASecond_J(std::span(ticks).first(2000), kRate), 0) << "the hand pays";
}

}  // namespace
}  // namespace needlelab
