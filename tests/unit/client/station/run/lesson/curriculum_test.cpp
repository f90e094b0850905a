#include "client/station/run/lesson/curriculum.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "client/station/run/lesson/list_exercises.h"
#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

// a server with two courses; tom is in a group that is assigned the first, and has an exercise of the second
class CurriculumTest : public testing::Test {
 protected:
  CurriculumTest() { fs::create_directories(folder_.path() / "lessons"); }

  Result<pb::Reply> answer(const pb::Request& request) {
    asked_.push_back(request);
    pb::Reply reply;
    switch (request.call_case()) {
      case pb::Request::kListCurricula:
        for (const char* id : {"a", "b"}) {
          auto* course = reply.mutable_curricula()->add_curricula();
          course->set_id(id);
          course->set_name(std::string("Course ") + id);
        }
        return reply;
      case pb::Request::kGetCurriculum: {
        const std::string course = request.get_curriculum().id();
        nlohmann::json exercises = nlohmann::json::array();
        for (const char* number : {"1", "2"})
          exercises.push_back({{"id", course + number}, {"name", "Exercise " + course + number}});
        nlohmann::json text = rules_.is_object() && course == "b" ? rules_ : nlohmann::json::object();
        text["exercises"] = exercises;
        reply.mutable_curriculum()->set_json(text.dump());
        return reply;
      }
      case pb::Request::kListAssignments: {
        auto* list = reply.mutable_assignments();
        if (request.list_assignments().page().empty()) {
          auto* of_group = list->add_assignments();
          of_group->set_group_id("class");
          of_group->set_course_id("a");
          list->set_next_page("2");
        } else {
          auto* single = list->add_assignments();
          single->set_trainee("tom");
          single->set_exercise_id("b2");
        }
        return reply;
      }
      case pb::Request::kGetResults:
        if (lists_people_) addResults(request.get_results(), *reply.mutable_results());
        return reply;
      default:
        return Error{ErrorCode::kFailed, "not expected"};
    }
  }
  static void addResults(const pb::GetResults& call, pb::Results& results) {
    if (call.trainee().empty()) {
      // a page per name; the second course has one more
      const bool first = call.page().empty();
      auto* row = results.add_rows();
      row->set_trainee(!first ? "zoe" : call.course_id() == "a" ? "tom" : "mia");
      row->set_person_ref("@" + row->trainee());
      row->set_full_name(!first ? "Zoe Zimmer" : call.course_id() == "a" ? "Tom Tailor" : "");
      if (first) results.set_next_page("next");
      return;
    }
    auto* row = results.add_rows();
    row->set_trainee(call.trainee());
    auto* done = row->add_cells();
    done->set_exercise_id(call.course_id() + "1");
    done->set_done(true);
    done->set_attempts(3);
    auto* locked = row->add_cells();
    locked->set_exercise_id(call.course_id() + "2");
    locked->add_locked_by(call.course_id() + "1");
    locked->set_attempts_left(2);
    locked->set_due_unix_ns(77);
  }
  AskServer ask() {
    return [this](const pb::Request& request) { return answer(request); };
  }
  static StepStanding doneStep(const std::string& id) { return {id, true, 3, {}, std::nullopt, 0}; }
  static StepStanding lockedStep(const std::string& id, const std::string& by) {
    return {id, false, 0, {by}, 2, 77};
  }

  TempFolder folder_;
  const fs::path key_file_ = folder_.write("station.key", "station-1:" + std::string(64, '0') + "\n");
  CurriculumCache cache_{folder_.path(), key_file_};
  Curriculum curriculum_;
  std::vector<pb::Request> asked_;
  bool lists_people_ = true;
  nlohmann::json rules_;  // for the second course
};

TEST_F(CurriculumTest, exercisesKnowTheirCourses) {
  const auto exercises = exercisesBy(ask());
  ASSERT_TRUE(exercises.ok());
  std::vector<std::string> seen;
  for (const ServerExercise& one : *exercises) seen.push_back(one.exercise_id + " of " + one.course);
  EXPECT_THAT(seen, ElementsAre("a1 of Course a", "a2 of Course a", "b1 of Course b", "b2 of Course b"));
}

