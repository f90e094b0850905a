// Converts a profile to the engine's scene, and a scene's model back to a profile.
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <numbers>
#include <set>
#include <span>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"
#include "needlelab/options.pb.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

pb::Profile profileWith(const std::string& pointer, const std::string& value) {
  auto profile = parseProfile(mutated(kGoodProfile, pointer, value), "p");
  EXPECT_TRUE(profile.ok()) << (profile.ok() ? "" : profile.error().message);
  return std::move(profile).value();
}

TEST(SceneOfProfile, carriesEveryNumber) {
  const auto spec = sceneSpecOf(profileWith("/name", "\"n\""));
  ASSERT_TRUE(spec.ok()) << spec.error().message;
  EXPECT_EQ(spec->needle_length_m, 0.06);
  ASSERT_EQ(spec->layers.size(), 2u);
  EXPECT_EQ(spec->layers[0].thickness_m, 0.003);
  EXPECT_EQ(spec->layers[0].cutting_force_N, 1.0);
  EXPECT_EQ(spec->layers[0].attracted_force_N, 0.4);
  EXPECT_EQ(spec->layers[0].rejection_force_N, 0.1);
  EXPECT_EQ(spec->layers[0].lateral_stiffness_N_per_m2, 9000);
  EXPECT_EQ(spec->layers[0].friction_N_per_m, 18);
  ASSERT_TRUE(spec->layers[0].membrane.has_value());
  EXPECT_EQ(spec->layers[0].membrane->linear_N_per_m, 200);
  EXPECT_EQ(spec->layers[0].membrane->quadratic_N_per_m2, 20000);
  EXPECT_EQ(spec->layers[0].membrane->force_N, 0.6);
  EXPECT_FALSE(spec->layers[1].membrane.has_value());
  EXPECT_EQ(spec->tracking_wall.stiffness_N_per_m, 500);
  EXPECT_EQ(spec->tracking_wall.stop_speed_mps, 0.003);
  EXPECT_EQ(spec->tracking_wall.stop_dwell_s, 0.05);
  EXPECT_EQ(spec->tracking_wall.stop_duration_s, 0.8);
  EXPECT_EQ(spec->tracking_wall.stop_mode, StopMode::kExponential);
  EXPECT_EQ(spec->tracking_wall.relax_time_s, 1.9);
  EXPECT_EQ(spec->tracking_wall.relax_residual, 0.75);
  EXPECT_EQ(spec->virtual_fixture.max_stiffness_N_per_m, 400);
  EXPECT_EQ(spec->virtual_fixture.max_force_N, 4);
  EXPECT_EQ(spec->virtual_fixture.mode, ClampingMode::kProportional);
  EXPECT_EQ(spec->orientation_limit.stiffness_Nm_per_rad, 0.5);
  EXPECT_EQ(spec->orientation_limit.max_torque_Nm, 0.2);
  EXPECT_EQ(spec->friction_stiffness_N_per_m, 140);
  EXPECT_EQ(spec->max_force_N, 10);
  EXPECT_EQ(spec->effects, kPlacedEffects);
}

TEST(SceneOfProfile, takesOnlyTheListedEffects) {
  const auto spec = sceneSpecOf(profileWith("/effects", R"(["PUNCTURE", "CUTTING"])"));
  ASSERT_TRUE(spec.ok());
  EXPECT_EQ(spec->effects, bitOf(Effect::kCutting) | bitOf(Effect::kPuncture));
}

