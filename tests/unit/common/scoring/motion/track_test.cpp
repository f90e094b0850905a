#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "common/scoring/motion/track.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(Track, aStraightLineStaysAsItIs) {
  const Vec3 v{0.03, -0.04, 0.12};
  const auto samples = gesture(1000, 0.7345, [&](double t, GestureSample& s) { setTip(s, v * t); });
  const auto runs = runsOf(samples, 1000);
  ASSERT_EQ(runs.size(), 1u);
  const auto& run = runs[0];
  ASSERT_EQ(run.points.size(), 75u) << "0.735 s in steps of at most 10 ms";
  for (std::size_t i = 0; i < run.points.size(); ++i) {
    const double t = static_cast<double>(i) * run.period_s;
    EXPECT_NEAR(norm(run.points[i].p_WT_m - v * t), 0, 1e-12);
    EXPECT_NEAR(norm(run.points[i].v_WT_mps - v), 0, 1e-10);
    EXPECT_NEAR(norm(run.points[i].axis_W - Vec3{0, 0, -1}), 0, 1e-12);
  }
}

TEST(Track, aSineIsDampedByTheFiltersFormula) {
  for (const double f : {0.5, 2.0, 6.0, 10.0}) {
    const auto samples = gesture(1000, 10, [&](double t, GestureSample& s) {
      setTip(s, {std::sin(2 * std::numbers::pi * f * t), 0, 0});
    });
    const auto run = runsOf(samples, 1000).front();
    // amplitude from the mean square over whole periods
    double squares = 0;
    for (std::size_t i = 200; i < 800; ++i) squares += run.points[i].p_WT_m.x * run.points[i].p_WT_m.x;
    const double amplitude = std::sqrt(2 * squares / 600);
    // mean over 10 ms, then the Gaussian: half the power at 6 Hz
    const double x = std::numbers::pi * f * kAnalysisPeriod_s;
    const double expected = std::sin(x) / x * std::pow(0.5, 0.5 * std::pow(f / kAnalysisCutoffHz, 2));
    EXPECT_NEAR(amplitude, expected, 1e-3) << f << " Hz";
  }
}

TEST(Track, smoothingNeverMakesAPathLonger) {
  std::srand(1);
  Vec3 p;
  double raw = 0;
  const auto samples = gesture(1000, 2, [&](double, GestureSample& s) {
    const Vec3 step{1e-4 * (std::rand() % 21 - 10), 1e-4 * (std::rand() % 21 - 10),
                    1e-4 * (std::rand() % 21 - 10)};
    p += step;
    raw += norm(step);
    setTip(s, p);
  });
  const auto run = runsOf(samples, 1000).front();
  double smooth = 0;
  for (std::size_t i = 1; i < run.points.size(); ++i)
    smooth += norm(run.points[i].p_WT_m - run.points[i - 1].p_WT_m);
  EXPECT_LT(smooth, raw);
  EXPECT_GT(smooth, 0);
}

TEST(Track, endsStayWhereTheyAre) {
  const auto samples = gesture(1000, 0.1, [](double t, GestureSample& s) {
    setTip(s, {t * t, std::sin(40 * t), 0});
  });
  const auto run = runsOf(samples, 1000).front();
  EXPECT_NEAR(norm(run.points.front().p_WT_m), 0, 1e-15);
  EXPECT_NEAR(norm(run.points.back().p_WT_m - Vec3{0.01, std::sin(4.0), 0}), 0, 1e-15);
}

TEST(Track, aShortMovementIsShorterThanTheFilter) {
  // 2 ticks, 5 ticks, 12 ms: the kernel extends far beyond both ends
  for (const double duration : {0.001, 0.004, 0.012}) {
    const auto samples = gesture(1000, duration, [](double t, GestureSample& s) { setTip(s, {t, 0, 0}); });
    const auto run = runsOf(samples, 1000).front();
    EXPECT_NEAR(run.points.back().p_WT_m.x - run.points.front().p_WT_m.x, duration, 1e-12);
    EXPECT_NEAR(run.points.front().v_WT_mps.x, 1, 1e-9);
  }
}