TEST_F(CurriculumTest, namesOfAllCoursesAndPagesAndTheStandingOfOne) {
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  EXPECT_THAT(curriculum_.trainees,
              ElementsAre(KnownTrainee{"mia", "", "@mia"}, KnownTrainee{"tom", "Tom Tailor", "@tom"},
                          KnownTrainee{"zoe", "Zoe Zimmer", "@zoe"}));
  ASSERT_EQ(curriculum_.standings.size(), 1u);
  const TraineeStanding& tom = curriculum_.standings.at("tom");
  EXPECT_EQ(tom.as_of_unix_ns, 42);
  EXPECT_THAT(tom.courses, ElementsAre("a")) << "by the group";
  EXPECT_THAT(tom.exercises, ElementsAre("b2")) << "of the second page";
  EXPECT_THAT(tom.steps,
              ElementsAre(doneStep("a1"), lockedStep("a2", "a1"), doneStep("b1"), lockedStep("b2", "b1")));
  for (const pb::Request& request : asked_) {
    if (!request.has_get_results()) continue;
    EXPECT_THAT(request.get_results().trainee(), testing::AnyOf("", "tom"));
  }
}

TEST_F(CurriculumTest, exercisesKnowWhetherTheyAreForAssigneesOnly) {
  for (const nlohmann::json& rules :
       {nlohmann::json::object(), nlohmann::json{{"assigned_only", true}}, nlohmann::json{{"exam", true}}}) {
    rules_ = rules;
    ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
    ASSERT_TRUE(cache_.keep(curriculum_).ok());
    for (const std::vector<ServerExercise>& exercises : {curriculum_.exercises, cache_.find().exercises}) {
      ASSERT_EQ(exercises.size(), 4u);
      EXPECT_FALSE(exercises[0].assigned_only);
      EXPECT_EQ(exercises[2].assigned_only, !rules.empty());
      EXPECT_EQ(exercises[2].exam, rules.contains("exam"));
    }
    // tom has the exercise b2, but not b1
    const TraineeStanding* const tom = &curriculum_.standings.at("tom");
    EXPECT_EQ(canStart(curriculum_.exercises[2], tom), rules.empty());
    EXPECT_TRUE(canStart(curriculum_.exercises[3], tom));
    EXPECT_EQ(canStart(curriculum_.exercises[3], nullptr), rules.empty());
  }
}

TEST_F(CurriculumTest, aStartedAttemptCountsUntilTheServerCountsMore) {
  rules_ = {{"exam", true}};
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  const auto stepOf = [&](const std::string& id) {
    const Curriculum kept = cache_.find();
    for (const StepStanding& step : kept.standings.at("tom").steps)
      if (step.exercise_id == id) return step;
    throw std::logic_error("no step " + id);
  };
  ASSERT_TRUE(cache_.keepBegun("tom", "a1").ok());
  EXPECT_EQ(stepOf("a1").attempts, 4u);
  EXPECT_THAT(stepOf("a2").locked_by, ElementsAre("a1")) << "to be passed first";
  ASSERT_TRUE(cache_.keepBegun("tom", "b1").ok());
  EXPECT_THAT(stepOf("b2").locked_by, ElementsAre()) << "an exam's have to be taken";
  for (const std::uint32_t left : {1u, 0u, 0u}) {
    ASSERT_TRUE(cache_.keepBegun("tom", "b2").ok());
    EXPECT_EQ(stepOf("b2").attempts_left, left);
  }
  EXPECT_TRUE(stepOf("b2").done) << "taken";
  // nothing is known about other trainees and exercises outside the courses
  ASSERT_TRUE(cache_.keepBegun("zoe", "b2").ok());
  ASSERT_TRUE(cache_.keepBegun("tom", "").ok());
  EXPECT_EQ(cache_.find().standings.size(), 1u);
  Curriculum again = cache_.find();
  ASSERT_TRUE(updateCurriculum(again, ask(), "tom", 43).ok());
  ASSERT_TRUE(cache_.keep(again).ok());
  EXPECT_EQ(stepOf("b2").attempts_left, 2u) << "the server counts";
}

TEST_F(CurriculumTest, whoIsNotListedAnyMoreIsForgotten) {
  curriculum_.standings["mia"].as_of_unix_ns = 1;
  curriculum_.standings["left"].as_of_unix_ns = 1;
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "", 42).ok());
  EXPECT_EQ(curriculum_.standings.count("mia"), 1u);
  EXPECT_EQ(curriculum_.standings.count("left"), 0u);
}

