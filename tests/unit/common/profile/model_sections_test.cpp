// The axial models' sections: read, written and refused; another model chosen for a profile.
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>

#include "common/haptics/models/like_for_like.h"
#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

pb::Profile models() {
  auto profile = parseProfile(kGoodModels, "models.json");
  EXPECT_TRUE(profile.ok()) << (profile.ok() ? "" : profile.error().message);
  return profile.ok() ? std::move(profile).value() : pb::Profile();
}

TEST(ModelSections, reachTheSceneAsWritten) {
  const SceneSpec scene = *sceneSpecOf(models());
  EXPECT_EQ(scene.axial_model, AxialModel::kDirect);
  EXPECT_EQ(scene.direct.stiffness_N_per_m, 450);
  EXPECT_FALSE(scene.direct.step_at_layers);
  EXPECT_EQ(scene.voigt.stiffness_N_per_m, 350.5);
  EXPECT_EQ(scene.voigt.damping_Ns_per_m, 2);
  EXPECT_EQ(scene.god_object.stiffness_N_per_m, 333);
  ASSERT_EQ(scene.statistical.table.size(), 2u);
  EXPECT_EQ(scene.statistical.table[1].depth_m, 0.004);
  EXPECT_EQ(scene.statistical.table[1].mean_N, 2);
  EXPECT_EQ(scene.statistical.table[1].sd_N, 0.5);
  EXPECT_EQ(scene.statistical.correlation_length_m, 0.002);
  EXPECT_EQ(scene.statistical.seed, 4294967295u);
  EXPECT_EQ(scene.statistical.mean_factor, 1.2);
  EXPECT_EQ(scene.statistical.thickness_factor, 0.9);
  ASSERT_EQ(scene.precomputed.table.size(), 2u);
  EXPECT_EQ(scene.precomputed.table[0].attracted_N, 0.3);
  EXPECT_EQ(scene.precomputed.table[1].cutting_N, 2.5);
  EXPECT_EQ(scene.fem.nodes, 2000);
  ASSERT_EQ(scene.fem.layers.size(), 2u);
  EXPECT_EQ(scene.fem.layers[1].young_Pa, 10000);
  EXPECT_EQ(scene.fem.layers[1].poisson, 0.49);
  EXPECT_EQ(scene.fem.layers[0].friction_N_per_m, 18);
  EXPECT_EQ(scene.fem.layers[1].cutting_N, 2);
  ASSERT_TRUE(scene.layers[1].first_order);
  EXPECT_EQ(scene.layers[1].first_order->stiffness_N_per_m, 400);
  EXPECT_EQ(scene.layers[1].first_order->puncture_force_N, 0.8);
  EXPECT_EQ(scene.layers[1].first_order->cutting_force_N, 0.3);
  EXPECT_EQ(scene.layers[1].first_order->friction_N_per_m, 20);
}

TEST(ModelSections, readBackTheSame) {
  const pb::Profile profile = models();
  const std::string text = profileJson(profile);
  const auto again = parseProfile(text, "again");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(profile, *again));
  EXPECT_EQ(nlohmann::json::parse(text), nlohmann::json::parse(kGoodModels));
}

TEST(ModelSections, fieldsWithADefaultMayBeLeftOut) {
  std::string text = mutated(kGoodModels, "/direct", "{}");
  EXPECT_EQ(sceneSpecOf(*parseProfile(text, "p"))->direct.stiffness_N_per_m, 500);
  EXPECT_TRUE(sceneSpecOf(*parseProfile(text, "p"))->direct.step_at_layers);
  text = mutated(mutated(kGoodModels, "/statistical/factors", ""), "/statistical/correlation_length_m", "");
  const SceneSpec scene = *sceneSpecOf(*parseProfile(text, "p"));
  EXPECT_EQ(scene.statistical.correlation_length_m, 3e-3);
  EXPECT_EQ(scene.statistical.mean_factor, 1);
}

struct WrongSection {
  const char* model;
  const char* pointer;
  const char* value;
  const char* expected;
};

