// Stops (FORCE_MODEL.md, "Stop"): when one begins and ends, the remaining force, and hands that yield to it.
// The hands are integrated here, independently of the product's plant.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr double kEncoder_m = 1e-5;
double read_m(double place_m) {
  return std::round(place_m / kEncoder_m) * kEncoder_m;
}

SceneSpec stopScene(double cutting_N = 1.0) {
  return withEffects(oneLayer(cutting_N, 0.5, 0.1), kAxial);
}

int stopsIn(const std::vector<StepReport>& reports) {
  int stops = 0;
  for (std::size_t k = 1; k < reports.size(); ++k)
    stops += reports[k].phase == Phase::kStopped && reports[k - 1].phase != Phase::kStopped;
  return stops;
}

double alongWall_N(const StepReport& report) {
  return report.cutting_N + report.attracted_N;
}

double meanOf(const std::vector<double>& numbers, std::size_t from, std::size_t to) {
  double sum = 0;
  for (std::size_t k = from; k < to; ++k) sum += numbers[k];
  return sum / static_cast<double>(to - from);
}

// inserted at 20 mm/s to 12 mm
Probe inserted(const SceneSpec& scene, double rate_hz = 1000) {
  Probe probe(scene, rate_hz);
  probe.at(-1e-4);
  probe.go(static_cast<int>(0.6 * rate_hz), 0.012);
  return probe;
}

TEST(Stop, aSlowAdvanceAfterARestMeetsTheTissueAgain) {
  for (const double speed_mps : {0.0005, 0.001, 0.002, 0.004}) {
    Probe probe = inserted(stopScene());
    probe.stay(4000);
    EXPECT_NEAR(probe.last().cutting_N, -0.1, 1e-9);
    probe.go(static_cast<int>(0.004 / speed_mps * 1e3), 0.016);
    EXPECT_NEAR(probe.last().cutting_N, -1.0, 1e-9) << speed_mps;
    EXPECT_EQ(probe.last().phase, Phase::kInserting) << speed_mps;
  }
}

TEST(Stop, aSlowWithdrawalAfterARestIsAttracted) {
  for (const double speed_mps : {0.0005, 0.001, 0.002, 0.004}) {
    Probe probe = inserted(stopScene());
    probe.stay(4000);
    probe.go(static_cast<int>(0.004 / speed_mps * 1e3), 0.008);
    EXPECT_NEAR(probe.last().attracted_N, 0.5, 1e-9) << speed_mps;
    EXPECT_EQ(probe.last().phase, Phase::kWithdrawing) << speed_mps;
  }
}

TEST(Stop, aSlowAdvanceFromTheSkinOnIsNoStop) {
  for (const double speed_mps : {0.0005, 0.001, 0.002}) {
    Probe probe(stopScene(), 1000);
    probe.at(-1e-4);
    const auto reports = probe.go(static_cast<int>(0.01 / speed_mps * 1e3), 0.01);
    EXPECT_EQ(stopsIn(reports), 0) << speed_mps;
    EXPECT_NEAR(probe.last().cutting_N, -1.0, 1e-9) << speed_mps;
  }
}

// 0.34 mm in 0.8 s: a drift below 0.43 mm/s is a rest
TEST(Stop, aRestNeedsEightTenthsOfASecondInTheBand) {
  for (const double rate_hz : {250.0, 1000.0, 4000.0}) {
    Probe probe(stopScene(), rate_hz);
    probe.at(-1e-4);
    probe.go(static_cast<int>(5 * rate_hz), 0.005);  // 1 mm/s
    const auto hold = probe.stay(static_cast<int>(2 * rate_hz));
    std::size_t first = 0;
    while (first < hold.size() && hold[first].phase != Phase::kStopped) ++first;
    // the band began at most 0.34 mm before the rest
    EXPECT_LE(static_cast<double>(first) / rate_hz, 0.8) << rate_hz;
    EXPECT_GE(static_cast<double>(first) / rate_hz, 0.8 - 0.34 - 1.5 / rate_hz) << rate_hz;
    EXPECT_EQ(stopsIn(hold), 1);
  }
}

