/// A profile with a volume: read, checked, made into a field.
#include "common/profile/volume.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <ostream>
#include <sstream>
#include <string>
#include <variant>
#include <vector>

#include "common/haptics/scene_model.h"
#include "common/profile/anchors.h"
#include "common/profile/layer_names.h"
#include "common/profile/planned_line.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"
#include "tests/support/anatomy/ball_profiles.h"

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

TEST(ProfileVolume, becomesASceneOfABody) {
  const auto profile = parseProfile(volumeText(), "forearm");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  EXPECT_TRUE(profileWarnings(*profile).empty());
  const Pose X_WL{{0.1, 0.2, 0.3}, normalized(Quat{0.2, -0.1, 0.4, 0.9})};
  const auto scene = sceneSpecOf(*profile, X_WL);
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  const auto field = fieldOf(profile->volume());
  ASSERT_TRUE(field.ok());
  ASSERT_EQ(scene->layers.size(), field->structures().size());
  for (std::size_t i = 0; i < scene->layers.size(); ++i) {
    const LayerSpec &layer = scene->layers[i], &structure = field->structures()[i].layer;
    EXPECT_EQ(layer.cutting_force_N, structure.cutting_force_N);
    EXPECT_EQ(layer.is_bone, structure.is_bone);
  }
  EXPECT_EQ(scene->needle_length_m, profile->needle().length_m());
  EXPECT_EQ(scene->effects, bitOf(Effect::kCutting) | bitOf(Effect::kAttracted));
  const auto* const body = std::get_if<BodyLimb>(&scene->limb);
  ASSERT_NE(body, nullptr);
  EXPECT_EQ(body->X_WL.p, X_WL.p);
  for (const Vec3 p_m : {Vec3{0, 0, 0.01}, Vec3{-0.05, 0.0132, -0.0208}, Vec3{0, 0.0034, -0.007}})
    EXPECT_EQ(body->body->structureAt(p_m), field->at(p_m).structure);
  EXPECT_NEAR(signedDepth(scene->limb, X_WL * Vec3{0, 0, 0.01}), -field->skinDistance({0, 0, 0.01}), 1e-12);
}

TEST(ProfileVolume, namesItsStructuresAsLayers) {
  const pb::Profile profile = test::readProfile(test::withCyst());
  EXPECT_EQ(layerNames(profile), (std::vector<std::string>{"skin", "fat", "muscle", "cyst"}));
  ASSERT_EQ(profileLayers(profile).size(), 4U);
  EXPECT_EQ(profileLayers(profile)[1]->tissue(), pb::Layer::FAT);
  EXPECT_EQ(layerPath(profile, 1), "volume.structures[1].layer");
}

TEST(ProfileVolume, hasTheModelsSectionInEachStructure) {
  nlohmann::json tree = test::ballOfRules();
  tree["axial_model"] = "FIRST_ORDER";
  for (std::size_t i = 0; i < 3; ++i)
    tree["volume"]["structures"][i]["layer"]["first_order"] = {{"stiffness_n_per_m", 400 + 10 * i},
                                                               {"puncture_force_n", 0.8},
                                                               {"cutting_force_n", 0.3},
                                                               {"friction_n_per_m", 20}};
  const pb::Profile profile = test::readProfile(tree);
  const auto scene = sceneSpecOf(profile);
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(scene->layers[i].first_order->stiffness_N_per_m, 400 + 10.0 * static_cast<double>(i));
  pb::Profile written = test::readProfile(test::ballOfRules());
  putModel(*scene, written);
  EXPECT_EQ(written.volume().structures(2).layer().first_order().stiffness_n_per_m(), 420);

  tree["volume"]["structures"][1]["layer"].erase("first_order");
  const auto faulty = parseProfile(tree.dump(), "ball");
  ASSERT_FALSE(faulty.ok());
  EXPECT_EQ(faulty.error().message,
            "ball: volume.structures[1].layer.first_order: is missing, and axial_model is FIRST_ORDER");
}

TEST(ProfileVolume, refusesWhatTheEngineRefusesByItsStructure) {
  nlohmann::json tree = test::ballOfRules();
  tree["volume"]["structures"][2]["layer"]["rejection_force_n"] = 0.7;
  const auto faulty = parseProfile(tree.dump(), "ball");
  ASSERT_FALSE(faulty.ok());
  EXPECT_EQ(faulty.error().message.substr(0, 62),
            "ball: volume.structures[2].layer.rejection_force_n: 0.7 is abo");
}

