#include "db/teaching/documents.h"
#include "db/people/people.h"
#include "db/teaching/assignments.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

StoredProfile profile(const std::string& id, const std::string& json) {
  return {id, 0, "A knee", json, "bea", 9};
}

TEST(Documents, anotherTextIsANewRevisionAndTheOldOneStays) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 1u);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":2}")), 2u);
  EXPECT_EQ(profiles.get("knee", 1)->json, "{\"a\":1}");
  EXPECT_EQ(profiles.get("knee", 2)->json, "{\"a\":2}");
  EXPECT_EQ(profiles.get("knee", 0)->revision, 2u);
  // Restoring an old text is also a change.
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 3u);
}

TEST(Documents, theSameTextKeepsItsRevision) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 1u);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 1u);
  EXPECT_EQ(*profiles.put(profile("wrist", "{\"a\":1}")), 1u);
  const auto list = profiles.list();
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].id, "knee");
  EXPECT_EQ((*list)[0].author, "bea");
}

TEST(Documents, whatIsNotThereIsNamed) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  ASSERT_OK(profiles.put(profile("knee", "{}")));
  const auto missing = profiles.get("elbow", 0);
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_NE(missing.error().message.find("'elbow'"), std::string::npos);
  EXPECT_NE(profiles.get("knee", 9).error().message.find("revision 9"), std::string::npos);
}

TEST(Documents, hugeOrEmptyFieldsAreRefused) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_FALSE(profiles.put(profile("", "{}")).ok());
  EXPECT_FALSE(profiles.put(profile(std::string(65, 'x'), "{}")).ok());
  EXPECT_FALSE(profiles.put(profile("knee", "")).ok());
  EXPECT_FALSE(profiles.put(profile("knee", std::string(1'000'000, ' '))).ok());
}

TEST(Documents, aNameWithInvisibleCharactersIsRefused) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_FALSE(profiles.put({"kn\u200bee", 0, "A knee", "{}", "bea", 1}).ok());
  const auto refused = profiles.put({"knee", 0, "A \u2066knee", "{}", "bea", 1});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().message.rfind(
                "profile name: contains the invisible character U+2066 (left-to-right isolate) at byte 3", 0),
            0u)
      << refused.error().message;
  EXPECT_OK(profiles.put({"knee", 0, "ברך", "{}", "bea", 1}));
}

class CurriculumStoreTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_OK(ProfileStore(db.writer).put({"knee", 0, "A knee", "{}", "bea", 1})); }
  static StoredCurriculum curriculum(const std::string& id, const std::string& json,
                                     const std::vector<std::string>& exercises,
                                     const std::string& profile = "knee") {
    StoredCurriculum result{id, 0, "Basics", json, "bea", 1, {}};
    for (const auto& exercise : exercises)
      result.exercises.push_back({exercise, "", "Name of " + exercise, profile, "{}"});
    return result;
  }
  test::TestDb db;
  CurriculumStore store{db.writer};
};

TEST_F(CurriculumStoreTest, theNewestRevisionsExercisesCount) {
  EXPECT_EQ(*store.put(curriculum("basics", "{1}", {"b", "a"})), 1u);
  EXPECT_EQ(*store.put(curriculum("basics", "{1}", {"b", "a"})), 1u);
  EXPECT_EQ(*store.put(curriculum("basics", "{2}", {"c", "b"})), 2u);
  const auto got = store.get("basics");
  ASSERT_OK(got);
  EXPECT_EQ(got->json, "{2}");
  ASSERT_EQ(got->exercises.size(), 2u);
  EXPECT_EQ(got->exercises[0].id, "c");
  EXPECT_EQ(got->exercises[1].id, "b");
  EXPECT_EQ(store.exercise("b")->curriculum_id, "basics");
  EXPECT_EQ(store.exercise("a").error().code, ErrorCode::kNotFound);
  ASSERT_EQ(store.list()->size(), 1u);
  EXPECT_EQ(store.list()->front().exercises.size(), 2u);
}

TEST_F(CurriculumStoreTest, unknownProfilesAndTakenExerciseIdsAreRefused) {
  EXPECT_EQ(store.put(curriculum("basics", "{}", {"a"}, "elbow")).error().code, ErrorCode::kNotFound);
  ASSERT_OK(db.writer.script("DELETE FROM curricula; DELETE FROM exercises"));
  ASSERT_OK(store.put(curriculum("basics", "{}", {"a"})));
  const auto taken = store.put(curriculum("other", "{}", {"a"}));
  ASSERT_FALSE(taken.ok());
  EXPECT_EQ(taken.error().code, ErrorCode::kAlreadyExists);
  EXPECT_NE(taken.error().message.find("'basics'"), std::string::npos) << taken.error().message;
}

TEST_F(CurriculumStoreTest, titlesWithInvisibleCharactersAreRefused) {
  StoredCurriculum course = curriculum("basics", "{}", {"a"});
  course.exercises[0].name = "Easy\u202e";
  const auto refused = store.put(course);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().message.rfind(
                "curriculum 'basics', exercise 'a', name: contains the invisible character U+202E", 0),
            0u)
      << refused.error().message;
  course.exercises[0].name = "Easy";
  course.name = "Bas\u200bics";
  EXPECT_FALSE(store.put(course).ok());
}

TEST_F(CurriculumStoreTest, assignsExercisesToTrainees) {
  ASSERT_OK(store.put(curriculum("basics", "{}", {"a", "b"})));
  ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1}));
  ASSERT_OK(PeopleStore(db.writer).add({"ina", pb::INSTRUCTOR, "", false, 1}));
  AssignmentStore assignments(db.writer);
  const auto assign = [&](const std::string& trainee, const std::string& exercise, std::int64_t created) {
    pb::Assignment a;
    a.set_trainee(trainee);
    a.set_exercise_id(exercise);
    a.set_by("ina");
    a.set_created_unix_ns(created);
    return assignments.put(a);
  };
  ASSERT_OK(assign("anna", "a", 10));
  ASSERT_OK(assign("anna", "b", 20));
  EXPECT_EQ(assign("anna", "a", 30)->id(), 1u);
  const auto list = assignments.list({"anna", "", ""});
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  // by number, newest first
  EXPECT_EQ((*list)[0].exercise_id(), "b");
  EXPECT_EQ((*list)[1].exercise_id(), "a");
  EXPECT_EQ((*list)[1].created_unix_ns(), 30);
  EXPECT_EQ(assignments.list({})->size(), 2u);
  EXPECT_EQ(assign("nobody", "a", 1).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(assign("ina", "a", 1).error().code, ErrorCode::kInvalidInput);
}

}  // namespace

}  // namespace needlelab
