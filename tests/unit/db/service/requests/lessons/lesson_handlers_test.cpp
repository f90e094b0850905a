#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/profile/profile.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

class LessonHandlers : public test::ServiceTest {
 protected:
  std::string exerciseId() {
    pb::Request request;
    request.mutable_list_curricula();
    return get(admin, request).curricula().curricula(0).exercise_ids(0);
  }
  std::string profileText(const std::string& id, std::uint32_t revision = 0) {
    pb::Request request;
    request.mutable_get_profile()->set_id(id);
    request.mutable_get_profile()->set_revision(revision);
    return get(station, request).profile().json();
  }
  static pb::Request import(const std::string& json) {
    pb::Request request;
    request.mutable_import_profile()->set_json(json);
    return request;
  }
};

TEST_F(LessonHandlers, aLessonHoldsExerciseAndNewestProfile) {
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id(exerciseId());
  request.mutable_get_lesson()->set_trainee("anna");
  addPerson("anna", pb::TRAINEE);
  const auto lesson = get(station, request).lesson();
  const auto exercise = parseExercise(lesson.exercise_json(), "exercise");
  ASSERT_OK(exercise);
  const auto profile = parseProfile(lesson.profile_json(), "profile");
  ASSERT_OK(profile);
  EXPECT_EQ(profile->id(), exercise->profile_id());
  EXPECT_EQ(lesson.profile_revision(), 1u);
  request.mutable_get_lesson()->set_exercise_id("nothing");
  EXPECT_EQ(refusal(station, request), ErrorCode::kNotFound);
}

TEST_F(LessonHandlers, aDisabledTraineeGetsNoLesson) {
  addPerson("anna", pb::TRAINEE);
  ASSERT_OK(change([](Connection& c) { return PeopleStore(c).setDisabled("anna", true); }));
  pb::Request request;
  request.mutable_get_lesson()->set_exercise_id(exerciseId());
  request.mutable_get_lesson()->set_trainee("anna");
  EXPECT_EQ(refusal(station, request), ErrorCode::kNotFound) << "as for a name that nobody has";
}

// a new database takes them without parsing them
TEST_F(LessonHandlers, everySampleIsStoredAsAnImportWouldStoreIt) {
  pb::Request request;
  request.mutable_list_profiles();
  const auto listed = get(admin, request).profiles();
  std::size_t profiles = 0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "db/samples")) {
    const std::string name = file.path().filename().string();
    if (file.path().extension() != ".json" || name.ends_with("curriculum.json")) continue;
    SCOPED_TRACE(name);
    ++profiles;
    const auto profile = loadProfile(file.path());
    ASSERT_OK(profile);
    EXPECT_EQ(profileText(profile->id()), profileJson(*profile));
    EXPECT_EQ(std::ranges::count_if(listed.profiles(),
                                    [&](const auto& row) {
                                      return row.id() == profile->id() && row.name() == profile->name();
                                    }),
              1);
  }
  EXPECT_GT(profiles, 20u);
  EXPECT_EQ(static_cast<std::size_t>(listed.profiles_size()), profiles);
}

TEST_F(LessonHandlers, anImportedProfileIsCanonicalAndGetsRevisions) {
  auto json = nlohmann::json::parse(profileText("knee-adult"));
  // The same content in a different layout is the same revision.
  EXPECT_EQ(get(manager, import(json.dump(7))).profile().revision(), 1u);
  json["name"] = "Another knee";
  const auto changed = get(manager, import(json.dump())).profile();
  EXPECT_EQ(changed.revision(), 2u);
  EXPECT_EQ(changed.author(), "mia");
  EXPECT_NE(profileText("knee-adult", 1), profileText("knee-adult", 2));
  EXPECT_EQ(profileText("knee-adult"), profileText("knee-adult", 2));
}

