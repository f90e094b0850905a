/// Misses of a volume's targets, and whether a needle reaches them: against a ball of layers, and by formula.
#include <gmock/gmock.h>

#include <cmath>
#include <string>

#include "common/haptics/scene_model.h"
#include "common/scoring/targets/miss.h"
#include "common/scoring/targets/reachable.h"
#include "tests/support/anatomy/ball_profiles.h"
#include "tests/support/random.h"

namespace needlelab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

const Pose kBallPlaced{{0.3, -0.1, 0.2}, normalized(Quat{0.1, -0.4, 0.2, 0.8})};

Miss missInBall(const pb::Profile& profile, Vec3 p_L_m) {
  const Vec3 axis_W = rotate(kBallPlaced.q, {0, 0, -1});
  return missAt(anatomyOf(profile, kBallPlaced), profile.directions(), kBallPlaced,
                {kBallPlaced * p_L_m - 0.05 * axis_W, axis_W, 0.05});
}

TEST(VolumeMiss, ofABallIsThatInTheBallOfLayers) {
  for (const bool in_tissue : {false, true}) {
    nlohmann::json of_layers = test::ballOfLayers(), of_rules = test::ballOfRules();
    if (in_tissue) of_layers["targets"][0]["tissues"] = of_rules["targets"][0]["tissues"] = {"muscle"};
    const pb::Profile like = test::readProfile(of_layers), profile = test::readProfile(of_rules);
    test::Random random(3);
    int missed = 0;
    for (int i = 0; i < 300; ++i) {
      const double x = random.in(-0.01, 0.015), y = random.in(-0.01, 0.01), z = random.in(-0.03, 0);
      const Miss expected = missInBall(like, {x, y, z}), found = missInBall(profile, {x, y, z});
      EXPECT_EQ(found.in_target, expected.in_target);
      EXPECT_NEAR(found.aside_m, expected.aside_m, 2e-6);
      EXPECT_NEAR(found.too_deep_m, expected.too_deep_m, 5e-5);
      EXPECT_EQ(found.towards, expected.towards);
      missed += expected.in_target ? 0 : 1;
    }
    EXPECT_GT(missed, 250);
  }
}

TEST(VolumeMiss, ofALayerIsADepth) {
  nlohmann::json tree = test::ballOfRules();
  tree["targets"] = nlohmann::json::parse(R"([{"name": "the fat", "structure": "fat"}])");
  const pb::Profile profile = test::readProfile(tree);
  EXPECT_EQ(missText(missInBall(profile, {0, 0, -0.012})), "Missed: 3.0 mm too deep.");
  EXPECT_EQ(missText(missInBall(profile, {0, 0, -0.001})), "Missed: 2.0 mm too shallow.");
  EXPECT_EQ(missText(missInBall(profile, {0, 0, -0.005})), "In the target.");
}

TEST(VolumeMiss, ofAStructureIsAlongTheNeedleAndAcrossIt) {
  const pb::Profile profile = test::readProfile(test::withCyst());
  test::Random random(4);
  for (int i = 0; i < 300; ++i) {
    const double x = random.in(-0.01, 0.01), y = random.in(-0.01, 0.01), z = random.in(-0.03, -0.005);
    const Vec3 from_cyst = Vec3{x, y, z} - test::kCyst_m;
    const double across_m = std::hypot(from_cyst.x, from_cyst.y);
    if (across_m < test::kCystRadius_m + 1e-5) continue;
    const Miss miss = missInBall(profile, {x, y, z});
    EXPECT_NEAR(miss.too_deep_m, -from_cyst.z, 5e-5);
    EXPECT_NEAR(miss.aside_m, across_m - test::kCystRadius_m, 1e-6);
  }
  EXPECT_THAT(missInBall(profile, test::kCyst_m + Vec3{0.01, 0, 0}).towards, ElementsAre("down the arm"));
}

TEST(VolumeTargets, areReachableAsInTheBallOfLayers) {
  const auto sentencesOf = [](nlohmann::json tree, double needle_m) {
    return unreachableTargets(test::readProfile(tree), needle_m);
  };
  nlohmann::json of_layers = test::ballOfLayers(), of_rules = test::ballOfRules();
  EXPECT_THAT(sentencesOf(of_rules, 0.06), IsEmpty());
  EXPECT_EQ(sentencesOf(of_rules, 0.01), sentencesOf(of_layers, 0.01));
  EXPECT_EQ(sentencesOf(of_rules, 0.01).size(), 1U) << "deeper than the needle is long";
  for (nlohmann::json* tree : {&of_layers, &of_rules}) (*tree)["targets"][0]["center_m"]["z"] = 0.02;
  EXPECT_EQ(sentencesOf(of_rules, 0.06), sentencesOf(of_layers, 0.06));
  EXPECT_THAT(sentencesOf(of_rules, 0.06), ElementsAre("targets[0]: 'target' lies outside the body"));
}

TEST(VolumeTargets, behindBoneAreNotReachable) {
  nlohmann::json tree = test::withCyst();
  // a plate of bone between skin and cyst
  tree["volume"]["groups"].push_back(nlohmann::json::parse(
      R"({"id": "plate", "parts": [{"ellipsoid": {"center_m": {"x": 0.001, "y": -0.0015, "z": -0.0125},
          "radii_m": {"x": 0.01, "y": 0.01, "z": 0.0015}}}]})"));
  tree["volume"]["structures"].push_back({{"id", "bone"}, {"layer", test::ballLayer("BONE", 0.3)}});
  auto& rules = tree["volume"]["rules"];
  rules.insert(rules.begin(), nlohmann::json{{"group", "plate"}, {"to_m", 0}, {"structure", "bone"}});
  const auto sentences = unreachableTargets(test::readProfile(tree), 0.06);
  ASSERT_EQ(sentences.size(), 1U);
  const std::string words = "targets[0]: 'the cyst' lies in bone, which begins ";
  ASSERT_THAT(sentences[0], ::testing::StartsWith(words));
  // where the line from the ball's middle through the cyst's leaves the plate: |(t d − c)/r|² = 1, the outer
  // root
  const Vec3 middle{0, 0, -test::kBallRadius_m}, d = normalized(test::kCyst_m - middle);
  const Vec3 c = Vec3{0.001, -0.0015, -0.0125} - middle;
  const auto scaled = [](Vec3 v) { return Vec3{v.x / 0.01, v.y / 0.01, v.z / 0.0015}; };
  const double dd = normSquared(scaled(d)), dc = dot(scaled(d), scaled(c)), cc = normSquared(scaled(c));
  const double t = (dc + std::sqrt(dc * dc - dd * (cc - 1))) / dd;
  EXPECT_NEAR(std::stod(sentences[0].substr(words.size())), 1e3 * (test::kBallRadius_m - t), 0.1);
}

TEST(VolumeTargets, ofWhichNothingIsLeftAreNamed) {
  nlohmann::json tree = test::withCyst();
  auto& rules = tree["volume"]["rules"];
  rules.insert(rules.begin(), nlohmann::json{{"group", "cyst"}, {"to_m", 0.001}, {"structure", "muscle"}});
  EXPECT_THAT(unreachableTargets(test::readProfile(tree), 0.06),
              ElementsAre("targets[0]: 'the cyst' is a structure of which nothing is left: look at the rules "
                          "before its own"));
}

}  // namespace
}  // namespace needlelab
