#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

pb::Profile good() {
  auto profile = parseProfile(kGoodProfile, "good.json");
  EXPECT_TRUE(profile.ok()) << (profile.ok() ? "" : profile.error().message);
  return std::move(profile).value();
}

/// A name as Protobuf's JSON mapping writes it by default.
std::string camelCase(const std::string& name) {
  std::string camel;
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (name[i] == '_') continue;
    camel += i > 0 && name[i - 1] == '_' ? static_cast<char>(std::toupper(name[i])) : name[i];
  }
  return camel;
}

nlohmann::json withCamelKeys(const nlohmann::json& tree) {
  if (tree.is_array()) {
    nlohmann::json list = nlohmann::json::array();
    for (const auto& item : tree) list.push_back(withCamelKeys(item));
    return list;
  }
  if (!tree.is_object()) return tree;
  nlohmann::json object = nlohmann::json::object();
  for (const auto& [key, value] : tree.items()) object[camelCase(key)] = withCamelKeys(value);
  return object;
}

TEST(Profile, readsEveryFieldAsWritten) {
  const pb::Profile profile = good();
  EXPECT_EQ(profile.id(), "shoulder-adult");
  EXPECT_EQ(profile.axial_model(), pb::Profile::ENHANCED_TRACKING_WALL);
  EXPECT_EQ(profile.needle().length_m(), 0.06);
  EXPECT_EQ(profile.limb().plane().normal().z(), 1);
  ASSERT_EQ(profile.layers_size(), 2);
  EXPECT_EQ(profile.layers(0).tissue(), pb::Layer::SKIN);
  EXPECT_EQ(profile.layers(0).puncture().quadratic_n_per_m2(), 20000);
  EXPECT_FALSE(profile.layers(1).has_puncture());
  EXPECT_EQ(profile.tracking_wall().stop_mode(), pb::TrackingWall::EXPONENTIAL);
  EXPECT_EQ(profile.virtual_fixture().mode(), pb::VirtualFixture::PROPORTIONAL);
  EXPECT_EQ(profile.targets(0).center_m().z(), -0.03);
  EXPECT_EQ(profile.hazards(1).b_m().y(), 0.03);
  ASSERT_EQ(profile.effects_size(), 6);
  EXPECT_EQ(profile.effects(5), pb::Profile::PUNCTURE);
  EXPECT_EQ(profile.description(), "For tests.\nTwo lines, and Größe in UTF-8.");
}

TEST(Profile, camelCaseMeansTheSame) {
  const std::string camel = withCamelKeys(nlohmann::json::parse(kGoodProfile)).dump();
  ASSERT_THAT(camel, HasSubstr("\"lateralStiffnessNPerM2\""));
  const auto profile = parseProfile(camel, "camel.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  EXPECT_EQ(profileJson(*profile), profileJson(good()));
}

TEST(Profile, optionalSectionsMayBeOmitted) {
  nlohmann::json tree = nlohmann::json::parse(kGoodProfile);
  for (const char* key : {"axial_model", "virtual_fixture", "orientation_limit", "shaft_friction",
                          "max_force_n", "targets", "hazards", "description", "sources"}) {
    tree.erase(key);
  }
  tree["effects"] = nlohmann::json::array();
  const auto profile = parseProfile(tree.dump(), "p");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  EXPECT_EQ(sceneSpecOf(*profile)->effects, 0u);
  EXPECT_EQ(sceneSpecOf(*profile)->max_force_N, 10);
  EXPECT_THAT(profileJson(*profile), HasSubstr("\"effects\": []"))
      << "required fields are written, even when empty";
}

TEST(ProfileJson, readsBackTheSameAndIsStable) {
  const pb::Profile profile = good();
  const std::string text = profileJson(profile);
  const auto again = parseProfile(text, "again");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(profile, *again));
  EXPECT_EQ(profileJson(*again), text);
  EXPECT_THAT(text, HasSubstr("\"lateral_stiffness_n_per_m2\": 9000"));
  EXPECT_THAT(text, ::testing::EndsWith("}\n"));
  // It has the same content as the input.
  EXPECT_EQ(nlohmann::json::parse(text), nlohmann::json::parse(kGoodProfile));
}

TEST(ProfileJson, keepsEveryBitOfANumber) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> mantissa(0.1, 1);
  pb::Profile profile = good();
  for (int i = 0; i < 300; ++i) {
    const double value = mantissa(random) * std::pow(10, -static_cast<int>(random() % 300));
    profile.mutable_layers(1)->set_thickness_m(value);
    const auto again = parseProfile(profileJson(profile), "again");
    ASSERT_TRUE(again.ok()) << again.error().message;
    ASSERT_EQ(again->layers(1).thickness_m(), value);
  }
}

TEST(ProfileJson, aNegativeZeroIsWrittenAsZero) {
  const auto profile = parseProfile(mutated(kGoodProfile, "/limb/plane/point_m/x", "-0.0"), "p");
  ASSERT_TRUE(profile.ok());
  EXPECT_FALSE(std::signbit(profile->limb().plane().point_m().x()));
}