TEST(ProfileVolume, movesAnAnchoredTargetUnderItsStructure) {
  nlohmann::json of_layers = test::ballOfLayers(), of_rules = test::ballOfRules();
  for (nlohmann::json* tree : {&of_layers, &of_rules}) {
    (*tree)["targets"][0]["anchor"] = {{"layer", "fat"}, {"offset_m", 0.002}};
    (*tree)["hazards"][0]["anchor"] = {{"layer", "muscle"}, {"offset_m", 0.001}};
  }
  const pb::Profile like = test::readProfile(of_layers), profile = test::readProfile(of_rules);
  const AnchoredPlaces expected(like), found(profile);
  EXPECT_GT(norm(expected.wayOf(like.targets(0))), 0.005);
  EXPECT_NEAR(norm(found.wayOf(profile.targets(0)) - expected.wayOf(like.targets(0))), 0, 1e-6);
  EXPECT_NEAR(norm(found.wayOf(profile.hazards(0)) - expected.wayOf(like.hazards(0))), 0, 1e-6);

  nlohmann::json missed = test::withCyst();
  missed["targets"] = of_rules["targets"];
  missed["targets"][0]["center_m"] = {{"x", 0.02}, {"y", 0}, {"z", -0.015}};
  missed["targets"][0]["anchor"]["layer"] = "cyst";
  const auto faulty = parseProfile(missed.dump(), "ball");
  ASSERT_FALSE(faulty.ok());
  EXPECT_EQ(faulty.error().message,
            "ball: targets[0].anchor.layer: a line straight in from the skin nearest to its place meets no "
            "\"cyst\" within 200 mm: move it, or leave the anchor out");
}

