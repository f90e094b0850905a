#include "common/scoring/anatomy.h"

#include <gtest/gtest.h>

#include <random>

namespace needlelab {
namespace {

TEST(SegmentDistance, agreesWithASearch) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto point = [&] { return Vec3{uniform(random), uniform(random), uniform(random)}; };
  for (int round = 0; round < 300; ++round) {
    const Vec3 p = point(), a = point();
    Vec3 q = point(), b = point();
    // points, parallel and crossing segments among them
    if (round % 5 == 1) q = p;
    if (round % 5 == 2) b = a;
    if (round % 5 == 3) b = a + (q - p) * 0.7;
    if (round % 50 == 4) q = p, b = a;
    double best = 1e9;
    constexpr int kSteps = 200;
    for (int i = 0; i <= kSteps; ++i) {
      const Vec3 s = p + (q - p) * (i / double{kSteps});
      // exact on the second segment
      const double length = normSquared(b - a);
      const double t = length > 0 ? std::min(1.0, std::max(0.0, dot(s - a, b - a) / length)) : 0;
      best = std::min(best, norm(s - a - t * (b - a)));
    }
    const double found = segmentDistance(p, q, a, b);
    EXPECT_LE(found, best + 1e-12);
    EXPECT_GE(found, best - norm(q - p) / kSteps);
    EXPECT_NEAR(found, segmentDistance(a, b, p, q), 1e-9) << "of one to the other as of the other to the one";
  }
}

TEST(SegmentDistance, ofKnownCases) {
  EXPECT_DOUBLE_EQ(segmentDistance({0, 0, 0}, {1, 0, 0}, {0.5, -1, 0.25}, {0.5, 1, 0.25}), 0.25);
  EXPECT_DOUBLE_EQ(segmentDistance({0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}), 1);
  EXPECT_DOUBLE_EQ(segmentDistance({0, 0, 0}, {1, 0, 0}, {0.2, 3, 0}, {0.9, 3, 0}), 3);
  EXPECT_DOUBLE_EQ(segmentDistance({0, 0, 0}, {0, 0, 0}, {3, 4, 0}, {3, 4, 0}), 5);
}

}  // namespace
}  // namespace needlelab
