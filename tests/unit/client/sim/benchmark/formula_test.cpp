// The laws checked by their own formulas: what a rupture costs, and how speed and diameter change it.
#include "client/sim/benchmark/formula.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

/// Bins of a line of 100 N/m from 2 mm to a rupture at 10 mm, then 0.3 N, for each kind.
TrainingSet trainedOn(const std::vector<InsertionKind>& kinds) {
  TrainingSet training;
  PooledBins pooled;
  for (int i = 0; i < 80; ++i) {
    CurveBin bin;
    bin.at = (i + 0.5) * kDepthBin_m;
    bin.block = i / 2;
    bin.value = bin.at < 0.002 ? 0 : bin.at < 0.01 ? 100 * (bin.at - 0.002) : 0.3;
    pooled.bins.push_back(bin);
    pooled.counts.push_back(1);
    pooled.squares.push_back(0);
  }
  training.all = pooled;
  training.all.kind = kinds.front();
  for (const InsertionKind& kind : kinds) {
    training.kinds.push_back(pooled);
    training.kinds.back().kind = kind;
  }
  training.diameters = kinds.front().diameter_m > 0;
  training.to_m = 0.02;
  return training;
}

std::vector<std::string> namesOf(const Formula& formula) {
  std::vector<std::string> names;
  for (const FitParameter& parameter : formula.parameters) names.push_back(parameter.name);
  return names;
}

bool has(const Formula& formula, const std::string& name) {
  const auto names = namesOf(formula);
  return std::find(names.begin(), names.end(), name) != names.end();
}

// where the force drops: the first depth after its maximum
double ruptureAt(const Formula& law, const std::vector<double>& values, const InsertionKind& kind) {
  std::vector<double> depth_m;
  for (double d = 0; d < 0.02; d += 1e-6) depth_m.push_back(d);
  const auto force_N = law.forces(values, kind, depth_m);
  return depth_m[static_cast<std::size_t>(std::max_element(force_N.begin(), force_N.end()) -
                                          force_N.begin())];
}

// share, relaxation, friction, rupture, stretch, force, cutting
const std::vector<double> kOneRupture = {2, 0.5, 10, 0.01, 0.008, 0.8, 0.3};

TEST(RateDependentFracture, atTheReferencesSpeedItRupturesWhereItsNumbersSay) {
  const InsertionKind slow{0.003, 0};
  const Formula law = rateDependentFracture(trainedOn({slow}), 20);
  ASSERT_EQ(law.parameters.size(), 7u) << "one speed, no diameter: three shared numbers";
  EXPECT_NEAR(ruptureAt(law, kOneRupture, slow), 0.01, 2e-6);
  const auto force_N = law.forces(kOneRupture, slow, {0.001, 0.00999999, 0.0101, 0.015});
  EXPECT_EQ(force_N[0], 0);
  EXPECT_NEAR(force_N[1], 0.8, 1e-4);
  EXPECT_NEAR(force_N[2], 0.3 + 10 * 0.0081, 1e-9) << "cutting, and friction on all that is inside";
  EXPECT_NEAR(force_N[3], 0.3 + 10 * 0.013, 1e-9);
}

TEST(RateDependentFracture, aFasterNeedleRupturesEarlierAndNeverBelowTheElasticLimit) {
  const InsertionKind slow{0.003, 0};
  const Formula law = rateDependentFracture(trainedOn({slow}), 20);
  double before_m = 1;
  for (const double speed : {0.0003, 0.003, 0.03, 0.3}) {
    const double at_m = ruptureAt(law, kOneRupture, {speed, 0});
    EXPECT_LT(at_m, before_m) << speed;
    before_m = at_m;
  }
  // infinitely fast, the Maxwell element is a spring of 2 k: the same work at z₀ √((1 + 2 s²)/3), where s =
  // L/z₀ (1 − e^(−z₀/L)) of the reference
  const double L = 0.0015, z = 0.008, s = L / z * (1 - std::exp(-z / L));
  EXPECT_NEAR(ruptureAt(law, kOneRupture, {1000, 0}) - 0.002, z * std::sqrt((1 + 2 * s * s) / 3), 1e-5);
}

