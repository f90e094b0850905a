/// Which tissue is where in a volume, its targets and hazards: against a ball of layers, and by formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>

#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/profile/profile.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/bone_contacts.h"
#include "tests/support/anatomy/ball_profiles.h"
#include "tests/support/random.h"

namespace needlelab {
namespace {

using test::kBallRadius_m;
using test::kCyst_m;
using test::kCystRadius_m;
using test::kFatEnd_m;
using test::kSkinEnd_m;

const Pose kVolumeInW{{0.3, -0.1, 0.2}, normalized(Quat{0.1, -0.4, 0.2, 0.8})};

/// A point in or near the ball, in W.
Vec3 pointNearBall(test::Random& random) {
  const double x = random.in(-0.03, 0.03), y = random.in(-0.03, 0.03), z = random.in(-0.045, 0.005);
  return kVolumeInW * Vec3{x, y, z};
}

double depthInBall(Vec3 p_W_m) {
  return kBallRadius_m - norm(p_W_m - kVolumeInW * Vec3{0, 0, -kBallRadius_m});
}

// Against rays in 2,000 directions, 2.5 degrees apart, until they leave the body. Controls: the field's own
// number is only a lower bound, and the way up its slope ends elsewhere.
TEST(VolumeAnatomy, depthIsTheDistanceToTheNearestSkin) {
  constexpr int kRays = 2000;
  test::Random random(77);
  int too_low = 0, too_far = 0;
  for (const std::string region : {"shoulder", "knee", "wrist", "lumbar"})
    for (const std::string build : {"slender", "median", "heavy"}) {
      const std::string name = region + "-" + build;
      const auto profile =
          loadProfile(std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "db/samples/volumes" / (name + ".json"));
      ASSERT_TRUE(profile.ok()) << profile.error().message;
      const Anatomy anatomy = anatomyOf(*profile, kVolumeInW);
      for (int point = 0; point < 8;) {
        const Vec3 at =
            kVolumeInW * Vec3{random.in(-0.03, 0.03), random.in(-0.03, 0.03), random.in(-0.07, 0)};
        if (!isUnderSkin(anatomy, at)) continue;
        ++point;
        double nearest_m = 1;
        for (int i = 0; i < kRays; ++i) {
          const double z = 1 - (2 * i + 1) / static_cast<double>(kRays), r = std::sqrt(1 - z * z),
                       angle = 2.399963 * i;
          const Vec3 way{r * std::cos(angle), r * std::sin(angle), z};
          double along_m = 0;
          for (double depth_m = 1; depth_m > 0 && along_m < nearest_m; along_m += std::max(depth_m, 1e-5))
            depth_m = signedDepth(anatomy.limb, at + way * along_m) / 1.12;
          nearest_m = std::min(nearest_m, along_m);
        }
        EXPECT_NEAR(depthAt(anatomy, at), nearest_m, 1e-4) << name << ", point " << point;
        const Vec3 skin = closestSkin(anatomy.limb, at, {0, 0, -1});
        EXPECT_NEAR(signedDepth(anatomy.limb, skin), 0, 1e-8) << name << ", point " << point;
        EXPECT_LT(norm(at - skin), nearest_m + 3e-4) << name << ", point " << point;
        too_low += signedDepth(anatomy.limb, at) < nearest_m - 1e-3;
        too_far += norm(at - nearestSkin(anatomy.limb, at, {0, 0, -1})) > nearest_m + 1e-3;
      }
    }
  EXPECT_GT(too_low, 5);
  EXPECT_GT(too_far, 5);
}

TEST(VolumeAnatomy, ofShellsAnswersAsTheBallOfLayers) {
  for (const bool only_muscle : {false, true}) {
    nlohmann::json of_layers = test::ballOfLayers(), of_rules = test::ballOfRules();
    if (only_muscle) of_layers["targets"][0]["tissues"] = of_rules["targets"][0]["tissues"] = {"muscle"};
    const Anatomy ball = anatomyOf(test::readProfile(of_layers), kVolumeInW);
    const Anatomy volume = anatomyOf(test::readProfile(of_rules), kVolumeInW);
    ASSERT_EQ(volume.targets.size(), 1U);
    ASSERT_EQ(volume.hazards.size(), 1U);
    test::Random random(5);
    std::array<int, 4> seen{};
    for (int i = 0; i < 3000; ++i) {
      const Vec3 p = pointNearBall(random), q = pointNearBall(random);
      EXPECT_NEAR(depthAt(volume, p), depthAt(ball, p), 2e-9);
      EXPECT_EQ(layerAt(volume, p), layerAt(ball, p)) << depthAt(ball, p);
      ++seen[static_cast<std::size_t>(layerAt(volume, p) + 1)];
      const double found_m = distanceTo(volume, volume.targets[0], p),
                   expected_m = distanceTo(ball, ball.targets[0], p);
      EXPECT_EQ(found_m <= 0, expected_m <= 0) << expected_m;
      if (!only_muscle) EXPECT_NEAR(found_m, expected_m, 1e-12);
      EXPECT_NEAR(distanceTo(volume.hazards[0], p, q), distanceTo(ball.hazards[0], p, q), 1e-12);
    }
    EXPECT_GT(*std::min_element(seen.begin(), seen.end()), 50) << "all layers, and outside";
    const DepthSpan expected = depthSpanOf(ball, ball.targets[0]),
                    span = depthSpanOf(volume, volume.targets[0]);
    EXPECT_NEAR(span.top_m, expected.top_m, 1e-6);
    EXPECT_NEAR(span.bottom_m, expected.bottom_m, 1e-6);
    const Vec3 entry = kVolumeInW * Vec3{};
    for (const double behind_m : {0.0, 0.002, 0.02})
      EXPECT_NEAR(norm(tipForTarget(volume, volume.targets[0], behind_m, entry) -
                       tipForTarget(ball, ball.targets[0], behind_m, entry)),
                  0, 1e-6);
  }
}

// an oblique way goes through another part of a target than the one straight in
TEST(VolumeAnatomy, aTipLiesOnTheLineFromItsEntryThroughTheTargetsCentre) {
  for (const char* region : {"shoulder", "wrist", "knee", "lumbar"}) {
    const auto profile = loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / "volumes" /
                                     (std::string(region) + "-median.json"));
    ASSERT_TRUE(profile.ok()) << profile.error().message;
    const Anatomy anatomy = anatomyOf(*profile, {});
    const Vec3 center = anatomy.targets.at(0).ball.a_W_m;
    for (const double behind_m : {0.0, 0.001}) {
      const Vec3 tip = tipForTarget(anatomy, anatomy.targets.at(0), behind_m, Vec3{});
      EXPECT_LT(norm(cross(normalized(tip), normalized(center))), 1e-6) << region;
      EXPECT_LE(distanceTo(anatomy, anatomy.targets.at(0), tip), 0) << region;
    }
  }
}

TEST(VolumeAnatomy, aTargetOfTheMuscleEndsWhereTheFatDoes) {
  nlohmann::json tree = test::ballOfRules();
  tree["targets"][0]["center_m"] = {{"x", 0}, {"y", 0}, {"z", -0.01}};
  tree["targets"][0]["tissues"] = {"muscle"};
  const Anatomy volume = anatomyOf(test::readProfile(tree), kVolumeInW);
  const DepthSpan span = depthSpanOf(volume, volume.targets[0]);
  EXPECT_NEAR(span.top_m, kFatEnd_m, 1e-6);
  EXPECT_NEAR(span.bottom_m, 0.013, 1e-12);
}

TEST(VolumeAnatomy, theDistanceFromALayerIsThatOfItsDepths) {
  nlohmann::json tree = test::ballOfRules();
  tree["targets"] = nlohmann::json::parse(R"([{"name": "the fat", "structure": "fat"}])");
  const Anatomy volume = anatomyOf(test::readProfile(tree), kVolumeInW);
  test::Random random(6);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = pointNearBall(random);
    const double depth_m = depthInBall(p);
    EXPECT_NEAR(distanceTo(volume, volume.targets[0], p), std::max(kSkinEnd_m - depth_m, depth_m - kFatEnd_m),
                1e-12);
  }
  // the point well inside is in its middle
  const Region& fat = volume.targets[0].ball;
  EXPECT_NEAR(depthInBall(fat.a_W_m), 0.5 * (kSkinEnd_m + kFatEnd_m), 2e-4);
  EXPECT_NEAR(fat.radius_m, 0.5 * (kFatEnd_m - kSkinEnd_m), 2e-4);
  const DepthSpan span = depthSpanOf(volume, volume.targets[0]);
  EXPECT_NEAR(span.top_m, kSkinEnd_m, 1e-6);
  EXPECT_NEAR(span.bottom_m, kFatEnd_m, 1e-6);
}