TEST(SceneOfProfile, placesEachLimb) {
  // a quarter turn about y takes z to x; then 1 m along y
  const double half = std::numbers::pi / 4;
  const Pose X_WL{{0, 1, 0}, {0, std::sin(half), 0, std::cos(half)}};
  const auto near = [](Vec3 a, Vec3 b) { return norm(a - b) < 1e-15; };

  auto spec = sceneSpecOf(profileWith("/limb/plane/point_m/z", "0.5"), X_WL);
  ASSERT_TRUE(spec.ok());
  EXPECT_TRUE(near(std::get<PlaneLimb>(spec->limb).normal, {1, 0, 0}));
  EXPECT_TRUE(near(std::get<PlaneLimb>(spec->limb).point_m, {0.5, 1, 0}));

  spec = sceneSpecOf(profileWith("/bone", R"({"stiffness_n_per_m": 600, "friction_coefficient": 0.3,
                                            "normal": {"x": 0.5, "y": 0, "z": 1}})"),
                     X_WL);
  ASSERT_TRUE(spec.ok());
  EXPECT_TRUE(near(*spec->bone_normal, {1, 0, -0.5})) << "turned, and not moved";

  spec = sceneSpecOf(
      profileWith("/limb", R"({"sphere": {"center_m": {"x": 0, "y": 2, "z": 3}, "radius_m": 0.05}})"), X_WL);
  ASSERT_TRUE(spec.ok());
  EXPECT_TRUE(near(std::get<SphereLimb>(spec->limb).center_m, {3, 3, 0}));
  EXPECT_EQ(std::get<SphereLimb>(spec->limb).radius_m, 0.05);

  spec = sceneSpecOf(
      profileWith("/limb", R"({"capsule": {"a_m": {"x": 1, "y": 0, "z": 0}, "b_m": {"x": 0, "y": 0, "z": 1},
                                             "radius_m": 0.02}})"),
      X_WL);
  ASSERT_TRUE(spec.ok());
  EXPECT_TRUE(near(std::get<CapsuleLimb>(spec->limb).a_m, {0, 1, -1}));
  EXPECT_TRUE(near(std::get<CapsuleLimb>(spec->limb).b_m, {1, 1, 0}));
}

TEST(SceneOfProfile, refusesAPlacementThatIsNoPose) {
  const pb::Profile profile = profileWith("/name", "\"n\"");
  auto spec = sceneSpecOf(profile, Pose{{0, 0, 0}, {0, 0, 0, 2}});
  ASSERT_FALSE(spec.ok());
  EXPECT_THAT(spec.error().message, HasSubstr("placement: its quaternion has length 2"));
  EXPECT_FALSE(sceneSpecOf(profile, Pose{{0, 0, 0}, {0, 0, 0, 0}}).ok());
  EXPECT_FALSE(sceneSpecOf(profile, Pose{{0, 0, std::nan("")}, {0, 0, 0, 1}}).ok());
  EXPECT_FALSE(sceneSpecOf(profile, Pose{{0, 0, 0}, {0, 0, std::nan(""), 1}}).ok());
  EXPECT_TRUE(sceneSpecOf(profile, Pose{{0, 0, 0}, {0, 0, 0, 1.0005}}).ok())
      << "rounded files pass, and are mended";
}

TEST(SceneOfProfile, anUncheckedMessageIsChecked) {
  EXPECT_FALSE(sceneSpecOf(pb::Profile()).ok());
  pb::Profile profile = profileWith("/name", "\"n\"");
  profile.mutable_layers(0)->set_cutting_force_n(std::nan(""));
  const auto spec = sceneSpecOf(profile);
  ASSERT_FALSE(spec.ok());
  EXPECT_THAT(spec.error().message, HasSubstr("layers[0].cutting_force_n: nan is out of range [0, 50]"));
}

TEST(SceneOfProfile, withoutAttractedForceTheRejectionIsHeldByCuttingAlone) {
  // 0.45 N is above the attracted force (0.4 N), which is not listed here
  auto tree = nlohmann::json::parse(mutated(kGoodProfile, "/layers/0/rejection_force_n", "0.45"));
  tree["effects"] = {"CUTTING"};
  EXPECT_TRUE(parseProfile(tree.dump(), "p").ok());
}

/// Visits each number of a message that has a range, with its path as messages name it.
void forEachRanged(
    google::protobuf::Message& message, const std::string& path,
    const std::function<void(google::protobuf::Message&, const google::protobuf::FieldDescriptor&,
                             const std::string&)>& visit) {
  const auto& reflection = *message.GetReflection();
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const auto& field = *message.GetDescriptor()->field(i);
    const std::string name = (path.empty() ? "" : path + ".") + field.name();
    if (field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) {
      if (field.is_repeated()) {
        for (int k = 0; k < reflection.FieldSize(message, &field); ++k) {
          forEachRanged(*reflection.MutableRepeatedMessage(&message, &field, k),
                        name + "[" + std::to_string(k) + "]", visit);
        }
      } else if (reflection.HasField(message, &field)) {
        forEachRanged(*reflection.MutableMessage(&message, &field), name, visit);
      }
    } else if (field.options().HasExtension(pb::range)) {
      visit(message, field, name);
    }
  }
}