TEST(ProfileVolume, putsAPlannedEntryOnItsSkin) {
  const pb::Profile profile = test::readProfile(test::ballOfRules());
  const auto exerciseFrom = [](double z_m, double x_m) {
    const nlohmann::json tree = {{"id", "one"},
                                 {"name", "One"},
                                 {"profile_id", "ball"},
                                 {"plan",
                                  {{"frame", "LIMB"},
                                   {"entry_m", {{"x", x_m}, {"y", 0}, {"z", z_m}}},
                                   {"direction", {{"x", 0}, {"y", 0}, {"z", -2}}}}}};
    return *parseExercise(tree.dump(), "exercise");
  };
  const auto scene = sceneSpecOf(profile);
  ASSERT_TRUE(scene.ok());
  const double x_m = 0.01, skin_m = std::sqrt(0.05 * 0.05 - x_m * x_m) - 0.05;
  for (const double from_m : {0.015, 0.001, -0.012}) {
    const pb::Exercise exercise = exerciseFrom(from_m, x_m);
    EXPECT_TRUE(checkPlan(exercise, profile, "").ok()) << checkPlan(exercise, profile, "").error().message;
    const auto line = onSkin(*plannedLineOf(exercise), scene->limb);
    ASSERT_TRUE(line);
    EXPECT_NEAR(norm(line->entry_m - Vec3{x_m, 0, skin_m}), 0, 2e-7);
    EXPECT_EQ(line->direction, (Vec3{0, 0, -1}));
  }
  const Status far = checkPlan(exerciseFrom(0.05, 0), profile, "");
  ASSERT_FALSE(far.ok());
  EXPECT_EQ(
      far.error().message,
      "plan.entry_m: (0, 0, 50) mm is 50 mm above the skin of profile 'ball', and the line does not meet "
      "it within 20 mm: give a point of the line nearer to where it goes in");
  EXPECT_FALSE(checkPlan(exerciseFrom(0.01, 0.0499), profile, "").ok()) << "along the skin";
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

struct PlaceFault {
  const char* name;
  const char* targets;
  const char* hazards;
  const char* message;
};
std::ostream& operator<<(std::ostream& out, const PlaceFault& fault) {
  return out << fault.name;
}

const PlaceFault kPlaceFaults[] = {
    {"targetOfNoStructure", R"([{"name": "t", "structure": "bursa"}])", "[]",
     "targets[0].structure: \"bursa\" is not one of: skin, fat, muscle, cyst"},
    {"hazardOfNoStructure", "[]", R"([{"name": "h", "kind": "NERVE", "structure": "nerve"}])",
     "hazards[0].structure: \"nerve\" is not one of: skin, fat, muscle, cyst"},
    {"targetWithBoth",
     R"([{"name": "t", "structure": "cyst", "center_m": {"x": 0, "y": 0, "z": 0}, "radius_m": 0.1}])", "[]",
     "targets[0].radius_m: a region is either a structure or a shape: take one out"},
    {"targetWithTissues", R"([{"name": "t", "structure": "cyst", "tissues": ["fat"]}])", "[]",
     "targets[0].tissues: a region is either a structure or a shape: take one out"},
    {"hazardWithARadius", "[]", R"([{"name": "h", "kind": "NERVE", "structure": "cyst", "radius_m": 0.1}])",
     "hazards[0].radius_m: a region is either a structure or a shape: take one out"},
    {"aimOutside", R"([{"name": "t", "structure": "cyst", "center_m": {"x": 0, "y": 0, "z": 0.01}}])", "[]",
     "targets[0].center_m: is outside of the skin, not in \"cyst\": give a point of the target's structure, "
     "or leave it out"},
    {"aimElsewhere", R"([{"name": "t", "structure": "cyst", "center_m": {"x": 0, "y": 0, "z": -0.01}}])",
     "[]",
     "targets[0].center_m: is in \"muscle\", not in \"cyst\": give a point of the target's structure, or "
     "leave it out"},
    {"targetOfNothing", R"([{"name": "t"}])", "[]", "targets[0].center_m: is missing"},
    {"targetWithoutARadius", R"([{"name": "t", "center_m": {"x": 0, "y": 0, "z": 0}}])", "[]",
     "targets[0].radius_m: is missing"},
    {"hazardOfNothing", "[]", R"([{"name": "h", "kind": "NERVE"}])", "hazards[0].radius_m: is missing"},
};

class VolumePlaceFault : public testing::TestWithParam<PlaceFault> {};
TEST_P(VolumePlaceFault, isNamed) {
  nlohmann::json tree = test::withCyst();
  tree["targets"] = nlohmann::json::parse(GetParam().targets);
  tree["hazards"] = nlohmann::json::parse(GetParam().hazards);
  const auto profile = parseProfile(tree.dump(), "ball");
  ASSERT_FALSE(profile.ok());
  EXPECT_EQ(profile.error().message, std::string("ball: ") + GetParam().message);
}
INSTANTIATE_TEST_SUITE_P(Checks, VolumePlaceFault, testing::ValuesIn(kPlaceFaults),
                         [](const auto& test) { return test.param.name; });

TEST(ProfileVolume, aLandmarkIsOneOfItsBones) {
  const auto faultOf = [](nlohmann::json tree, const char* landmark) {
    tree["palpation"] = {{"skin_stiffness_n_per_m", 300},
                         {"bone_stiffness_n_per_m", 600},
                         {"friction_coefficient", 0.3},
                         {"radius_m", 0.003},
                         {"landmark", landmark}};
    const auto profile = parseProfile(tree.dump(), "ball");
    return profile.ok() ? std::string() : profile.error().message;
  };
  nlohmann::json tree = test::withCyst();
  EXPECT_EQ(faultOf(tree, "cyst"),
            "ball: palpation.landmark: \"cyst\" is not a bone of the volume: it has none");
  tree["volume"]["structures"].back()["layer"]["tissue"] = "BONE";
  EXPECT_EQ(faultOf(tree, "cyst"), "");
  EXPECT_EQ(faultOf(tree, "fat"), "ball: palpation.landmark: \"fat\" is not a bone of the volume: cyst");
  EXPECT_EQ(faultOf(test::ballOfLayers(), "fat"),
            "ball: palpation.landmark: needs a volume, and the profile has layers, which have no landmark");
}

TEST(ProfileVolume, isNeededForATargetThatIsAStructure) {
  nlohmann::json tree = test::ballOfLayers();
  tree["targets"] = nlohmann::json::parse(R"([{"name": "t", "structure": "fat"}])");
  const auto profile = parseProfile(tree.dump(), "ball");
  ASSERT_FALSE(profile.ok());
  EXPECT_EQ(profile.error().message,
            "ball: targets[0].structure: needs a volume, and the profile has layers: give a shape");
}

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