TEST(Stop, aRestThatDriftsEndsAtTheRejectionForceWithOneStop) {
  for (const double drift_mps : {-1e-4, 0.0, 1e-4}) {
    Probe probe = inserted(stopScene());
    const auto hold = probe.go(10'000, 0.012 + 10 * drift_mps);
    EXPECT_EQ(stopsIn(hold), 1) << drift_mps;
    // outward the needle would be pulled in: nothing is left of that
    EXPECT_NEAR(alongWall_N(hold.back()), drift_mps < 0 ? 0 : -0.1, 0.01) << drift_mps;
  }
}

// a tremor on a drift: its extremes reach the wall
TEST(Stop, tremorAddsTheSpringTimesItsPeakToTheRejectionForce) {
  for (const double peak_m : {5e-5, 1e-4})
    for (const double frequency_hz : {4.0, 6.0, 9.0, 12.0}) {
      Probe probe = inserted(stopScene());
      std::vector<double> force_N;
      for (int k = 0; k < 10'000; ++k) {
        const double t_s = k * 1e-3;
        const double x_m = 0.012 + 1e-4 * t_s + peak_m * std::sin(2 * std::numbers::pi * frequency_hz * t_s);
        force_N.push_back(alongWall_N(probe.at(read_m(x_m))));
      }
      for (std::size_t end = 4000; end < force_N.size(); end += 250)
        EXPECT_LE(std::abs(meanOf(force_N, end - 250, end)), 0.1 + 500 * peak_m + 0.02)
            << peak_m << " m, " << frequency_hz << " Hz, " << end;
    }
}

// a mass on a hand's spring and damper, pushed by the wall, whose force is one tick late
class LooseHand {
 public:
  LooseHand(const SceneSpec& scene, double stiffness_N_per_m)
      : probe_(scene, 1000), stiffness_(stiffness_N_per_m) {
    probe_.at(-0.005);
  }
  StepReport tick(double aim_m, double aim_mps, double push_N = 0) {
    constexpr int kSteps = 20;
    constexpr double kStep_s = 1e-3 / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const double hand_N = stiffness_ * (aim_m - x_m_) + kDamping_Ns_per_m * (aim_mps - v_mps_);
      v_mps_ += (hand_N + push_N + rendered_N_ - 0.5 * v_mps_) / kMass_kg * kStep_s;
      x_m_ += v_mps_ * kStep_s;
    }
    rendered_N_ = computed_N_;
    const StepReport report = probe_.at(read_m(x_m_));
    computed_N_ = alongWall_N(report);
    return report;
  }
  void let() { stiffness_ = 0; }
  [[nodiscard]] double place_m() const { return x_m_; }

 private:
  static constexpr double kMass_kg = 0.35, kDamping_Ns_per_m = 3;
  Probe probe_;
  double stiffness_;
  double x_m_ = -0.005, v_mps_ = 0, rendered_N_ = 0, computed_N_ = 0;
};