TEST(SceneOfProfile, theEnginesRangesAreThoseOfTheProto) {
  for (
      const char* limb :
      {R"({"plane": {"point_m": {"x": 0, "y": 0, "z": 0}, "normal": {"x": 0, "y": 0, "z": 1}}})",
       R"({"sphere": {"center_m": {"x": 0, "y": 2, "z": 3}, "radius_m": 0.05}})",
       R"({"capsule": {"a_m": {"x": 1, "y": 0, "z": 0}, "b_m": {"x": 0, "y": 0, "z": 1}, "radius_m": 0.02}})"}) {
    pb::Profile profile = profileWith("/limb", limb);
    profile.clear_targets();  // the engine uses neither
    profile.clear_hazards();
    for (pb::Layer& layer : *profile.mutable_layers()) layer.set_wall_stiffness_n_per_m(450);
    int visited = 0;
    const auto check = [&](google::protobuf::Message& part, const google::protobuf::FieldDescriptor& field,
                           const std::string& path) {
      // the engine uses only the needle's length, FEM also its diameter
      if (path.starts_with("needle.") && path != "needle.length_m") return;
      ++visited;
      const auto& reflection = *part.GetReflection();
      const pb::Range& range = field.options().GetExtension(pb::range);
      const double good = reflection.GetDouble(part, &field);
      const auto refused = [&](double value) {
        reflection.SetDouble(&part, &field, value);
        const auto spec = sceneSpecOf(profile);
        reflection.SetDouble(&part, &field, good);
        return !spec.ok() && spec.error().message.starts_with(path + ": ") &&
               spec.error().message.find("is out of range") != std::string::npos;
      };
      const double inf = std::numeric_limits<double>::infinity();
      // just outside is refused for this reason; just inside is not
      const double lowest = range.min_open() ? std::nextafter(range.min(), inf) : range.min();
      const double highest = range.max_open() ? std::nextafter(range.max(), -inf) : range.max();
      EXPECT_TRUE(refused(std::nextafter(lowest, -inf))) << path;
      EXPECT_TRUE(refused(std::nextafter(highest, inf))) << path;
      // NaN in one coordinate makes all three NaN when the limb is placed: refused, whichever coordinate the
      // message names.
      reflection.SetDouble(&part, &field, std::nan(""));
      EXPECT_FALSE(sceneSpecOf(profile).ok()) << path;
      reflection.SetDouble(&part, &field, good);
      EXPECT_FALSE(refused(lowest)) << path;
      EXPECT_FALSE(refused(highest)) << path;
    };
    forEachRanged(profile, "", check);
    EXPECT_GE(visited, 28) << "the good profile has every section";
  }
}

// The engine owns the table of effects, authors and files use profile.proto: both must match.
TEST(EffectSections, areThoseOfTheMessages) {
  const auto* profile = pb::Profile::descriptor();
  for (const EffectEntry* effect : effectEntries()) {
    EXPECT_EQ(pb::Profile::Effect_Name(numberOfEffect(effect->effect)), effect->name);
    if (effect->section.empty()) continue;
    const auto* section = profile->FindFieldByName(std::string(effect->section));
    ASSERT_NE(section, nullptr) << effect->section;
    for (const EffectField& own : effect->fields) {
      const auto* field = section->message_type()->FindFieldByName(std::string(own.name));
      ASSERT_NE(field, nullptr) << effect->section << "." << own.name;
      ASSERT_TRUE(field->options().HasExtension(pb::range)) << field->full_name();
      const pb::Range& range = field->options().GetExtension(pb::range);
      EXPECT_EQ(range.min(), own.range.min) << field->full_name();
      EXPECT_EQ(range.max(), own.range.max) << field->full_name();
      EXPECT_EQ(range.min_open(), own.range.min_open) << field->full_name();
    }
    if (effect->choice.name.empty()) continue;
    const auto* choice = section->message_type()->FindFieldByName(std::string(effect->choice.name));
    ASSERT_NE(choice, nullptr) << effect->choice.name;
    for (const EffectChoice::Option& option : effect->choice.options)
      EXPECT_NE(choice->enum_type()->FindValueByName(std::string(option.name)), nullptr) << option.name;
  }
}

// ---- the axial models' sections: read, written and refused; another model chosen for a profile ----

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