// clang-format off
const WrongSection kWrongSections[] = {
    // missing where the model is chosen
    {"DIRECT", "/direct", "", "direct: is missing, and axial_model is DIRECT"},
    {"VOIGT", "/voigt", "", "voigt: is missing, and axial_model is VOIGT"},
    {"GOD_OBJECT", "/god_object", "", "god_object: is missing, and axial_model is GOD_OBJECT"},
    {"STATISTICAL", "/statistical", "", "statistical: is missing, and axial_model is STATISTICAL"},
    {"PRECOMPUTED", "/precomputed", "", "precomputed: is missing, and axial_model is PRECOMPUTED"},
    {"FEM", "/fem", "", "fem: is missing, and axial_model is FEM"},
    {"FIRST_ORDER", "/layers/1/first_order", "", "layers[1].first_order: is missing, and axial_model is FIRST_ORDER"},
    // fields
    {"DIRECT", "/direct/stiffness_n_per_m", "0", "direct.stiffness_n_per_m: 0 is out of range (0, 10000]"},
    {"DIRECT", "/direct/step_at_layers", "1", "direct.step_at_layers: must be true or false, found the number 1"},
    {"VOIGT", "/voigt/stiffness_n_per_m", "10001", "voigt.stiffness_n_per_m: 10001 is out of range (0, 10000]"},
    {"VOIGT", "/voigt/damping_ns_per_m", "-1", "voigt.damping_ns_per_m: -1 is out of range [0, 1000]"},
    {"VOIGT", "/voigt/damping", "1", "voigt: unknown field \"damping\"; known are stiffness_n_per_m, damping_ns_per_m"},
    {"GOD_OBJECT", "/god_object/stiffness_n_per_m", "\"500\"", "god_object.stiffness_n_per_m: must be a number, found the text \"500\""},
    {"FIRST_ORDER", "/layers/0/first_order/puncture_force_n", "0", "layers[0].first_order.puncture_force_n: 0 is out of range (0, 50]"},
    {"FIRST_ORDER", "/layers/0/first_order/stiffness_n_per_m", "", "layers[0].first_order.stiffness_n_per_m: is missing"},
    {"FIRST_ORDER", "/layers/0/first_order/friction_n_per_m", "10001", "layers[0].first_order.friction_n_per_m: 10001 is out of range [0, 10000]"},
    {"FIRST_ORDER", "/layers/0/first_order/cutting_force_n", "51", "layers[0].first_order.cutting_force_n: 51 is out of range [0, 50]"},
    {"FIRST_ORDER", "/effects", "[\"CUTTING\", \"PUNCTURE\"]", "effects: lists PUNCTURE, which axial_model FIRST_ORDER has its own of"},
    {"FIRST_ORDER", "/effects", "[\"CUTTING\", \"SHAFT_FRICTION\"]", "effects: lists SHAFT_FRICTION, which axial_model FIRST_ORDER has its own of"},
    {"STATISTICAL", "/statistical/table", "[]", "statistical.table: has 0 items, allowed are 1 to 256"},
    {"STATISTICAL", "/statistical/table/1/depth_m", "0", "statistical.table[1].depth_m: 0 is not above that of the row before"},
    {"STATISTICAL", "/statistical/table/1/depth_m", "1.5", "statistical.table[1].depth_m: 1.5 is out of range [0, 1]"},
    {"STATISTICAL", "/statistical/table/1/mean_n", "51", "statistical.table[1].mean_n: 51 is out of range [0, 50]"},
    {"STATISTICAL", "/statistical/table/0/sd_n", "0.1", "statistical.table[0].sd_n: 0.1 is above 0, 10 times mean_n"},
    {"STATISTICAL", "/statistical/table/1/sd_n", "", "statistical.table[1].sd_n: is missing"},
    {"STATISTICAL", "/statistical/correlation_length_m", "0", "statistical.correlation_length_m: 0 is out of range (0, 1]"},
    {"STATISTICAL", "/statistical/seed", "", "statistical.seed: is missing"},
    {"STATISTICAL", "/statistical/seed", "-1", "statistical.seed: -1 is out of range [0, 4294967295]"},
    {"STATISTICAL", "/statistical/seed", "4294967296", "statistical.seed: 4294967296 is out of range [0, 4294967295]"},
    {"STATISTICAL", "/statistical/seed", "1.5", "statistical.seed: must be a whole number, found 1.5"},
    {"STATISTICAL", "/statistical/seed", "true", "statistical.seed: must be a number, found true"},
    {"STATISTICAL", "/statistical/factors/mean", "0", "statistical.factors.mean: 0 is out of range (0, 10]"},
    {"STATISTICAL", "/statistical/factors/thickness", "11", "statistical.factors.thickness: 11 is out of range (0, 10]"},
    {"STATISTICAL", "/statistical/synthetic/0", "\"luck\"", "statistical.synthetic[0]: \"luck\" is none of mean_n, sd_n, correlation_length_m, factors"},
    {"PRECOMPUTED", "/precomputed/table", "[]", "precomputed.table: has 0 items, allowed are 1 to 1024"},
    {"PRECOMPUTED", "/precomputed/table/1/depth_m", "0.001", "precomputed.table[1].depth_m: 0.001 is not above that of the row before"},
    {"PRECOMPUTED", "/precomputed/table/0/cutting_n", "-1", "precomputed.table[0].cutting_n: -1 is out of range [0, 50]"},
    {"PRECOMPUTED", "/precomputed/table/0/attracted_n", "", "precomputed.table[0].attracted_n: is missing"},
    {"FEM", "/fem/nodes", "99", "fem.nodes: 99 is out of range [100, 2e+05]"},
    {"FEM", "/fem/nodes", "2000.5", "fem.nodes: must be a whole number, found 2000.5"},
    {"FEM", "/fem/layers/1", "", "fem.layers: 1 given, the scene has 2 layers"},
    {"FEM", "/fem/layers/0/young_pa", "99", "fem.layers[0].young_pa: 99 is out of range [100, 1e+09]"},
    {"FEM", "/fem/layers/0/poisson", "0.5", "fem.layers[0].poisson: 0.5 is out of range [0, 0.49]"},
};
// clang-format on

