// Tests the live FEM needle on a compliance given by formula, without a mesh: contact law, energy,
// continuity.
#include "common/haptics/models/fem_needle.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "tests/support/random.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/unit/common/fem/soft_tissue.h"

namespace needlelab::test {
namespace {

constexpr double kFriction_N_per_m = 25, kCutting_N = 0.8, kSpacing_m = 0.001;
constexpr std::size_t kStations = 40;

// exponential in the distance: positive definite, and similar to tissue near the needle
std::shared_ptr<const NeedleCompliance> madeCompliance(double own_give_m_per_N = 5e-3) {
  auto compliance = std::make_shared<NeedleCompliance>();
  compliance->spacing_m = kSpacing_m;
  compliance->radius_m = 0.4e-3;
  for (std::size_t i = 0; i < kStations; ++i) {
    compliance->depth_m.push_back((static_cast<double>(i) + 0.5) * kSpacing_m);
    for (std::size_t j = 0; j < kStations; ++j) {
      const double apart = std::fabs(static_cast<double>(i) - static_cast<double>(j));
      compliance->give_m_per_N.push_back(own_give_m_per_N * std::exp(-apart / 3.0));
    }
  }
  return compliance;
}

SceneSpec madeScene(double friction_N_per_m = kFriction_N_per_m, double cutting_N = kCutting_N) {
  SceneSpec scene = softBlock(10e3, 0.45, kStations * kSpacing_m, friction_N_per_m, cutting_N);
  scene.fem.compliance = madeCompliance();
  return scene;
}

// cubic B-spline by de Boor's recursion, centred on 0, knots one apart
double spline(double at, int degree = 3) {
  if (degree == 0) return at >= -0.5 && at < 0.5 ? 1.0 : 0.0;
  const double half = 0.5 * (degree + 1);
  return ((at + half) * spline(at + 0.5, degree - 1) + (half - at) * spline(at - 0.5, degree - 1)) / degree;
}
// ∫ of the cubic spline up to there: the sum of splines of degree 4
double splineUpTo(double at) {
  double sum = 0;
  for (int k = 0; k < 5; ++k) sum += spline(std::min(at, 2.0) - 0.5 - k, 4);
  return sum;
}
// over a bevel of 0.8 mm at 11°, reflected at the skin
Eigen::VectorXd tipWeights(double depth_m) {
  const double knot_m = 0.25 * 0.8e-3 / std::tan(11 * std::numbers::pi / 180);
  Eigen::VectorXd weights(kStations);
  for (int i = 0; i < static_cast<int>(kStations); ++i) {
    const double top = i * kSpacing_m, bottom = top + kSpacing_m;
    weights[i] = splineUpTo((bottom - depth_m) / knot_m) - splineUpTo((top - depth_m) / knot_m) +
                 splineUpTo((bottom + depth_m) / knot_m) - splineUpTo((top + depth_m) / knot_m);
  }
  return weights;
}

// tip depths of a random stroke: in, out, partly, standing still, several times
std::vector<double> randomStroke(std::uint64_t seed, int legs = 8, double deepest_m = 0.036) {
  Random random(seed);
  std::vector<double> depths;
  double at = 0;
  for (int leg = 0; leg < legs; ++leg) {
    const double to = leg + 1 == legs ? 1e-6 : random.in(1e-5, deepest_m);
    const int ticks = static_cast<int>(random.in(40, 700));
    for (int k = 1; k <= ticks; ++k) {
      const double t = static_cast<double>(k) / ticks;
      depths.push_back(at + (to - at) * t * t * t * (10 + t * (-15 + 6 * t)));
    }
    at = to;
    if (random.chance(0.4)) depths.insert(depths.end(), static_cast<std::size_t>(random.in(1, 200)), at);
  }
  return depths;
}

NeedlePose straight(double x_m) {
  return {x_m, std::max(0.0, x_m), 1.0};
}
double push(const NeedleForce& force) {  // the hand's push, positive into the tissue
  return -(force.cutting_N + force.friction_N);
}

// Every tick solves its contact problem: this test checks bounds, sticking and slipping independently.
void expectContactLaw(double slant, std::uint64_t seed) {
  const FemNeedle needle = compileNeedle(madeScene());
  const NeedleCompliance& compliance = *needle.compliance;
  const Eigen::Map<const Eigen::MatrixXd> give(compliance.give_m_per_N.data(), kStations, kStations);
  NeedleState state{};
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(kStations);
  double x_before = 0, tip_before = 0;
  int sticking = 0, slipping = 0, cutting = 0, apart = 0;
  for (const double x : randomStroke(seed)) {
    const NeedleState before = state;
    stepNeedle(needle, {x, x, slant}, state);
    ASSERT_EQ(state.unsettled, 0u);

    const Eigen::Map<const Eigen::VectorXd> shaft(state.shaft_N.data(), kStations);
    const Eigen::VectorXd weights = tipWeights(before.cut_m * slant);
    const Eigen::VectorXd moved_now = give * (shaft + weights * state.tip_N);
    const double inside = std::min(x, before.cut_m) * slant;
    for (std::size_t j = 0; j < kStations; ++j) {
      const double top = static_cast<double>(j) * kSpacing_m;
      const double most = kFriction_N_per_m * std::clamp(inside - top, 0.0, kSpacing_m) / slant;
      const auto n = static_cast<Eigen::Index>(j);
      const double slip = (x - x_before) - (moved_now[n] - moved[n]);
      ASSERT_LE(std::fabs(shaft[n]), most + 1e-12);
      if (most == 0) continue;
      if (shaft[n] < most - 1e-9 && shaft[n] > -most + 1e-9) {
        ASSERT_NEAR(slip, 0, 1e-11) << "station " << j << " at " << x;
        ++sticking;
      } else {
        ASSERT_GE(slip * shaft[n], -1e-12) << "station " << j << " at " << x;
        ++slipping;
      }
    }

    ASSERT_GE(state.tip_N, 0.0);
    ASSERT_LE(state.tip_N, kCutting_N + 1e-12);
    const double slip = (x - x_before) - weights.dot(moved_now - moved) -
                        needle.tip_give_m_per_N * (state.tip_N - tip_before) - before.gap_m;
    if (state.tip_N > 1e-9 && state.tip_N < kCutting_N - 1e-9) {
      ASSERT_NEAR(slip, 0, 1e-11);
      ASSERT_EQ(state.cut_m, before.cut_m);
    } else if (state.tip_N >= kCutting_N - 1e-9) {
      ASSERT_GE(slip, -1e-11);
      ++cutting;
    } else {
      ASSERT_LE(slip, 1e-11);
      ASSERT_NEAR(state.gap_m, std::max(0.0, -slip), 1e-11);
      ++apart;
    }
    ASSERT_GE(state.cut_m, before.cut_m);
    moved = moved_now;
    x_before = x;
    tip_before = state.tip_N;
  }
  EXPECT_GT(sticking, 100);
  EXPECT_GT(slipping, 100);
  EXPECT_GT(cutting, 20);
  EXPECT_GT(apart, 20);
}

TEST(FemNeedle, everyTickSticksSlipsAndCutsByTheLaw) {
  for (std::uint64_t seed = 1; seed <= (longForm() ? 40u : 6u); ++seed) expectContactLaw(1.0, seed);
  for (std::uint64_t seed = 50; seed <= 52; ++seed) expectContactLaw(0.6, seed);
}

TEST(FemNeedle, neverGivesMoreThanItStored) {
  for (std::uint64_t seed = 1; seed <= (longForm() ? 400u : 40u); ++seed) {
    const FemNeedle needle = compileNeedle(madeScene());
    NeedleState state{};
    double work = 0, trapezoid = 0, push_before = 0, x_before = 0;
    for (const double x : randomStroke(seed)) {
      const double force = push(stepNeedle(needle, straight(x), state));
      work += force * (x - x_before);
      trapezoid += 0.5 * (force + push_before) * (x - x_before);
      // Passive including the stored energy: stronger than never giving net energy.
      ASSERT_GE(work, storedEnergy(needle, state) - 1e-12) << "seed " << seed;
      ASSERT_GE(trapezoid, -1e-7) << "seed " << seed;
      push_before = force;
      x_before = x;
    }
    EXPECT_GT(trapezoid, 1e-3);  // and it does dissipate
    EXPECT_EQ(state.unsettled, 0u);
  }
}

TEST(FemNeedle, withoutFrictionAndCuttingTheResponseIsElastic) {
  SceneSpec scene = madeScene(0.0, 50.0);  // never cuts
  const FemNeedle needle = compileNeedle(scene);
  NeedleState state{};
  double work = 0, before = 0, x_before = 0;
  std::vector<double> in, out;
  for (int k = 1; k <= 400; ++k) {
    const double x = 0.004 * (k <= 200 ? k : 400 - k) / 200;
    const double force = push(stepNeedle(needle, straight(x), state));
    work += 0.5 * (force + before) * (x - x_before);
    before = force;
    x_before = x;
    // Nothing is cut: the needle acts as a spring with the tip's stiffness at the surface.
    EXPECT_NEAR(force, x / tipGive_m_per_N(needle, 0), 1e-9);
  }
  EXPECT_NEAR(work, 0, 1e-12);
  EXPECT_EQ(state.cut_m, 0.0);
}

TEST(FemNeedle, cuttingForceIsReachedAndHeldInHomogeneousTissue) {
  const FemNeedle needle = compileNeedle(madeScene(0.0, kCutting_N));
  NeedleState state{};
  double reached_m = 0;
  for (int k = 1; k <= 3000; ++k) {
    const double x = 1e-5 * k;
    const double force = push(stepNeedle(needle, straight(x), state));
    if (reached_m == 0 && state.cut_m > 0) reached_m = x;
    EXPECT_LE(force, kCutting_N + 1e-12);
    if (x > 0.012) {
      EXPECT_NEAR(force, kCutting_N, 0.01 * kCutting_N) << x;
    }
  }
  EXPECT_NEAR(reached_m, kCutting_N * tipGive_m_per_N(needle, 0), 2e-5);
  // The cut lags behind the tip by the tissue's displacement.
  EXPECT_NEAR(state.x_m - state.cut_m, kCutting_N * tipGive_m_per_N(needle, state.cut_m), 2e-4);
}

TEST(FemNeedle, reversesWithTheStiffnessOfAllThatSticks) {
  const FemNeedle needle = compileNeedle(madeScene());
  NeedleState state{};
  double force = 0, x = 0;
  for (int k = 1; k <= 3000; ++k) force = push(stepNeedle(needle, straight(x = 1e-5 * k), state));
  // First a rest, so that the last cut settles.
  for (int k = 0; k < 20; ++k) force = push(stepNeedle(needle, straight(x), state));
  const NeedleState at_turn = state;
  const double back = push(stepNeedle(needle, straight(x - 1e-6), state));
  // the stations inside and the tip, moving as one rigid piece
  const auto inside = static_cast<Eigen::Index>(std::ceil(at_turn.cut_m / kSpacing_m));
  const Eigen::Map<const Eigen::MatrixXd> give(needle.compliance->give_m_per_N.data(), kStations, kStations);
  const Eigen::VectorXd weights = tipWeights(at_turn.cut_m);
  Eigen::MatrixXd all(inside + 1, inside + 1);
  all.topLeftCorner(inside, inside) = give.topLeftCorner(inside, inside);
  all.col(inside).head(inside) = give.topRows(inside) * weights;
  all.row(inside).head(inside) = all.col(inside).head(inside).transpose();
  all(inside, inside) = weights.dot(give * weights) + needle.tip_give_m_per_N;
  const double stiffness = all.ldlt().solve(Eigen::VectorXd::Ones(inside + 1)).sum();
  EXPECT_NEAR((force - back) / 1e-6, stiffness, 0.01 * stiffness);
  EXPECT_LE(stiffness, needle.stiffness_N_per_m);
}

TEST(FemNeedle, forceNeverStepsAsStationsAreCrossed) {
  // slowly through all stations and back: no tick may change the force by more than the stiffest response to
  // its motion plus the change of the cutting force, which is 0 here
  const FemNeedle needle = compileNeedle(madeScene());
  NeedleState state{};
  double before = 0, x_before = 0, worst = 0;
  for (int k = 1; k <= 14'000; ++k) {
    const double x = k <= 7000 ? 5e-6 * k : 5e-6 * (14'000 - k) + 1e-9;
    const double force = push(stepNeedle(needle, straight(x), state));
    if (k > 1) worst = std::max(worst, std::fabs(force - before) / std::fabs(x - x_before));
    before = force;
    x_before = x;
  }
  EXPECT_LE(worst, 1.05 * needle.stiffness_N_per_m);
  EXPECT_NEAR(before, 0.0, 1e-3);  // no force remains at the exit
}

TEST(FemNeedle, cutStaysCut) {
  const FemNeedle needle = compileNeedle(madeScene(0.0, kCutting_N));
  NeedleState state{};
  const auto go = [&](double from, double to) {
    double greatest = 0;
    for (int k = 1; k <= 1000; ++k)
      greatest = std::max(greatest, push(stepNeedle(needle, straight(from + (to - from) * k / 1000), state)));
    return greatest;
  };
  go(0, 0.02);
  const double cut = state.cut_m;
  go(0.02, 0.002);
  EXPECT_EQ(state.tip_N, 0.0);
  EXPECT_LT(go(0.002, cut - 1e-4), 1e-9);  // no force through its own channel
  EXPECT_EQ(state.cut_m, cut);
  EXPECT_NEAR(go(cut - 1e-4, 0.03), kCutting_N, 1e-9);  // then it continues to cut
}

TEST(FemNeedle, forceDropsOnlyInReleasesAtLayersSofterToCut) {
  SceneSpec scene = madeScene(0.0, 2.0);
  scene.layers[0].thickness_m = 0.01;
  scene.layers.push_back(scene.layers[0]);
  scene.fem.layers.push_back({10e3, 0.45, 0.0, 0.3});
  const FemNeedle needle = compileNeedle(scene);
  NeedleState state{};
  double before = 0, worst = 0, last = 0;
  int releases = 0, torn = 0;
  for (int k = 1; k <= 30'000; ++k) {
    const double cut_before_m = state.cut_m;
    const NeedleForce force = stepNeedle(needle, straight(1e-6 * k), state);
    last = push(force);
    // the cut tears ahead of the needle
    if (state.cut_m - cut_before_m > 2.001e-6) {
      ++torn;
      EXPECT_TRUE(force.releases) << k;
    }
    if (force.releases)
      ++releases;
    else
      worst = std::max(worst, std::fabs(last - before) - 1e-6 * needle.stiffness_N_per_m);
    before = last;
  }
  EXPECT_NEAR(last, 0.3, 1e-6);
  EXPECT_GT(releases, 0);
  EXPECT_LT(releases, 3000);
  EXPECT_GT(torn, 0);
  EXPECT_LE(worst, 0.01);  // too small to feel
}

TEST(FemNeedle, usesNoHeap) {
  const FemNeedle needle = compileNeedle(madeScene());
  const std::vector<double> stroke = randomStroke(3);
  NeedleState state{};
  std::uint64_t calls = 0;
  {
    const NoAllocScope scope;
    for (const double x : stroke) stepNeedle(needle, straight(x), state);
    calls = scope.calls();
  }
  EXPECT_EQ(calls, 0u);
}

}  // namespace
}  // namespace needlelab::test