TEST_F(CurriculumTest, anErrorChangesNothing) {
  curriculum_.standings["left"].as_of_unix_ns = 1;
  const AskServer away = [](const pb::Request&) -> Result<pb::Reply> {
    return Error{ErrorCode::kUnavailable, "away"};
  };
  EXPECT_EQ(updateCurriculum(curriculum_, away, "tom", 42).error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(curriculum_.standings.count("left"), 1u);
}

TEST_F(CurriculumTest, theCacheReturnsWhatWasStored) {
  EXPECT_TRUE(cache_.find().exercises.empty()) << "nothing is kept yet";
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  const Curriculum found = cache_.find();
  ASSERT_EQ(found.exercises.size(), curriculum_.exercises.size());
  for (std::size_t i = 0; i < found.exercises.size(); ++i) {
    EXPECT_EQ(found.exercises[i].exercise_id, curriculum_.exercises[i].exercise_id);
    EXPECT_EQ(found.exercises[i].name, curriculum_.exercises[i].name);
    EXPECT_EQ(found.exercises[i].course_id, curriculum_.exercises[i].course_id);
    EXPECT_EQ(found.exercises[i].course, curriculum_.exercises[i].course);
  }
  EXPECT_EQ(found.trainees, curriculum_.trainees);
  EXPECT_EQ(found.standings, curriculum_.standings);
  EXPECT_TRUE(LessonCache(folder_.path()).list().empty()) << "it is not a lesson";
}

TEST_F(CurriculumTest, aDamagedCacheIsNoCache) {
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  const fs::path file = folder_.path() / "lessons" / "curriculum.cache";
  const std::string good = *readWholeFile(file);
  std::string flipped = good;
  flipped[good.size() / 2] = static_cast<char>(flipped[good.size() / 2] ^ 1);
  for (const std::string& bad : {flipped, good.substr(0, good.size() / 2), std::string(), std::string("\n"),
                                 std::string(5000, '['), std::string("[1]\n{}")}) {
    folder_.write("lessons/curriculum.cache", bad);
    EXPECT_TRUE(cache_.find().exercises.empty()) << bad.substr(0, 80);
    EXPECT_TRUE(cache_.find().standings.empty()) << bad.substr(0, 80);
  }
}

TEST_F(CurriculumTest, theCacheNamesPeopleToTheKeyOfTheStationOnly) {
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  const std::string file = *readWholeFile(folder_.path() / "lessons" / "curriculum.cache");
  for (const char* const text : {"Tom Tailor", "Zoe Zimmer", "full_name"})
    EXPECT_EQ(file.find(text), std::string::npos) << text;
  const fs::path other = folder_.write("other.key", "station-1:" + std::string(64, '1') + "\n");
  for (const fs::path& key_file : {other, fs::path(), folder_.path() / "none.key"}) {
    const CurriculumCache without(folder_.path(), key_file);
    EXPECT_TRUE(without.find().trainees.empty()) << key_file;
  }
  EXPECT_EQ(cache_.find().trainees, curriculum_.trainees);
}

TEST_F(CurriculumTest, theCacheForgetsTraineesThatTheServerNoLongerLists) {
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  curriculum_.trainees.push_back({"eva", "Eva Erased", "@eva"});
  curriculum_.standings["eva"].as_of_unix_ns = 41;
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  Curriculum kept = cache_.find();
  ASSERT_EQ(personOf(kept.trainees, "eva"), "@eva");
  ASSERT_TRUE(updateCurriculum(kept, ask(), "", 43).ok());
  ASSERT_TRUE(cache_.keep(kept).ok());
  EXPECT_EQ(personOf(cache_.find().trainees, "eva"), "");
  EXPECT_EQ(cache_.find().standings.count("eva"), 0u);
}

TEST_F(CurriculumTest, theCacheKeepsTheNewestStandings) {
  curriculum_.exercises.push_back({"a1", "", "", "", "a", "A"});
  for (int i = 0; i < 600; ++i) curriculum_.standings["t" + std::to_string(i)].as_of_unix_ns = 1000 + i;
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  const Curriculum found = cache_.find();
  EXPECT_EQ(found.standings.size(), 500u);
  EXPECT_EQ(found.standings.count("t99"), 0u);
  EXPECT_EQ(found.standings.count("t100"), 1u);
}

TEST_F(CurriculumTest, theCacheKnowsWhoIsAskedForACode) {
  EXPECT_FALSE(cache_.asksCode("tom")) << "nothing is kept yet";
  ASSERT_TRUE(cache_.keepAsksCode("tom", true).ok());
  ASSERT_TRUE(cache_.keepAsksCode("guido", true).ok());
  EXPECT_TRUE(cache_.asksCode("tom"));
  EXPECT_FALSE(cache_.asksCode("zoe"));
  EXPECT_TRUE(cache_.find().exercises.empty());
  // an update of courses and trainees keeps it, except for trainees who are no longer listed
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  EXPECT_TRUE(cache_.asksCode("tom"));
  EXPECT_FALSE(cache_.asksCode("guido"));
  // and keepAsksCode() keeps courses and trainees
  ASSERT_TRUE(cache_.keepAsksCode("zoe", true).ok());
  EXPECT_EQ(cache_.find().trainees, curriculum_.trainees);
  EXPECT_EQ(cache_.find().standings, curriculum_.standings);
  ASSERT_TRUE(cache_.keepAsksCode("tom", false).ok());
  EXPECT_FALSE(cache_.asksCode("tom"));
  EXPECT_TRUE(cache_.asksCode("zoe"));
}

TEST_F(CurriculumTest, anEmptyTraineeListKeepsCodesInTheCache) {
  ASSERT_TRUE(cache_.keepAsksCode("tom", true).ok());
  lists_people_ = false;
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  ASSERT_TRUE(cache_.keep(curriculum_).ok());
  EXPECT_TRUE(cache_.asksCode("tom"));
}

TEST(ShownName, isTheFullNameAndTheAccountWhereTwoShareIt) {
  const std::vector<KnownTrainee> trainees = {
      {"ann1", "Ann Bell"}, {"ann2", "Ann Bell"}, {"cem", "Cem Dal"}, {"eve", ""}};
  EXPECT_EQ(shownName(trainees, "cem"), "Cem Dal");
  EXPECT_EQ(shownName(trainees, "ann1"), "Ann Bell (ann1)");
  EXPECT_EQ(shownName(trainees, "ann2"), "Ann Bell (ann2)");
  EXPECT_EQ(shownName(trainees, "eve"), "eve");
  EXPECT_EQ(shownName(trainees, "guest"), "guest");
  for (const KnownTrainee& one : trainees)
    EXPECT_EQ(accountOf(trainees, shownName(trainees, one.name)), one.name);
  EXPECT_EQ(accountOf(trainees, "cem"), "cem") << "an account is meant before a full name";
  EXPECT_EQ(accountOf(trainees, "Ann Bell"), "Ann Bell") << "two people: neither is meant";
}

TEST(ListExercises, examExercisesAreMarkedOnlineAndOffline) {
  CachedLesson kept{"k", "The kept", "p", 1, 0, ""};
  kept.exam = true;
  ServerExercise exam{"e", "The exam", "p", ""};
  exam.exam = true;
  const auto exercises = listExercises({kept}, std::vector<ServerExercise>{exam, {"f", "The free", "p", ""}});
  const std::string text = exerciseListText(exercises, 0);
  EXPECT_THAT(text, testing::HasSubstr("e         The exam  exam  not yet"));
  EXPECT_THAT(text, testing::HasSubstr("f         The free        not yet"));
  EXPECT_THAT(text, testing::HasSubstr("k         The kept  exam  yes"));
  const auto json = nlohmann::json::parse(exerciseListJson(exercises));
  EXPECT_EQ(json["rows"][0]["exam"], true);
  EXPECT_EQ(json["rows"][1]["exam"], false);
}

TEST_F(CurriculumTest, theListsRowsHaveTheLaddersColumns) {
  ASSERT_TRUE(updateCurriculum(curriculum_, ask(), "tom", 42).ok());
  const auto exercises = listExercises({}, curriculum_.exercises);
  const auto json = nlohmann::json::parse(exerciseListJson(exercises, ladderOf(curriculum_, "tom", 50)));
  const auto& row = json["rows"][1];
  EXPECT_EQ(row["exercise_id"], "a2");
  EXPECT_EQ(row["section"], "Course a");
  EXPECT_EQ(row["step"], 2);
  EXPECT_EQ(row["state"], "locked");
  EXPECT_EQ(row["locked_by"], "step 1");
  EXPECT_EQ(row["attempts_left"], 2);
  EXPECT_EQ(row["due_unix_ns"], 77);
  EXPECT_EQ(row["as_of_unix_ns"], 42);
  EXPECT_EQ(json["rows"][3]["section"], "Assigned to you");
  EXPECT_TRUE(json["rows"][3]["step"].is_null());
  const auto without = nlohmann::json::parse(exerciseListJson(exercises));
  EXPECT_FALSE(without["rows"][1].contains("state")) << "as before without a trainee";
}

}  // namespace
}  // namespace needlelab::test
