/// A profile with a volume: read, checked, made into a field.
#include "common/profile/volume.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <ostream>
#include <sstream>
#include <string>

#include "common/profile/profile.h"
#include "common/profile/rules.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

std::string volumeText() {
  std::ifstream file(NEEDLELAB_VOLUME);
  return (std::stringstream() << file.rdbuf()).str();
}

TEST(ProfileVolume, isReadAndWrittenWithoutLoss) {
  const auto profile = parseProfile(volumeText(), "forearm");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const std::string text = profileJson(*profile);
  const auto again = parseProfile(text, "forearm");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(profileJson(*again), text);
}

TEST(ProfileVolume, becomesAField) {
  const auto profile = parseProfile(volumeText(), "forearm");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const auto field = fieldOf(profile->volume());
  ASSERT_TRUE(field.ok()) << field.error().message;
  const auto nameAt = [&](double x_mm, double y_mm, double z_mm) {
    const StructureIndex index = field->at({1e-3 * x_mm, 1e-3 * y_mm, 1e-3 * z_mm}).structure;
    return index == kOutside ? "outside" : field->structures()[index].name;
  };
  EXPECT_EQ(nameAt(0, 0, 10), "outside");
  EXPECT_EQ(nameAt(-50, 13.2, -20.8), "bone") << "without a name: the id";
  EXPECT_EQ(nameAt(0, 3.4, -7), "median nerve") << "a point of the tube";
  EXPECT_EQ(nameAt(20, -12, -5.5), "ulnar artery") << "the end of its branch";
  EXPECT_EQ(nameAt(0, 0, -30), "muscle") << "what no rule takes";
  const LayerSpec& bone = field->structures().back().layer;
  EXPECT_TRUE(bone.is_bone);
  EXPECT_EQ(bone.cutting_force_N, 4);
}

TEST(ProfileVolume, givesNoSceneOfLayers) {
  const auto profile = parseProfile(volumeText(), "forearm");
  ASSERT_TRUE(profile.ok());
  const auto scene = sceneSpecOf(*profile);
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(profileWarnings(*profile), std::vector<std::string>{scene.error().message})
      << "its author hears of it";
  EXPECT_EQ(scene.error().message,
            "volume: profile 'forearm-volume' gives no forces yet: a lesson needs a limb and layers");
}

struct VolumeFault {
  const char* name;
  const char* patch;  ///< JSON patch (RFC 6902)
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const VolumeFault& fault) {
  return out << fault.name;
}

constexpr const char* kLimb =
    R"({"plane": {"point_m": {"x": 0, "y": 0, "z": 0}, "normal": {"x": 0, "y": 0, "z": 1}}})";

const VolumeFault kVolumeFaults[] = {
    {"aLimbToo", R"([{"op": "add", "path": "/limb", "value": LIMB}])",
     "limb: a profile with a volume has none: its skin is a group of the volume"},
    {"layersToo", R"([{"op": "add", "path": "/layers", "value": [{"tissue": "SKIN", "thickness_m": 0.01}]}])",
     "layers: a profile with a volume has none: they are the volume's structures"},
    {"neither", R"([{"op": "remove", "path": "/volume"}])", "limb: is missing"},
    {"aLimbWithoutLayers",
     R"([{"op": "remove", "path": "/volume"}, {"op": "add", "path": "/limb", "value": LIMB}])",
     "layers: is missing: give 1 to 32, from the skin inwards"},
    {"aLayerWithoutThickness",
     R"([{"op": "remove", "path": "/volume"}, {"op": "add", "path": "/limb", "value": LIMB},
         {"op": "add", "path": "/layers", "value": [{"tissue": "SKIN"}]}])",
     "layers[0].thickness_m: is missing"},
    {"aStructureWithThickness",
     R"([{"op": "add", "path": "/volume/structures/3/layer/thickness_m", "value": 0.01}])",
     "volume.structures[3].layer.thickness_m: a structure has the thickness that its rules give it"},
    {"noShape", R"([{"op": "remove", "path": "/volume/groups/2/parts/1/capsule"}])",
     "volume.groups[2].parts[1]: give exactly one of capsule, ellipsoid, half_space, tube; found none"},
    {"anUnknownGroup", R"([{"op": "replace", "path": "/volume/rules/2/group", "value": "nerve"}])",
     "volume.rules[2].group: 'nerve' is not one of: skin, bone, tendons, median-nerve, ulnar-artery, distal"},
    {"aRadiusInMillimetres",
     R"([{"op": "replace", "path": "/volume/groups/1/parts/0/capsule/radius_a_m", "value": 6}])",
     "volume.groups[1].parts[0].capsule.radius_a_m: 6 is out of range (0, 1]"},
    {"aTubeOfOnePoint", R"([{"op": "remove", "path": "/volume/groups/4/parts/1/tube/points/1"}])",
     "volume.groups[4].parts[1].tube.points: has 1 items, allowed are 2 to 64"},
    {"aMisspeltField",
     R"([{"op": "move", "from": "/volume/rules/1/to_m", "path": "/volume/rules/1/upto_m"}])",
     R"(volume.rules[1]: unknown field "upto_m"; known are group, from_m, to_m, structure, clips)"},
};

class ProfileVolumeFault : public testing::TestWithParam<VolumeFault> {};
TEST_P(ProfileVolumeFault, isNamed) {
  std::string patch = GetParam().patch;
  while (patch.find("LIMB") != std::string::npos) patch.replace(patch.find("LIMB"), 4, kLimb);
  const std::string text = nlohmann::json::parse(volumeText()).patch(nlohmann::json::parse(patch)).dump();
  const auto profile = parseProfile(text, "forearm.json");
  ASSERT_FALSE(profile.ok());
  EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(profile.error().message, std::string("forearm.json: ") + GetParam().message);
}
INSTANTIATE_TEST_SUITE_P(Checks, ProfileVolumeFault, testing::ValuesIn(kVolumeFaults),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace needlelab
