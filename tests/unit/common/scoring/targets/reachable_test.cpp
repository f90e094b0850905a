#include "common/scoring/targets/reachable.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

nlohmann::json shoulderJson() {
  return nlohmann::json::parse(*readWholeFile(NEEDLELAB_SAMPLES "/shoulder-adult.json", 1u << 20));
}

std::vector<std::string> predictionsOf(const nlohmann::json& profile, double needle_length_m = 0.06) {
  const auto read = parseProfile(profile.dump(), "shoulder.json");
  EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().message);
  return read.ok() ? unreachableTargets(*read, needle_length_m) : std::vector<std::string>{"not read"};
}

TEST(Reachable, aTargetThatStaysWhileFatGrowsLiesInFat) {
  nlohmann::json profile = shoulderJson();
  profile["layers"][1]["thickness_m"] = 0.025;
  EXPECT_THAT(predictionsOf(profile), IsEmpty()) << "anchored, it moves with the bursa";
  profile["targets"][0].erase("anchor");
  EXPECT_THAT(
      predictionsOf(profile),
      ElementsAre("targets[0]: 'subacromial bursa' lies in fat, 26 mm deep, and no part of it in bursa"));
}

TEST(Reachable, targetsOutsideInBoneAndBeyondTheNeedleAreNot) {
  nlohmann::json profile = shoulderJson();
  auto& target = profile["targets"][0];
  target.erase("anchor");
  target.erase("tissues");
  const auto at = [&](double depth_m) {
    target["center_m"]["z"] = -depth_m;
    return predictionsOf(profile);
  };
  EXPECT_THAT(at(0.026), IsEmpty());
  EXPECT_THAT(at(-0.004), ElementsAre("targets[0]: 'subacromial bursa' lies outside the body"));
  // skin 3, fat 8, muscle 14, bursa 2, tendon 6, cartilage 2: bone from 35 mm; the ball's radius is 3 mm
  EXPECT_THAT(at(0.0379), IsEmpty()) << "the needle comes to the part above the bone";
  EXPECT_THAT(at(0.0381),
              ElementsAre("targets[0]: 'subacromial bursa' lies in bone, which begins 35 mm deep"));
  target["center_m"]["z"] = -0.026;
  EXPECT_THAT(predictionsOf(profile, 0.0231), IsEmpty());
  EXPECT_THAT(predictionsOf(profile, 0.0229),
              ElementsAre("targets[0]: 'subacromial bursa' begins 23 mm deep, the needle is 22.9 mm long"));
}

}  // namespace
}  // namespace needlelab
