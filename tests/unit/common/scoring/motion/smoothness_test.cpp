// SPARC of a gesture: computed per movement, so that the rests between movements do not count.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/scoring/motion/track.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

/// Strokes of 20 mm in 2 s each, with `rest_s` before, between and after them, starting 5 mm deep; `shake_m`
/// at 2 Hz during the movement.
double sparcOfStrokes(int strokes, double rest_s, double shake_m = 0) {
  const double stroke_s = 2, each_s = stroke_s + rest_s;
  const auto samples = gesture(1000, strokes * each_s + rest_s, [&](double t, GestureSample& s) {
    double way = 0;
    for (int k = 0; k < strokes; ++k) {
      const double since_s = t - rest_s - k * each_s;
      way += ease(since_s, stroke_s);
      if (since_s > 0 && since_s < stroke_s)
        way += shake_m / 0.02 * std::sin(4 * std::numbers::pi * since_s) *
               std::pow(std::sin(std::numbers::pi * since_s / stroke_s), 2);
    }
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

TEST(Sparc, aStrokeInPiecesIsLessSmooth) {
  EXPECT_LT(sparcOfStrokes(1, 1, 1e-3), sparcOfStrokes(1, 1) - 0.1);
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