TEST(Track, countsTheShareOfTimeInTissueExactly) {
  // inside from tick 123 on, of 0 … 400: the change is half-way between ticks 122 and 123
  const auto samples =
      gesture(1000, 0.4, [](double t, GestureSample& s) { setDepth(s, t > 0.1225 ? 0.01 : -0.01); });
  const auto run = runsOf(samples, 1000).front();
  double inside_s = 0;
  for (const double share : run.inside) inside_s += share * run.period_s;
  EXPECT_NEAR(inside_s, 0.4 - 0.1225, 1e-9);
  EXPECT_EQ(run.inside[11], 0);
  EXPECT_NEAR(run.inside[12], 0.75, 1e-9);
  EXPECT_NEAR(run.inside[13], 1, 1e-12);
}

TEST(Track, longGapsEndARunAndShortOnesDoNot) {
  auto samples = gesture(1000, 1, [](double t, GestureSample& s) { setTip(s, {t, 0, 0}); });
  samples.erase(samples.begin() + 300, samples.begin() + 399);  // 100 ms from tick 299 to 399: bridged
  EXPECT_EQ(runsOf(samples, 1000).size(), 1u);
  samples.erase(samples.begin() + 300);  // 101 ms
  const auto runs = runsOf(samples, 1000);
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_NEAR(runs[1].start_s, 0.4, 1e-12);
}

TEST(Track, gapsOfAnySizeCostNoMemory) {
  std::vector<GestureSample> samples = gesture(1000, 0.01, [](double, GestureSample&) {});
  samples.back().tick = std::numeric_limits<std::uint64_t>::max();
  const auto runs = runsOf(samples, 1000);
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[1].points.size(), 1u);
}

TEST(Cleaned, passesOverWhatCannotBeUsed) {
  auto samples = gesture(1000, 0.02, [](double t, GestureSample& s) { setTip(s, {t, 0, 0}); });
  ASSERT_EQ(samples.size(), 21u);
  samples[1].p_WT_m[2] = kNan;
  samples[2].p_WT_m[0] = 1e4;
  samples[3].q_WT[1] = kNan;
  samples[4].q_WT[0] = samples[4].q_WT[3] = 0;
  samples[5].force_W_N[1] = std::numeric_limits<double>::infinity();
  samples[6].insertion_m = kNan;
  samples[7].lateral_error_m = -std::numeric_limits<double>::infinity();
  samples[8].tick = samples[0].tick;   // back in time
  samples[10].tick = samples[9].tick;  // twice
  samples[11].wall_W_m[0] = kNan;      // allowed: no wall
  std::vector<GestureSample> storage;
  const auto kept = cleaned(samples, storage);
  EXPECT_EQ(kept.size(), 21u - 9);
  for (std::size_t i = 1; i < kept.size(); ++i) EXPECT_GT(kept[i].tick, kept[i - 1].tick);
}

TEST(Cleaned, copiesNothingWhenAllIsWell) {
  const auto samples = gesture(1000, 0.02, [](double t, GestureSample& s) { setTip(s, {t, 0, 0}); });
  std::vector<GestureSample> storage;
  EXPECT_EQ(cleaned(samples, storage).data(), samples.data());
  EXPECT_TRUE(storage.empty());
}

/// exp(−5 t²) over [−1, 1) at 100 Hz: the published example's speed profile.
std::vector<double> bell(double height = 1) {
  std::vector<double> speed;
  for (int i = 0; i < 200; ++i) speed.push_back(height * std::exp(-5 * std::pow(-1 + i / 100.0, 2)));
  return speed;
}

TEST(Smoothness, hasTheReferenceValues) {
  EXPECT_NEAR(*sparc(bell(), 100), -1.41403, 5e-6);
  EXPECT_NEAR(*ldlj(bell(), 100), -5.81636, 5e-6);
}