TEST_F(LessonHandlers, aWrongProfileIsRefusedByField) {
  auto json = nlohmann::json::parse(profileText("knee-adult"));
  json["layers"][0]["thickness_m"] = -1;
  const auto outcome = ask(manager, import(json.dump()));
  ASSERT_TRUE(outcome.error.has_value());
  EXPECT_EQ(outcome.error->code, ErrorCode::kInvalidInput);
  EXPECT_NE(outcome.error->message.find("layers[0].thickness_m"), std::string::npos)
      << outcome.error->message;
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[]"), std::string(2'000'000, ' ')}) {
    EXPECT_EQ(refusal(manager, import(text)), ErrorCode::kInvalidInput);
  }
}

TEST_F(LessonHandlers, curriculaNameProfilesAndMeasuresThatExist) {
  pb::Request list;
  list.mutable_list_curricula();
  pb::Request request;
  request.mutable_get_curriculum()->set_id(get(admin, list).curricula().curricula(0).id());
  const auto json = nlohmann::json::parse(get(station, request).curriculum().json());
  const auto import_json = [&](const nlohmann::json& value) {
    pb::Request import_request;
    import_request.mutable_import_curriculum()->set_json(value.dump());
    return import_request;
  };
  EXPECT_EQ(get(manager, import_json(json)).curriculum().revision(), 1u);
  auto changed = json;
  changed["name"] = "Renamed";
  EXPECT_EQ(get(manager, import_json(changed)).curriculum().revision(), 2u);
  auto no_profile = json;
  no_profile["exercises"][0]["profile_id"] = "nothing";
  EXPECT_EQ(refusal(manager, import_json(no_profile)), ErrorCode::kNotFound);
  auto no_measure = json;
  no_measure["exercises"][0]["requirements"] = {{{"measure", "beauty"}, {"max", 1}}};
  EXPECT_EQ(refusal(manager, import_json(no_measure)), ErrorCode::kInvalidInput);
  // A refused import changes nothing.
  EXPECT_EQ(get(station, request).curriculum().revision(), 2u);
}

TEST_F(LessonHandlers, aPlanLiesOnItsPatientsSkin) {
  pb::Request list;
  list.mutable_list_curricula();
  pb::Request read;
  read.mutable_get_curriculum()->set_id(get(admin, list).curricula().curricula(0).id());
  auto json = nlohmann::json::parse(get(station, read).curriculum().json());
  const auto planned = [&](double above_m) {
    // the shoulder is a ball; its top, and above that
    auto profile = nlohmann::json::parse(profileText("shoulder-adult"));
    const auto& ball = profile["limb"]["sphere"];
    auto& exercise = json["exercises"][1];
    exercise["profile_id"] = "shoulder-adult";
    exercise["plan"] = {
        {"frame", "LIMB"},
        {"entry_m",
         {{"x", 0}, {"y", 0}, {"z", double(ball["center_m"]["z"]) + double(ball["radius_m"]) + above_m}}},
        {"direction", {{"x", 0}, {"y", 0}, {"z", -1}}}};
    return json.dump();
  };
  const auto import_text = [](const std::string& text) {
    pb::Request request;
    request.mutable_import_curriculum()->set_json(text);
    return request;
  };
  const auto checked = [&](const std::string& text) {
    pb::Request request;
    request.mutable_check_text()->set_kind("course");
    request.mutable_check_text()->set_json(text);
    return get(manager, request).text_check();
  };
  const std::string expected = "(0, 0, 5) mm is 5 mm above the skin of profile 'shoulder-adult'";
  const auto refused = ask(manager, import_text(planned(0.005)));
  ASSERT_TRUE(refused.error.has_value());
  EXPECT_EQ(refused.error->code, ErrorCode::kInvalidInput);
  EXPECT_EQ(refused.error->message.find("curriculum: exercises[1].plan.entry_m: " + expected), 0u)
      << refused.error->message;
  // the editor checks before it saves, and gets the field
  const auto check = checked(planned(0.005));
  EXPECT_FALSE(check.ok());
  ASSERT_EQ(check.problems_size(), 1);
  EXPECT_EQ(check.problems(0).path(), "exercises[1].plan.entry_m");
  EXPECT_EQ(check.problems(0).message().find(expected), 0u) << check.problems(0).message();

  EXPECT_TRUE(checked(planned(0)).ok());
  get(manager, import_text(planned(0)));
  pb::Request lesson;
  lesson.mutable_get_lesson()->set_exercise_id(json["exercises"][1]["id"]);
  const auto exercise = parseExercise(get(station, lesson).lesson().exercise_json(), "exercise");
  ASSERT_OK(exercise);
  EXPECT_TRUE(exercise->has_plan()) << "the station scores by it, too";
}

