#include <gmock/gmock.h>

#include <functional>
#include <limits>
#include <numbers>

#include "common/haptics/effects/effect_entry.h"
#include "common/profile/profile.h"
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

TEST(SceneOfProfile, aMessageThatNobodyCheckedIsChecked) {
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
    profile.clear_targets();  // the engine knows neither
    profile.clear_hazards();
    int visited = 0;
    const auto check = [&](google::protobuf::Message& part, const google::protobuf::FieldDescriptor& field,
                           const std::string& path) {
      // of the needle the engine takes its length, and FEM a diameter (needle_test.cpp)
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
      // just outside is refused, for this reason; just inside is not
      const double lowest = range.min_open() ? std::nextafter(range.min(), inf) : range.min();
      const double highest = range.max_open() ? std::nextafter(range.max(), -inf) : range.max();
      EXPECT_TRUE(refused(std::nextafter(lowest, -inf))) << path;
      EXPECT_TRUE(refused(std::nextafter(highest, inf))) << path;
      // not a number in one coordinate spoils all three when the limb is placed: refused, whichever is named
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

// the rows of the effects are the engine's, profile.proto is what authors and files see: they say the same
TEST(EffectSections, areThoseOfTheMessages) {
  const auto* profile = pb::Profile::descriptor();
  for (const EffectEntry* effect : effectEntries()) {
    const auto number = static_cast<int>(effect->effect) + 1;
    ASSERT_TRUE(pb::Profile::Effect_IsValid(number)) << effect->name;
    EXPECT_EQ(pb::Profile::Effect_Name(static_cast<pb::Profile::Effect>(number)), effect->name);
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

}  // namespace
}  // namespace needlelab