TEST(VolumeAnatomy, aBallsDeepestPointIsItsCentre) {
  const Anatomy volume = anatomyOf(test::readProfile(test::withCyst()), kVolumeInW);
  for (const Region* region : {&volume.targets[0].ball, &volume.hazards[0]}) {
    EXPECT_LT(norm(region->a_W_m - kVolumeInW * kCyst_m), 0.06 * kCystRadius_m + 1e-4);
    EXPECT_EQ(region->a_W_m, region->b_W_m);
    EXPECT_NEAR(region->radius_m, kCystRadius_m, 0.06 * kCystRadius_m + 1e-4);
  }
  const Anatomy again = anatomyOf(test::readProfile(test::withCyst()), kVolumeInW);
  EXPECT_EQ(again.hazards[0].a_W_m, volume.hazards[0].a_W_m) << "the same bits";
}

TEST(VolumeAnatomy, anAuthorsPointIsTheCentreOfItsStructure) {
  nlohmann::json tree = test::withCyst();
  tree["targets"][0]["center_m"] = {{"x", 0.003}, {"y", -0.003}, {"z", -0.02}};  // 1 mm beside its middle
  const Anatomy volume = anatomyOf(test::readProfile(tree), kVolumeInW);
  const Region& cyst = volume.targets[0].ball;
  EXPECT_NEAR(norm(cyst.a_W_m - kVolumeInW * Vec3{0.003, -0.003, -0.02}), 0, 1e-15);
  EXPECT_NEAR(cyst.radius_m, kCystRadius_m - 1e-3, 1e-12);
  EXPECT_NEAR(distanceTo(volume, volume.targets[0], kVolumeInW * kCyst_m), -kCystRadius_m, 1e-12)
      << "its surface is what counts";
}