TEST(ProfileJson, doesNotDependOnTheOrderOfTheFile) {
  // nlohmann's tree sorts by key, not in the .proto's order
  const auto sorted = parseProfile(nlohmann::json::parse(kGoodProfile).dump(), "sorted");
  ASSERT_TRUE(sorted.ok());
  EXPECT_EQ(profileJson(*sorted), profileJson(good()));
}

TEST(LoadProfile, namesTheFile) {
  const auto folder = std::filesystem::temp_directory_path() / ("profile_test_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const auto path = folder / "p.json";
  std::ofstream(path) << mutated(kGoodProfile, "/max_force_n", "99");
  const auto wrong = loadProfile(path);
  ASSERT_FALSE(wrong.ok());
  EXPECT_EQ(wrong.error().message, path.string() + ": max_force_n: 99 is out of range (0, 50]");
  const auto missing = loadProfile(folder / "none.json");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(missing.error().message, HasSubstr("none.json"));
  std::filesystem::remove_all(folder);
}

TEST(Profile, randomDamageNeverCrashesAndWhatPassesIsSound) {
  std::mt19937_64 random(20261101);
  const std::string alphabet = "{}[]\",:.-+eE0123456789 \\u\n\x7f\xff" + std::string(1, '\0');
  int passed = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string text = kGoodProfile;
    const std::size_t changes = 1 + random() % 4;
    for (std::size_t c = 0; c < changes; ++c) {
      const std::size_t at = random() % text.size();
      switch (random() % 4) {
        case 0:
          text[at] = alphabet[random() % alphabet.size()];
          break;
        case 1:
          text.erase(at, 1 + random() % 8);
          break;
        case 2:
          text.insert(at, 1, alphabet[random() % alphabet.size()]);
          break;
        case 3:
          text.insert(at, text.substr(random() % text.size(), random() % 40));
          break;
      }
    }
    const auto profile = parseProfile(text, "damaged");
    if (!profile.ok()) {
      ASSERT_EQ(profile.error().code, ErrorCode::kInvalidInput);
      continue;
    }
    ++passed;
    // A valid text is a complete profile: it makes a scene, and reads back the same.
    ASSERT_TRUE(sceneSpecOf(*profile).ok());
    const auto again = parseProfile(profileJson(*profile), "again");
    ASSERT_TRUE(again.ok()) << again.error().message;
    ASSERT_EQ(profileJson(*again), profileJson(*profile));
  }
  EXPECT_GT(passed, 20) << "damage to spaces and digits leaves valid profiles: else the test shows little";
  EXPECT_LT(passed, 1500);
}

TEST(Curriculum, readsBackTheSame) {
  const auto curriculum = parseCurriculum(kGoodCurriculum, "c");
  ASSERT_TRUE(curriculum.ok()) << curriculum.error().message;
  EXPECT_EQ(curriculum->exercises(0).requirements(0).measure(), "peak_force_n");
  EXPECT_FALSE(curriculum->exercises(0).requirements(0).has_min());
  EXPECT_EQ(nlohmann::json::parse(curriculumJson(*curriculum)), nlohmann::json::parse(kGoodCurriculum));
  const auto again = parseCurriculum(curriculumJson(*curriculum), "again");
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(curriculumJson(*again), curriculumJson(*curriculum));

  const auto exercise = parseExercise(exerciseJson(curriculum->exercises(0)), "e");
  ASSERT_TRUE(exercise.ok()) << exercise.error().message;
  EXPECT_EQ(exercise->time_limit_s(), 60);
}

TEST(Curriculum, anExamIsAssignedOnlyAndSuppliesExerciseDefaults) {
  const auto course = [](const std::string& flags) {
    return *parseCurriculum("{" + flags +
                                R"("id": "c", "name": "C", "exercises": [
      {"id": "plain", "name": "P", "profile_id": "p"},
      {"id": "own", "name": "O", "profile_id": "p", "attempts": 3, "aids": {"allowed": ["DEPTH"]}}]})",
                            "c");
  };
  const pb::Curriculum practice = course(""), few = course(R"("assigned_only": true,)");
  const pb::Curriculum exam = course(R"("exam": true, "results_from_unix_ms": 1780000000000,)");
  EXPECT_FALSE(isAssignedOnly(practice));
  EXPECT_TRUE(isAssignedOnly(few));
  EXPECT_TRUE(isAssignedOnly(exam));
  for (const pb::Curriculum& as_it_is : {practice, few})
    for (const pb::Exercise& exercise : as_it_is.exercises())
      EXPECT_EQ(exerciseJson(exerciseInCourse(as_it_is, exercise)), exerciseJson(exercise));
  const pb::Exercise plain = exerciseInCourse(exam, exam.exercises(0));
  EXPECT_EQ(plain.attempts(), 1u);
  EXPECT_TRUE(plain.has_aids());
  EXPECT_TRUE(plain.aids().allowed().empty());
  // as the station reads it back
  EXPECT_TRUE(parseExercise(exerciseJson(plain), "e")->has_aids());
  EXPECT_EQ(exerciseJson(exerciseInCourse(exam, exam.exercises(1))), exerciseJson(exam.exercises(1)));
}

}  // namespace
}  // namespace needlelab
