#include "common/scoring/anatomy/anatomy.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

TEST(SegmentDistance, agreesWithASearch) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto point = [&] { return Vec3{uniform(random), uniform(random), uniform(random)}; };
  for (int round = 0; round < 300; ++round) {
    const Vec3 p = point(), a = point();
    Vec3 q = point(), b = point();
    // including points, and parallel and crossing segments
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

/// Layers of 3, 2 and 30 mm under a ball, a rod or a plane of skin; a target of 6 mm across the second.
pb::Profile thinTissue(int limb) {
  pb::Profile profile;
  if (limb == 0) profile.mutable_limb()->mutable_plane()->mutable_normal()->set_z(1);
  if (limb == 1) {
    auto& ball = *profile.mutable_limb()->mutable_sphere();
    ball.mutable_center_m()->set_z(-0.05);
    ball.set_radius_m(0.05);
  }
  if (limb == 2) {
    auto& rod = *profile.mutable_limb()->mutable_capsule();
    rod.mutable_a_m()->set_x(-0.1);
    rod.mutable_b_m()->set_x(0.1);
    rod.mutable_a_m()->set_z(-0.04);
    rod.mutable_b_m()->set_z(-0.04);
    rod.set_radius_m(0.04);
  }
  for (const auto& [tissue, thickness_m] :
       {std::pair(pb::Layer::SKIN, 0.003), {pb::Layer::BURSA, 0.002}, {pb::Layer::TENDON, 0.03}}) {
    auto& layer = *profile.add_layers();
    layer.set_tissue(tissue);
    layer.set_thickness_m(thickness_m);
  }
  addTarget(profile, {0, 0, -0.004}, 0.006);
  profile.mutable_targets(0)->add_tissues("bursa");
  return profile;
}

/// Depth under the skin of `thinTissue`, by its formula.
double depthBy(int limb, Vec3 p) {
  if (limb == 0) return -p.z;
  if (limb == 1) return 0.05 - std::sqrt(p.x * p.x + p.y * p.y + (p.z + 0.05) * (p.z + 0.05));
  return 0.04 - std::sqrt(p.y * p.y + (p.z + 0.04) * (p.z + 0.04));
}

TEST(Anatomy, aTargetIsWhereTheBallAndItsTissueAre) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> uniform(-0.008, 0.008);
  for (const int limb : {0, 1, 2}) {
    const Anatomy anatomy = anatomyOf(thinTissue(limb), {});
    std::vector<Vec3> in;
    int layers[3] = {}, outside = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vec3 p{uniform(random), uniform(random), uniform(random) - 0.004};
      const double depth_m = depthBy(limb, p);
      const int layer = depth_m <= 0 ? -1 : depth_m < 0.003 ? 0 : depth_m < 0.005 ? 1 : 2;
      ASSERT_EQ(layerAt(anatomy, p), layer);
      ++(layer < 0 ? outside : layers[layer]);
      const bool is_in = layer == 1 && norm(p - Vec3{0, 0, -0.004}) <= 0.006;
      ASSERT_EQ(distanceTo(anatomy, anatomy.targets[0], p) <= 0, is_in) << depth_m;
      if (is_in) in.push_back(p);
    }
    EXPECT_GT(std::min({outside, layers[0], layers[1], layers[2]}), 1000);
    ASSERT_GT(in.size(), 1000u);
    // no part of the target is nearer than reported
    for (int i = 0; i < 50; ++i) {
      const Vec3 p{uniform(random), uniform(random), uniform(random) - 0.004};
      const double min_m = distanceTo(anatomy, anatomy.targets[0], p);
      for (const Vec3 other : in) ASSERT_GE(norm(other - p), min_m - 1e-12);
    }
  }
}

TEST(Anatomy, aTargetWithoutTissuesIsTheBall) {
  pb::Profile profile = thinTissue(0);
  profile.mutable_targets(0)->clear_tissues();
  const Anatomy anatomy = anatomyOf(profile, {});
  EXPECT_NEAR(distanceTo(anatomy, anatomy.targets[0], {0, 0, -0.009}), -0.001, 1e-15);
  EXPECT_NEAR(depthSpanOf(anatomy, anatomy.targets[0]).top_m, -0.002, 1e-15);
  EXPECT_NEAR(depthSpanOf(anatomy, anatomy.targets[0]).bottom_m, 0.01, 1e-15);
}

TEST(Anatomy, aTargetMayHaveSeveralTissuesAndTheLastLayerHasNoEnd) {
  pb::Profile profile = thinTissue(0);
  profile.mutable_targets(0)->set_radius_m(0.05);
  profile.mutable_targets(0)->set_tissues(0, "tendon");
  profile.mutable_targets(0)->add_tissues("skin");
  const Anatomy anatomy = anatomyOf(profile, {});
  const auto distanceAt = [&](double depth_m) {
    return distanceTo(anatomy, anatomy.targets[0], {0, 0, -depth_m});
  };
  EXPECT_NEAR(distanceAt(0.002), -0.001, 1e-15);
  EXPECT_NEAR(distanceAt(0.004), 0.001, 1e-15) << "the bursa between them is not named";
  EXPECT_NEAR(distanceAt(0.045), -0.009, 1e-15) << "under the last boundary; the ball ends at 54 mm";
  EXPECT_NEAR(depthSpanOf(anatomy, anatomy.targets[0]).top_m, 0, 1e-15);
  EXPECT_NEAR(depthSpanOf(anatomy, anatomy.targets[0]).bottom_m, 0.054, 1e-15);
}

}  // namespace
}  // namespace needlelab