TEST(RateDependentFracture, speedAndDiameterHaveExponentsOnlyWhereTheyVaried) {
  const Formula both = rateDependentFracture(trainedOn({{0.003, 0.001}, {0.03, 0.002}}), 20);
  EXPECT_TRUE(has(both, "exponent of speed"));
  EXPECT_TRUE(has(both, "exponent of diameter"));
  const Formula none = rateDependentFracture(trainedOn({{0.003, 0.001}}), 20);
  EXPECT_FALSE(has(none, "exponent of speed"));
  EXPECT_FALSE(has(none, "exponent of diameter"));
  // fitted on one diameter, the force grows in proportion to it
  const auto thin = none.forces(kOneRupture, {0.003, 0.001}, {0.008});
  const auto wide = none.forces(kOneRupture, {0.003, 0.0015}, {0.008});
  EXPECT_NEAR(wide[0] / thin[0], 1.5, 1e-12);
}

TEST(RateDependentFracture, cuttingGrowsWithTheFittedPowerOfSpeed) {
  const Formula law = rateDependentFracture(trainedOn({{0.003, 0}, {0.03, 0}}), 20);
  // no viscous share, no friction
  const std::vector<double> values = {0, 1, 0, 0.5, 0.01, 0.008, 0.8, 0.3};
  const double reference = law.forces(values, {0.003, 0}, {0.015})[0];
  const double faster = law.forces(values, {0.03, 0}, {0.015})[0];
  EXPECT_NEAR(faster / reference, std::sqrt(10.0), 1e-9);
}

TEST(GordonExponential, risesToItsForceAndFallsWithItsLength) {
  const Formula law = gordonExponential(trainedOn({{0.003, 0}}), 20);
  ASSERT_EQ(law.parameters.size(), 6u);
  // curvature, fall, top, rupture, force, force after it
  const std::vector<double> values = {2, 0.001, 0.002, 0.01, 0.8, 0.3};
  const auto force_N = law.forces(values, {0.003, 0}, {0.001, 0.006, 0.00999999, 0.011, 0.019});
  EXPECT_EQ(force_N[0], 0);
  EXPECT_NEAR(force_N[1], 0.8 * std::expm1(1.0) / std::expm1(2.0), 1e-12);
  EXPECT_NEAR(force_N[2], 0.8, 1e-4);
  EXPECT_NEAR(force_N[3], 0.3 + 0.5 * std::exp(-1.0), 1e-9);
  EXPECT_NEAR(force_N[4], 0.3, 1e-3);
}

TEST(GordonExponential, aSecondRiseBeginsWhereTheFallIs) {
  const Formula law = gordonExponential(trainedOn({{0.003, 0}}), 20);
  const std::vector<double> values = {2, 0.001, 0.002, 0.006, 0.8, 0.3, 0.007, 0.012, 1.5, 0.2};
  const auto force_N = law.forces(values, {0.003, 0}, {0.007 - 1e-9, 0.007 + 1e-9});
  EXPECT_NEAR(force_N[0], force_N[1], 1e-6);
}

TEST(Formula, keepsToTheNumbersThatItMayHave) {
  TrainingSet training = trainedOn({{0.003, 0.001}, {0.03, 0.002}});
  // a sawtooth: eight ruptures
  for (CurveBin& bin : training.all.bins) bin.value = std::fmod(bin.at, 0.0025) * 400;
  for (const std::size_t most : {9u, 13u, 20u}) {
    EXPECT_LE(rateDependentFracture(training, most).parameters.size(), most);
    EXPECT_LE(gordonExponential(training, most).parameters.size(), most);
  }
  EXPECT_GT(rateDependentFracture(training, 40).parameters.size(), 30u);
}

}  // namespace
}  // namespace needlelab
