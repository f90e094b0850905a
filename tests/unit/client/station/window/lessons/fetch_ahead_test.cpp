// What a station fetches while it is not in use: the order, what is fetched again and when, and what is kept.
#include "client/station/window/lessons/fetch_ahead.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "client/net/spool/lesson_cache.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

constexpr std::int64_t kSecond_ns = 1'000'000'000, kHour_ns = 3600 * kSecond_ns;

// Course a with a1 and a2 is assigned, and exercise b2 of course b; tom and zoe are listed.
class FetchAheadTest : public testing::Test {
 protected:
  FetchAheadTest() {
    options_.spool = folder_.path();
    options_.key_file = folder_.write("station.key", "station-1:" + std::string(64, '0') + "\n");
    fs::create_directories(folder_.path() / "lessons");
    Curriculum curriculum;
    for (const char* id : {"a1", "a2", "b1", "b2"}) {
      curriculum.exercises.push_back({id, id, "p", "", std::string(1, id[0]), "Course"});
      ListedExercise listed;
      listed.exercise_id = id;
      lists_.exercises.push_back(listed);
    }
    curriculum.trainees = {{"tom", "Tom Tailor", "@tom"}, {"zoe", "", "@zoe"}};
    lists_.curriculum = std::make_shared<const Curriculum>(std::move(curriculum));
    lists_.assigned_courses = {"a"};
    lists_.assigned_exercises = {"b2"};
    lists_.assignments = 1;
  }
  Result<pb::Reply> answer(const pb::Request& request) {
    if (is_away_) return Error{ErrorCode::kUnavailable, "away"};
    pb::Reply reply;
    if (request.has_get_lesson()) {
      EXPECT_EQ(request.get_lesson().trainee(), "") << "of no one in particular";
      const std::string& id = request.get_lesson().exercise_id();
      asked_.push_back(id);
      if (refused_.contains(id)) return Error{ErrorCode::kNotFound, "no such profile"};
      reply.mutable_lesson()->set_exercise_json(R"({"id": ")" + id + R"("})");
      reply.mutable_lesson()->set_profile_json("{}");
      reply.mutable_lesson()->set_profile_revision(revision_);
    } else if (request.has_list_assignments()) {
      asked_.push_back(request.list_assignments().trainee());
      reply.mutable_assignments()->add_assignments()->set_course_id("a");
    } else if (request.has_get_results()) {
      auto* row = reply.mutable_results()->add_rows();
      row->set_trainee(request.get_results().trainee());
      row->add_cells()->set_exercise_id(request.get_results().course_id() + "1");
    }
    return reply;
  }
  // Steps one second apart until nothing is left; returns what was requested.
  std::vector<std::string> all() {
    asked_.clear();
    for (int steps = 0; steps < 20; ++steps) {
      const auto done = step();
      if (done.ok() && !*done) break;
    }
    return asked_;
  }
  Result<bool> step() {
    now_ns_ += kSecond_ns;
    return ahead_.step(
        lists_, [this](const pb::Request& request) { return answer(request); }, now_ns_);
  }
  [[nodiscard]] std::vector<std::string> kept() const {
    std::vector<std::string> ids;
    for (const CachedLesson& lesson : LessonCache(options_.spool).list()) ids.push_back(lesson.exercise_id);
    return ids;
  }
  [[nodiscard]] Curriculum cached() const {
    return CurriculumCache(options_.spool, options_.key_file).find();
  }

  TempFolder folder_;
  StationOptions options_;
  FetchAhead ahead_{options_};
  StartLists lists_;
  std::int64_t now_ns_ = 1'795'000'000 * kSecond_ns;
  std::uint32_t revision_ = 1;
  bool is_away_ = false;
  std::set<std::string> refused_;
  std::vector<std::string> asked_;
};

TEST_F(FetchAheadTest, allLessonsThatAreAssignedAndThenAllStandings) {
  EXPECT_THAT(all(), ElementsAre("a1", "a2", "b2", "tom", "zoe")) << "b1 is assigned to nobody";
  EXPECT_THAT(kept(), ElementsAre("a1", "a2", "b2"));
  for (const char* name : {"tom", "zoe"}) {
    ASSERT_TRUE(cached().standings.contains(name)) << name;
    EXPECT_THAT(cached().standings.at(name).courses, ElementsAre("a"));
    EXPECT_EQ(cached().standings.at(name).steps.size(), 2u) << "one of each course";
  }
  for (const ListedExercise& listed : lists_.exercises)
    EXPECT_EQ(listed.cached_revision.has_value(), listed.exercise_id != "b1");
  EXPECT_THAT(all(), IsEmpty());
}

TEST_F(FetchAheadTest, oldLessonsAreRefetchedHourlyAndStandingsOnNewAssignments) {
  all();
  revision_ = 2;
  now_ns_ += kHour_ns / 2;
  EXPECT_THAT(all(), IsEmpty());
  lists_.assignments = 2;
  EXPECT_THAT(all(), ElementsAre("tom", "zoe"));
  now_ns_ += kHour_ns / 2;
  EXPECT_THAT(all(), UnorderedElementsAre("a1", "a2", "b2"));
  EXPECT_EQ(LessonCache(options_.spool).find("a1")->profile_revision(), 2u);
  now_ns_ += kHour_ns / 2;
  EXPECT_THAT(all(), UnorderedElementsAre("tom", "zoe"));
}

TEST_F(FetchAheadTest, aRefusedLessonBlocksNothingAndIsRetriedAnHourLater) {
  refused_ = {"a1"};
  EXPECT_THAT(all(), ElementsAre("a1", "a2", "b2", "tom", "zoe"));
  EXPECT_THAT(all(), IsEmpty());
  refused_.clear();
  now_ns_ += kHour_ns;
  EXPECT_EQ(all().front(), "a1");
}

TEST_F(FetchAheadTest, aServerThatGoesAwayIsAskedForTheSameAgain) {
  is_away_ = true;
  EXPECT_EQ(step().error().code, ErrorCode::kUnavailable);
  is_away_ = false;
  EXPECT_EQ(all().front(), "a1");
}

TEST_F(FetchAheadTest, standingsAreKeptByAndByAndWhenALessonBegins) {
  lists_.assigned_courses.clear();
  lists_.assigned_exercises.clear();
  ASSERT_TRUE(*step());
  EXPECT_EQ(cached().standings.size(), 1u) << "the first one at once";
  ASSERT_TRUE(*step());
  EXPECT_EQ(cached().standings.size(), 1u);
  ASSERT_TRUE(ahead_.keep(lists_, now_ns_).ok());
  EXPECT_EQ(cached().standings.size(), 2u);
}

TEST_F(FetchAheadTest, nothingIsAskedForBeforeTheServerGaveItsLists) {
  lists_.assignments = 0;
  EXPECT_THAT(all(), IsEmpty());
  lists_ = {};
  EXPECT_THAT(all(), IsEmpty());
}

}  // namespace
}  // namespace needlelab::test