TEST(ModelSections, eachFaultIsRefusedWithFieldAndRange) {
  for (const WrongSection& wrong : kWrongSections) {
    SCOPED_TRACE(std::string(wrong.model) + " " + wrong.pointer + " = " + wrong.value);
    const std::string chosen = mutated(kGoodModels, "/axial_model", '"' + std::string(wrong.model) + '"');
    const auto good = parseProfile(chosen, "p.json");
    ASSERT_TRUE(good.ok()) << good.error().message;
    const auto profile = parseProfile(mutated(chosen, wrong.pointer, wrong.value), "p.json");
    ASSERT_FALSE(profile.ok());
    EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(profile.error().message, AllOf(HasSubstr("p.json: "), HasSubstr(wrong.expected)));
  }
}

TEST(PutModel, isReadBackTheSameForEveryModel) {
  const pb::Profile wall = *parseProfile(kGoodProfile, "p");
  for (std::size_t i = 0; i < kAxialModelCount; ++i) {
    SCOPED_TRACE(kAxialModelNames[i]);
    pb::Profile profile = wall;
    const SceneSpec made = likeForLike(*sceneSpecOf(wall), static_cast<AxialModel>(i));
    putModel(made, profile);
    const auto again = parseProfile(profileJson(profile), "again");
    ASSERT_TRUE(again.ok()) << again.error().message;
    const SceneSpec read = *sceneSpecOf(*again);
    EXPECT_EQ(read.axial_model, made.axial_model);
    EXPECT_EQ(read.effects, made.effects);
    EXPECT_EQ(read.statistical.table.size(), made.statistical.table.size());
    EXPECT_EQ(read.precomputed.table.size(), made.precomputed.table.size());
    for (std::size_t k = 0; k < made.precomputed.table.size(); ++k)
      EXPECT_EQ(read.precomputed.table[k].cutting_N, made.precomputed.table[k].cutting_N);
    EXPECT_EQ(read.fem.layers.size(), made.fem.layers.size());
    EXPECT_EQ(read.layers[0].first_order.has_value(), made.layers[0].first_order.has_value());
    EXPECT_TRUE(static_cast<AxialModel>(i) == AxialModel::kFem || compile(read, 1000).ok());
  }
}