TEST(VolumeAnatomy, aShaftTouchesAStructureThatItCrosses) {
  const Anatomy volume = anatomyOf(test::readProfile(test::withCyst()), kVolumeInW);
  test::Random random(7);
  const Vec3 center = kVolumeInW * kCyst_m;
  int touching = 0, beside = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vec3 tip = pointNearBall(random), skin = pointNearBall(random);
    const double expected_m = segmentDistance(tip, skin, center, center) - kCystRadius_m;
    if (std::abs(expected_m) < 1e-5) continue;  // steps of 0.1 mm along the shaft
    const double found_m = distanceTo(volume.hazards[0], tip, skin);
    ASSERT_EQ(found_m <= 0, expected_m < 0) << expected_m;
    ++(expected_m < 0 ? touching : beside);
    if (expected_m > 0) EXPECT_NEAR(found_m, expected_m, 1e-5 + 0.2 * expected_m);
  }
  EXPECT_GT(touching, 100);
  EXPECT_GT(beside, 100);
}

TEST(VolumeAnatomy, structuresAndHazardsOfBoneAreBone) {
  nlohmann::json tree = test::withCyst();
  tree["volume"]["structures"][2]["layer"]["tissue"] = "BONE";
  tree["hazards"][0]["kind"] = "BONE";
  const pb::Profile profile = test::readProfile(tree);
  const Anatomy volume = anatomyOf(profile, kVolumeInW);
  const BoneContacts bones(profile, volume);
  const Vec3 beside = kVolumeInW * Vec3{0.02, 0, -0.02};
  EXPECT_TRUE(bones.isIn(2, beside)) << "the muscle, by its index";
  EXPECT_FALSE(bones.isIn(1, beside));
  EXPECT_TRUE(bones.isIn(1, kVolumeInW * kCyst_m)) << "the hazard, by its place";
  EXPECT_FALSE(bones.isIn(-1, kVolumeInW * kCyst_m)) << "outside";
}

TEST(VolumeAnatomy, aStructureOfWhichNothingIsLeftIsNowhere) {
  nlohmann::json tree = test::withCyst();
  auto& rules = tree["volume"]["rules"];
  rules.insert(rules.begin(), nlohmann::json{{"group", "cyst"}, {"to_m", 0.001}, {"structure", "muscle"}});
  const Anatomy volume = anatomyOf(test::readProfile(tree), kVolumeInW);
  EXPECT_EQ(volume.targets[0].ball.radius_m, 0);
  EXPECT_GT(distanceTo(volume, volume.targets[0], kVolumeInW * kCyst_m), 0);
}

}  // namespace
}  // namespace needlelab
