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
  EXPECT_EQ(refusal(station, request), ErrorCode::kDenied);
}

TEST_F(LessonHandlers, anImportedProfileIsCanonicalAndGetsRevisions) {
  auto json = nlohmann::json::parse(profileText("knee-adult"));
  // The same content in another layout is the same revision.
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