TEST(Smoothness, doesNotDependOnHowFastThePersonIs) {
  // ten times the speed: both measures are dimensionless
  EXPECT_NEAR(*sparc(bell(10), 100), *sparc(bell(), 100), 1e-12);
  EXPECT_NEAR(*ldlj(bell(10), 100), *ldlj(bell(), 100), 1e-12);
  // The same shape over twice the time: LDLJ does not change, SPARC's normalised width changes only slightly.
  EXPECT_NEAR(*ldlj(bell(), 50), *ldlj(bell(), 100), 1e-12);
}

TEST(Smoothness, twoMovementsAreLessSmoothThanOne) {
  std::vector<double> two = bell();
  const std::vector<double> again = bell();
  two.insert(two.end(), again.begin(), again.end());
  EXPECT_LT(*sparc(two, 100), *sparc(bell(), 100) - 0.1);
  EXPECT_LT(*ldlj(two, 100), *ldlj(bell(), 100) - 1);
}

TEST(Smoothness, sparcAgreesWithASpectrumSummedTermByTerm) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<double> speed(37);  // not a power of two
  for (double& v : speed) v = std::abs(normal(random));
  const std::size_t length = 64u << kSparcPadding;
  std::vector<double> amplitude;
  for (std::size_t k = 0; static_cast<double>(k) * 100 / static_cast<double>(length) <= kSparcCutoffHz; ++k) {
    double re = 0, im = 0;
    for (std::size_t n = 0; n < speed.size(); ++n) {
      const double angle = 2 * std::numbers::pi * static_cast<double>(k * n) / static_cast<double>(length);
      re += speed[n] * std::cos(angle);
      im -= speed[n] * std::sin(angle);
    }
    amplitude.push_back(std::hypot(re, im));
  }
  const double top = *std::max_element(amplitude.begin(), amplitude.end());
  std::size_t first = 0, last = amplitude.size() - 1;
  while (amplitude[first] < kSparcThreshold * top) ++first;
  while (amplitude[last] < kSparcThreshold * top) --last;
  double arc = 0;
  for (std::size_t i = first; i < last; ++i) {
    arc -= std::hypot(1.0 / static_cast<double>(last - first), (amplitude[i + 1] - amplitude[i]) / top);
  }
  EXPECT_NEAR(*sparc(speed, 100), arc, 1e-10);
}

TEST(Smoothness, saysNothingWithoutMovement) {
  const std::vector<double> rest(100, 0.0), two(2, 1.0), constant(100, 1.0);
  for (const auto& speed : {std::vector<double>{}, rest, two}) {
    EXPECT_FALSE(sparc(speed, 100).has_value());
    EXPECT_FALSE(ldlj(speed, 100).has_value());
  }
  EXPECT_FALSE(ldlj(constant, 100).has_value()) << "no jerk at all has no logarithm";
  EXPECT_TRUE(sparc(constant, 100).has_value());
  EXPECT_FALSE(sparc(std::vector<double>(kLongestProfile + 1, 1.0), 100).has_value());
}

// SPARC of a gesture is computed per movement, so that the rests between movements do not count.

/// Strokes of 20 mm in 2 s each, with `rest_s` before, between and after them, starting 5 mm deep.
double sparcOfStrokes(int strokes, double rest_s) {
  const double stroke_s = 2, each_s = stroke_s + rest_s;
  const auto samples = gesture(1000, strokes * each_s + rest_s, [&](double t, GestureSample& s) {
    double way = 0;
    for (int k = 0; k < strokes; ++k) way += ease(t - rest_s - k * each_s, stroke_s);
    setDepth(s, 0.005 + 0.02 * way);
  });
  return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "sparc");
}