TEST(Stop, aYieldingHandStopsOnceAtTheRejectionForce) {
  for (const double cutting_N : {1.0, 4.0})
    for (const double stiffness : {100.0, 300.0, 600.0, 2000.0}) {
      LooseHand hand(stopScene(cutting_N), stiffness);
      double aim_m = -0.005;
      const double end_m = 0.02 + cutting_N / stiffness;
      for (; aim_m < end_m - 2e-3; aim_m += 2e-5) hand.tick(aim_m, 0.02);
      for (double speed_mps = 0.02; speed_mps > 0; speed_mps -= 1e-4)
        hand.tick(aim_m += speed_mps * 1e-3, speed_mps);
      std::vector<StepReport> hold;
      for (int k = 0; k < 14'000; ++k)
        hold.push_back(hand.tick(aim_m + 5e-5 * std::sin(0.0565 * k), 0));  // 9 Hz
      EXPECT_EQ(stopsIn(hold), 1) << cutting_N << " N, " << stiffness << " N/m";
      // the wall has followed the hand's tremor of 0.1 mm from end to end, which stretches it by that
      double greatest_N = 0;
      for (std::size_t k = 13'000; k < hold.size(); ++k)
        greatest_N = std::max(greatest_N, -alongWall_N(hold[k]));
      EXPECT_GE(greatest_N, 0.08) << cutting_N << " N, " << stiffness << " N/m";
      EXPECT_LE(greatest_N, 0.1 + 500 * 1e-4 + 0.002) << cutting_N << " N, " << stiffness << " N/m";
    }
}

TEST(Stop, aConstantPushOfHalfTheCuttingForceMovesTheNeedleLittle) {
  LooseHand hand(stopScene(), 300);
  for (double aim_m = -0.005; aim_m < 0.012; aim_m += 2e-5) hand.tick(aim_m, 0.02);
  const double from_m = hand.place_m();
  hand.let();
  for (int k = 0; k < 20'000; ++k) hand.tick(0, 0, 0.5);
  EXPECT_LE(hand.place_m() - from_m, 0.01);
}

// K_t of a layer: if stiffer, the force continues without a step; if softer, it falls by the ratio of the
// springs and is reported
TEST(WallStiffnessOfALayer, aStifferLayerKeepsTheForceASofterReleasesIt) {
  for (const double ratio : {2.0, 0.5}) {
    SceneSpec scene = stopScene(2.0);
    scene.layers[0].thickness_m = 0.0105;
    scene.layers.push_back(scene.layers[0]);
    scene.layers[1].thickness_m = 0.1;
    scene.layers[1].wall_stiffness_N_per_m = 500 * ratio;
    Probe probe(scene, 1000);
    probe.at(-1e-4);
    probe.go(1000, 0.0104);
    const double before_N = probe.last().cutting_N;
    EXPECT_NEAR(before_N, -2.0, 1e-9);
    const StepReport crossed = probe.at(0.0106);
    EXPECT_TRUE(crossed.flags & kFlagLayerChange);
    EXPECT_NEAR(crossed.cutting_N, ratio > 1 ? -2.0 : -500 * ratio * (0.0106 - 0.0064), 1e-9) << ratio;
    EXPECT_NEAR(probe.go(500, 0.02).back().cutting_N, -2.0, 1e-9) << "dragged again";
  }
}

TEST(WallStiffnessOfALayer, givesNoEnergyOverAnyGesture) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SceneSpec scene = withEffects(paperSixLayers(), kAxial);
    for (std::size_t i = 0; i < scene.layers.size(); ++i)
      scene.layers[i].wall_stiffness_N_per_m = i % 2 == 0 ? 250 : 900;
    const Motion motion = randomGesture(seed, 4000, defaultSite());
    EngineRun run(scene, 4000);
    EXPECT_LE(forceWork(motion, run.run(motion)), 1e-6) << "seed " << seed;
  }
}

// 20 mm/s across: cutting fell from 2.00 to 0.10 N
TEST(Stop, aNeedleThatMovesAcrossDoesNotRest) {
  for (const double speed_mps : {0.005, 0.02, 0.05}) {
    Probe probe = inserted(stopScene(2));
    probe.stay(30);
    const double cutting_N = probe.last().cutting_N;
    ASSERT_LT(cutting_N, -1.9);
    const int ticks = static_cast<int>(0.015 / speed_mps * 1000);
    for (const StepReport& report : probe.go(ticks, 0.012, 0.015))
      if (report.phase == Phase::kStopped)
        ASSERT_GE(-report.cutting_N, 1.8) << speed_mps;  // a stop may begin before the first 0.34 mm
    EXPECT_NEAR(probe.last().cutting_N, cutting_N, 0.2) << speed_mps;
    EXPECT_NE(probe.last().phase, Phase::kStopped) << speed_mps;
    probe.stay(3000);
    EXPECT_NEAR(probe.last().cutting_N, -0.1, 0.01) << "and then it rests";
  }
}

TEST(Stop, tremorOfATenthOfAMillimetreRestsInEveryDirection) {
  for (const double frequency_hz : {4.0, 6.0, 8.0, 10.0, 12.0})
    for (const auto& [in, one, other] :
         {std::array{0.0, 1.0, 0.0}, std::array{0.0, 0.6, 0.8}, std::array{0.6, 0.8, 0.0}}) {
      Probe probe = inserted(stopScene(2));
      double worst_N = 0;
      for (int k = 0; k < 6000; ++k) {
        const double t = 1e-4 * std::sin(2 * std::numbers::pi * frequency_hz * 1e-3 * k);
        const StepReport report = probe.at(0.012 + in * t, one * t, other * t);
        if (k > 4000) worst_N = std::max(worst_N, -report.cutting_N);
      }
      EXPECT_EQ(probe.last().phase, Phase::kStopped) << frequency_hz << " Hz, " << in;
      EXPECT_LE(worst_N, 0.1 + 500 * 2e-4 * in + 0.01) << frequency_hz << " Hz, " << in;
    }
}

}  // namespace
}  // namespace needlelab::test
