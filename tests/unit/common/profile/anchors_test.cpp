#include "common/profile/anchors.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/profile/profile.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

constexpr double kLength_m = 0.1;

/// Skin 3 mm and muscle 20 mm under a plane, a ball or a rod; the plane's normal has length 2.
nlohmann::json profileUnder(int limb) {
  nlohmann::json profile = nlohmann::json::parse(kGoodProfile);
  if (limb == 0) profile["limb"]["plane"]["normal"]["z"] = 2;
  if (limb == 1)
    profile["limb"] = {{"sphere", {{"center_m", {{"x", 0}, {"y", 0}, {"z", -0.06}}}, {"radius_m", 0.06}}}};
  if (limb == 2)
    profile["limb"] = {{"capsule",
                        {{"a_m", {{"x", -kLength_m}, {"y", 0}, {"z", -0.05}}},
                         {"b_m", {{"x", kLength_m}, {"y", 0}, {"z", -0.05}}},
                         {"radius_m", 0.05}}}};
  return profile;
}

nlohmann::json anchor(const std::string& layer, double offset_m) {
  return {{"layer", layer}, {"offset_m", offset_m}};
}

pb::Profile read(const nlohmann::json& profile) {
  auto made = parseProfile(profile.dump(), "p.json");
  EXPECT_TRUE(made.ok()) << (made.ok() ? "" : made.error().message);
  return made.ok() ? *std::move(made) : pb::Profile();
}

double depthBy(int limb, double y, double z) {
  if (limb == 0) return -z;
  return limb == 1 ? 0.06 - std::hypot(y, z + 0.06) : 0.05 - std::hypot(y, z + 0.05);
}

Vec3 targetOf(const nlohmann::json& json) {
  const pb::Profile profile = read(json);
  const pb::Vector3& c = profile.targets(0).center_m();
  return Vec3{c.x(), c.y(), c.z()} + AnchoredPlaces(profile).wayOf(profile.targets(0));
}

TEST(Anchors, placeTheCentreUnderTheTopOfTheLayer) {
  for (const int limb : {0, 1, 2}) {
    nlohmann::json profile = profileUnder(limb);
    profile["layers"][0]["thickness_m"] = 0.011;
    profile["targets"][0]["center_m"]["y"] = 0.012;
    profile["targets"][0]["anchor"] = anchor("muscle", 0.004);
    const Vec3 p = targetOf(profile);
    EXPECT_NEAR(depthBy(limb, p.y, p.z), 0.015, 1e-12);
    // along the normal: on the line through the limb's centre and the old place
    const double middle_z = limb == 1 ? -0.06 : -0.05;
    if (limb == 0)
      EXPECT_EQ(p.y, 0.012);
    else
      EXPECT_NEAR(p.y * (-0.03 - middle_z), 0.012 * (p.z - middle_z), 1e-15);
  }
}

TEST(Anchors, goOnBeyondTheMiddleOfALimb) {
  // the ball's centre is 57 mm under the muscle's top; with 17 mm more skin it is 77 mm under the skin
  nlohmann::json profile = profileUnder(1);
  profile["targets"][0]["center_m"]["z"] = -0.06;
  profile["targets"][0]["anchor"] = anchor("muscle", 0.057);
  EXPECT_EQ(targetOf(profile).z, -0.06);
  profile["layers"][0]["thickness_m"] = 0.020;
  EXPECT_NEAR(targetOf(profile).z, -0.077, 1e-15);
}

TEST(Anchors, moveASegmentByItsMiddleAndKeepItsForm) {
  nlohmann::json json = profileUnder(0);
  json["hazards"][1]["anchor"] = anchor("skin", 0.001);
  const pb::Profile profile = read(json);
  const Vec3 way = AnchoredPlaces(profile).wayOf(profile.hazards(1));
  EXPECT_EQ(way.x, 0);
  EXPECT_EQ(way.y, 0);
  EXPECT_NEAR(way.z, 0.029, 1e-15);
}

TEST(Anchors, areNoReasonToMoveForRoundingOrWithoutOne) {
  nlohmann::json json = profileUnder(0);
  json["targets"][0]["anchor"] = anchor("muscle", 0.03 - 0.003);
  const pb::Profile profile = read(json);
  EXPECT_EQ(targetOf(json).z, -0.03);
  EXPECT_EQ(AnchoredPlaces(profile).wayOf(profile.hazards(1)).z, 0);
  EXPECT_EQ(profileJson(read(nlohmann::json::parse(profileJson(profile)))), profileJson(profile));
}

TEST(Anchors, aLayerThatIsNotThereIsRefusedWithTheNames) {
  nlohmann::json profile = profileUnder(0);
  profile["hazards"][1]["anchor"] = anchor("bone", 0);
  const auto made = parseProfile(profile.dump(), "p.json");
  ASSERT_FALSE(made.ok());
  EXPECT_THAT(made.error().message,
              HasSubstr("hazards[1].anchor.layer: \"bone\" is not the name of a layer: skin, muscle"));
  const auto faults = profileFaults(profile.dump());
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_THAT(faults[0].message, HasSubstr("hazards[1].anchor.layer"));
}

}  // namespace
}  // namespace needlelab