TEST(ChooseModel, takesEachModelOfAProfileWithAllSections) {
  for (const std::string_view name : kAxialModelNames) {
    pb::Profile profile = models();
    ASSERT_TRUE(chooseModel(profile, std::string(name)).ok()) << name;
    EXPECT_EQ(axialModelName(sceneSpecOf(profile)->axial_model), name);
  }
}

TEST(ChooseModel, givesDefaultsWhereThereAreAnyAndNamesTheSectionOtherwise) {
  pb::Profile profile = *parseProfile(kGoodProfile, "p");
  for (const char* name : {"ENHANCED_TRACKING_WALL", "TRACKING_WALL", "DIRECT", "VOIGT", "GOD_OBJECT"}) {
    ASSERT_TRUE(chooseModel(profile, name).ok()) << name;
    EXPECT_TRUE(parseProfile(profileJson(profile), "again").ok()) << name;
  }
  const auto told = [&](const char* name) { return chooseModel(profile, name).error().message; };
  EXPECT_THAT(told("STATISTICAL"), HasSubstr("--model STATISTICAL: statistical: is missing"));
  EXPECT_THAT(told("PRECOMPUTED"),
              AllOf(HasSubstr("precomputed: is missing"), HasSubstr("needlelab-sim precompute")));
  EXPECT_THAT(told("FEM"), HasSubstr("fem: is missing"));
  EXPECT_THAT(told("FIRST_ORDER"), HasSubstr("layers[0].first_order: is missing"));
  EXPECT_THAT(told("direct"), AllOf(HasSubstr("'direct' is unknown"), HasSubstr("GOD_OBJECT")));
}

TEST(ProfileWarnings, sayWhatAModelDoesNotHaveAndWhatIsSynthetic) {
  pb::Profile profile = models();
  EXPECT_THAT(profileWarnings(profile), Contains(HasSubstr("ATTRACTED is listed, axial_model DIRECT")));
  ASSERT_TRUE(chooseModel(profile, "STATISTICAL").ok());
  EXPECT_THAT(profileWarnings(profile),
              Contains(HasSubstr("synthetic, without data behind it: sd_n, factors")));
  profile.mutable_statistical()->clear_synthetic();
  EXPECT_THAT(profileWarnings(profile), Not(Contains(HasSubstr("synthetic"))));
  profile.mutable_statistical()->clear_source();
  EXPECT_THAT(profileWarnings(profile), Contains(HasSubstr("take its numbers as synthetic")));
  ASSERT_TRUE(chooseModel(profile, "PRECOMPUTED").ok());
  EXPECT_THAT(profileWarnings(profile), IsEmpty());
  profile.mutable_precomputed()->clear_source();
  EXPECT_THAT(profileWarnings(profile), Contains(HasSubstr("precomputed: says no source")));
  ASSERT_TRUE(chooseModel(profile, "FIRST_ORDER").ok());
  profile.mutable_layers(0)->mutable_first_order()->set_stiffness_n_per_m(200);  // 0.8 N at 4 mm of 3 mm
  EXPECT_THAT(profileWarnings(profile),
              Contains(AllOf(HasSubstr("layers[0]"), HasSubstr("0.8 N only 4 mm"))));
  profile.clear_effects();
  EXPECT_THAT(profileWarnings(profile), Contains(HasSubstr("CUTTING is not listed")));
}

}  // namespace
}  // namespace needlelab