TEST_F(LessonHandlers, aProfileWhoseSkinLeavesAPlanIsStoredWithAWarning) {
  auto json = nlohmann::json::parse(profileText("shoulder-adult"));
  const auto moved = [&](double up_m) {
    auto other = json;
    auto& ball = other["limb"]["sphere"]["center_m"];
    ball["z"] = double(ball["z"]) + up_m;
    return other.dump();
  };
  const auto warned = [](const auto& warnings, const std::string& words) {
    return std::count_if(warnings.begin(), warnings.end(),
                         [&](const std::string& each) { return each.find(words) != std::string::npos; });
  };
  const auto checked = [&](const std::string& text) {
    pb::Request request;
    request.mutable_check_text()->set_kind("profile");
    request.mutable_check_text()->set_json(text);
    return get(manager, request).text_check();
  };
  // within a millimetre the plan still begins at the skin
  EXPECT_EQ(get(manager, import(moved(0.0009))).profile().warnings_size(), 0);
  const std::string sunk =
      "exercise 'shoulder-bursa' of course 'rheumatology-basics': plan.entry_m: (0, 0, 0) mm is 3 mm above "
      "the skin of profile 'shoulder-adult'";
  // the editor reports it before saving
  const auto check = checked(moved(-0.003));
  EXPECT_TRUE(check.ok());
  EXPECT_EQ(warned(check.warnings(), sunk), 1);
  const auto stored = get(manager, import(moved(-0.003))).profile();
  EXPECT_EQ(stored.revision(), 3u) << "a warning refuses nothing";
  ASSERT_EQ(stored.warnings_size(), 1);
  EXPECT_EQ(stored.warnings(0).find(sunk), 0u) << stored.warnings(0);
  EXPECT_EQ(warned(get(manager, import(moved(0.0021))).profile().warnings(), "is 2.1 mm below the skin"), 1);
  // no warning for another profile
  EXPECT_EQ(get(manager, import(profileText("knee-adult"))).profile().warnings_size(), 0);
  EXPECT_EQ(get(manager, import(json.dump())).profile().warnings_size(), 0) << "it is back";
}

TEST_F(LessonHandlers, assignmentsAreSeenByTheirTrainee) {
  addPerson("anna", pb::TRAINEE);
  addPerson("ben", pb::TRAINEE);
  for (const char* name : {"anna", "ben"}) {
    pb::Request assign;
    assign.mutable_assign()->set_trainee(name);
    assign.mutable_assign()->set_exercise_id(exerciseId());
    get(instructor, assign);
  }
  pb::Request list;
  list.mutable_list_assignments();
  EXPECT_EQ(get(instructor, list).assignments().assignments_size(), 2);
  ASSERT_EQ(get(trainee, list).assignments().assignments_size(), 1);
  EXPECT_EQ(get(trainee, list).assignments().assignments(0).by(), "ina");
  list.mutable_list_assignments()->set_trainee("ben");
  EXPECT_EQ(refusal(trainee, list), ErrorCode::kDenied);
  EXPECT_EQ(get(station, list).assignments().assignments_size(), 1);
}

}  // namespace
}  // namespace needlelab