/// Holds the fields of a model's row against those of the message: the same numbers, with the same ranges.
void expectFields(const google::protobuf::Descriptor& message, std::span<const AxialField> fields) {
  std::set<std::string> numbers;
  const auto visit = [&](const auto& self, const google::protobuf::Descriptor& type,
                         const std::string& path) -> void {
    for (int i = 0; i < type.field_count(); ++i) {
      const auto& field = *type.field(i);
      const bool is_text = field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_STRING;
      if (field.is_repeated() || is_text) continue;
      if (field.message_type() != nullptr)
        self(self, *field.message_type(), path + field.name() + ".");
      else
        numbers.insert(path + field.name());
      const auto row = std::ranges::find(fields, path + field.name(), &AxialField::name);
      if (row == fields.end() || !field.options().HasExtension(pb::range)) continue;
      const pb::Range& range = field.options().GetExtension(pb::range);
      EXPECT_EQ(range.min(), row->range.min) << field.full_name();
      EXPECT_EQ(range.max(), row->range.max) << field.full_name();
      EXPECT_EQ(range.min_open(), row->range.min_open) << field.full_name();
    }
  };
  visit(visit, message, "");
  std::set<std::string> named;
  for (const AxialField& field : fields) named.insert(std::string(field.name));
  EXPECT_EQ(named, numbers) << message.full_name();
}

// The engine owns the table of models, authors and files use profile.proto: both must match.
TEST(ModelSections, areThoseOfTheMessages) {
  for (std::size_t i = 0; i < kAxialModelCount; ++i) {
    const AxialEntry& entry = *axialEntries()[i];
    SCOPED_TRACE(kAxialModelNames[i]);
    EXPECT_EQ(static_cast<std::size_t>(entry.model), i);
    EXPECT_EQ(pb::Profile::AxialModel_Name(static_cast<int>(i) + 1), kAxialModelNames[i]);
    const AxialSection& own = entry.section;
    if (own.name.empty()) continue;
    const auto* of = own.inLayers() ? pb::Layer::descriptor() : pb::Profile::descriptor();
    const auto* section = of->FindFieldByName(std::string(own.name));
    ASSERT_NE(section, nullptr) << own.name;
    expectFields(*section->message_type(), own.fields);
    if (own.table.empty()) continue;
    const auto* table = section->message_type()->FindFieldByName(std::string(own.table));
    ASSERT_NE(table, nullptr) << own.table;
    expectFields(*table->message_type(), own.row_fields);
    if (own.max_rows > 0) EXPECT_EQ(table->options().GetExtension(pb::max_items), own.max_rows);
  }
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
  ASSERT_TRUE(scene.layers[1].okamura);
  const OkamuraSpec& okamura = *scene.layers[1].okamura;
  EXPECT_EQ(okamura.linear_N_per_m, 100);
  EXPECT_EQ(okamura.quadratic_N_per_m2, 30000);
  EXPECT_EQ(okamura.puncture_force_N, 0.7);
  EXPECT_EQ(okamura.cutting_force_N, 0.4);
  EXPECT_EQ(okamura.in.kinetic_N_per_m, 12);
  EXPECT_EQ(okamura.in.static_N_per_m, 19);
  EXPECT_EQ(okamura.in.viscous_Ns_per_m2, 290);
  EXPECT_EQ(okamura.out.kinetic_N_per_m, 11);
  EXPECT_EQ(okamura.out.static_N_per_m, 18);
  EXPECT_EQ(okamura.out.viscous_Ns_per_m2, 210);
}

TEST(ModelSections, readBackTheSame) {
  const pb::Profile profile = models();
  const std::string text = profileJson(profile);
  const auto again = parseProfile(text, "again");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(profile, *again));
  EXPECT_EQ(nlohmann::json::parse(text), nlohmann::json::parse(kGoodModels));
}