TEST(Sparc, restsBetweenSmoothStrokesDoNotCount) {
  const double one = sparcOfStrokes(1, 0.5);
  // over the whole stretch it fell from -2.25 to -5.50 with the length of the rest
  for (const double rest_s : {0.5, 1.0, 2.0, 5.0})
    for (const int strokes : {1, 2, 3})
      EXPECT_NEAR(sparcOfStrokes(strokes, rest_s), one, 0.01 * std::abs(one)) << strokes << ", " << rest_s;
}

TEST(Sparc, isThatOfTheStrokesOwnSpeed) {
  // minimum jerk: v = 30 s² (1 − s)² × distance / time
  std::vector<double> speed_mps;
  for (int i = 0; i <= 200; ++i) {
    const double s = i / 200.0;
    speed_mps.push_back(0.02 / 2 * 30 * s * s * (1 - s) * (1 - s));
  }
  EXPECT_NEAR(sparcOfStrokes(2, 1), *sparc(speed_mps, 100), 0.05);
}

TEST(Sparc, isTheMeanOfTheMovementsByTheirWays) {
  struct Stroke {
    double way_m, shake_m;  // in 2 s, at 2 Hz; it never reverses
  };
  const auto of = [](const std::vector<Stroke>& strokes) {
    const double duration_s = 1 + 3 * static_cast<double>(strokes.size());
    const auto samples = gesture(1000, duration_s, [&](double t, GestureSample& s) {
      double depth_m = 0.005, start_s = 1;
      for (const Stroke& stroke : strokes) {
        const double since_s = t - start_s;
        const double bell = since_s > 0 && since_s < 2 ? std::sin(std::numbers::pi * since_s / 2) : 0.0;
        depth_m += stroke.way_m * ease(since_s, 2) +
                   stroke.shake_m * std::sin(4 * std::numbers::pi * since_s) * bell * bell;
        start_s += 3;
      }
      setDepth(s, depth_m);
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "sparc");
  };
  const Stroke smooth{0.01, 0}, rough{0.02, 7e-4};
  const double smooth_alone = of({smooth}), rough_alone = of({rough});
  EXPECT_LT(rough_alone, smooth_alone - 0.02);
  const double mean = (smooth_alone + 2 * rough_alone) / 3;
  EXPECT_NEAR(of({smooth, rough}), mean, 0.1 * (smooth_alone - rough_alone));
  EXPECT_NEAR(of({rough, smooth}), mean, 0.1 * (smooth_alone - rough_alone));
}

TEST(Sparc, movementsOutsideCountOnlyWhereNoneReachesIntoTissue) {
  const auto of = [](double depth_m) {
    const auto samples = gesture(1000, 8, [&](double t, GestureSample& s) {
      // sideways with a tremor, then straight down
      const double aside = t < 3 ? 2e-3 * std::sin(4 * std::numbers::pi * t) : 0.0;
      setDepth(s, depth_m + 0.02 * ease(t - 5, 2));
      setTip(s, {0.02 * ease(t, 3) + aside, 0, s.p_WT_m[2]});
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "sparc");
  };
  const double smooth = sparcOfStrokes(1, 1);
  EXPECT_NEAR(of(-0.01), smooth, 0.02 * std::abs(smooth)) << "the second goes in, through the surface: whole";
  EXPECT_LT(of(-0.05), smooth - 0.1) << "neither goes in";
}

TEST(Sparc, aGestureTooSlowForAnyMovementIsOne) {
  // 2 mm/s: below the speed at which a movement begins
  const auto samples = gesture(1000, 8, [](double t, GestureSample& s) { setDepth(s, 0.001 + 0.002 * t); });
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_EQ(valueOf(score, "translational_actions"), 0);
  EXPECT_TRUE(find(score, "sparc") != nullptr);
  EXPECT_EQ(find(scoreGesture(gesture(1000, 2, [](double, GestureSample& s) { setDepth(s, 0.01); }), 1000,
                              halfSpace(), {}),
                 "sparc"),
            nullptr)
      << "at rest there is no movement at all";
}

}  // namespace
}  // namespace needlelab