TEST(ModelSections, defaultedFieldsMayBeOmitted) {
  std::string text = mutated(kGoodModels, "/direct", "{}");
  EXPECT_EQ(sceneSpecOf(*parseProfile(text, "p"))->direct.stiffness_N_per_m, 500);
  EXPECT_TRUE(sceneSpecOf(*parseProfile(text, "p"))->direct.step_at_layers);
  text = mutated(mutated(kGoodModels, "/statistical/factors", ""), "/statistical/correlation_length_m", "");
  SceneSpec scene = *sceneSpecOf(*parseProfile(text, "p"));
  EXPECT_EQ(scene.statistical.correlation_length_m, 3e-3);
  EXPECT_EQ(scene.statistical.mean_factor, 1);
  text = kGoodModels;
  for (const char* name :
       {"static_in_n_per_m", "static_out_n_per_m", "viscous_in_ns_per_m2", "viscous_out_ns_per_m2"})
    text = mutated(text, std::string("/layers/0/okamura/") + name, "");
  scene = *sceneSpecOf(*parseProfile(text, "p"));
  EXPECT_EQ(scene.layers[0].okamura->in.static_N_per_m, 12) << "no stronger than kinetic friction";
  EXPECT_EQ(scene.layers[0].okamura->out.static_N_per_m, 11);
  EXPECT_EQ(scene.layers[0].okamura->in.viscous_Ns_per_m2, 0);
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
    {"OKAMURA", "/layers/1/okamura", "", "layers[1].okamura: is missing, and axial_model is OKAMURA"},
    {"DAHL", "/layers/0/okamura", "", "layers[0].okamura: is missing, and axial_model is DAHL"},
    // fields
    {"OKAMURA", "/layers/0/okamura/linear_n_per_m", "-1", "layers[0].okamura.linear_n_per_m: -1 is out of range [0, 10000]"},
    {"OKAMURA", "/layers/0/okamura", R"({"linear_n_per_m": 0, "quadratic_n_per_m2": 0, "puncture_force_n": 1, "cutting_force_n": 1, "kinetic_in_n_per_m": 1, "kinetic_out_n_per_m": 1})", "layers[0].okamura: linear_n_per_m and quadratic_n_per_m2 are both 0"},
    {"OKAMURA", "/layers/0/okamura/puncture_force_n", "0", "layers[0].okamura.puncture_force_n: 0 is out of range (0, 50]"},
    {"OKAMURA", "/layers/0/okamura/cutting_force_n", "51", "layers[0].okamura.cutting_force_n: 51 is out of range [0, 50]"},
    {"OKAMURA", "/layers/0/okamura/kinetic_in_n_per_m", "", "layers[0].okamura.kinetic_in_n_per_m: is missing"},
    {"OKAMURA", "/layers/0/okamura/static_out_n_per_m", "5", "layers[0].okamura.static_out_n_per_m: 5 is below 11, kinetic_out_n_per_m"},
    {"DAHL", "/layers/1/okamura/viscous_in_ns_per_m2", "1e6", "layers[1].okamura.viscous_in_ns_per_m2: 1e+06 is out of range [0, 1e+05]"},
    {"OKAMURA", "/effects", "[\"CUTTING\", \"PUNCTURE\"]", "effects: lists PUNCTURE, which axial_model OKAMURA has its own of"},
    {"DAHL", "/effects", "[\"CUTTING\", \"SHAFT_FRICTION\"]", "effects: lists SHAFT_FRICTION, which axial_model DAHL has its own of"},
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
    {"STATISTICAL", "/statistical/synthetic/0", "\"luck\"", "statistical.synthetic[0]: \"luck\" is not one of mean_n, sd_n, correlation_length_m, factors"},
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
    ASSERT_EQ(read.layers[0].okamura.has_value(), made.layers[0].okamura.has_value());
    if (made.layers[0].okamura) {
      EXPECT_EQ(read.layers[0].okamura->in.static_N_per_m, made.layers[0].okamura->in.static_N_per_m);
      EXPECT_EQ(read.layers[0].okamura->out.viscous_Ns_per_m2, made.layers[0].okamura->out.viscous_Ns_per_m2);
      EXPECT_EQ(read.layers[0].okamura->quadratic_N_per_m2, made.layers[0].okamura->quadratic_N_per_m2);
    }
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
  EXPECT_THAT(told("DAHL"), HasSubstr("layers[0].okamura: is missing"));
  EXPECT_THAT(told("direct"), AllOf(HasSubstr("'direct' is unknown"), HasSubstr("GOD_OBJECT")));
}

TEST(ProfileWarnings, nameUnsupportedEffectsAndSyntheticNumbers) {
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
  profile.mutable_layers(0)->mutable_first_order()->set_stiffness_n_per_m(200);  // 0.8 N at 4 mm > 3 mm
  EXPECT_THAT(profileWarnings(profile),
              Contains(AllOf(HasSubstr("layers[0]"), HasSubstr("0.8 N only 4 mm"))));
  ASSERT_TRUE(chooseModel(profile, "OKAMURA").ok());
  profile.mutable_layers(0)->mutable_okamura()->set_quadratic_n_per_m2(25000);  // 0.8 N at 4 mm, too
  profile.mutable_layers(0)->mutable_okamura()->set_puncture_force_n(0.8);
  EXPECT_THAT(profileWarnings(profile),
              Contains(AllOf(HasSubstr("layers[0]"), HasSubstr("0.8 N only 4 mm"))));
  profile.clear_effects();
  EXPECT_THAT(profileWarnings(profile), Contains(HasSubstr("CUTTING is not listed")));
}

}  // namespace
}  // namespace needlelab
