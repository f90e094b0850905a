// Which lessons begin without the server, and what a trainee reads about those that do not.
#include <gmock/gmock.h>

#include <filesystem>
#include <memory>

#include "client/net/spool/lesson_cache.h"
#include "client/station/run/lesson/curriculum.h"
#include "client/station/run/station.h"
#include "client/station/run/station_run.h"
#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/uplink/fake_server.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LessonFetchTest : public testing::Test {
 protected:
  LessonFetchTest() {
    sigemptyset(&signals_);
    options_.headless = true;
    options_.servers = {{"127.0.0.1", 1}};  // no server there
    options_.ca_file = FakeServer::caFile();
    options_.key_file = folder_.write("station.key", "station-1:" + std::string(64, '0') + "\n");
    fs::permissions(options_.key_file, fs::perms::owner_read);
    options_.spool = folder_.path() / "spool";
    options_.trainee = "tom";
    options_.exercise = "ball";
    fs::create_directories(options_.spool / "lessons");
  }
  // Stores a lesson as if it came from the server.
  void keep(const std::string& id, bool exam) {
    pb::Lesson lesson;
    lesson.set_exercise_json(R"({"id": ")" + id + R"(", "name": "The )" + id +
                             R"(", "profile_id": "phantom-ball"})");
    lesson.set_profile_json(*readWholeFile(NEEDLELAB_SAMPLES "/phantom-ball.json"));
    lesson.set_profile_revision(1);
    lesson.set_assigned_only(exam);
    lesson.set_exam(exam);
    ASSERT_TRUE(LessonCache(options_.spool).keep(id, lesson).ok());
  }
  // The server's answer for the exam's exercises: ball, followed by box; tom is assigned the exam.
  void keepStandings(std::uint32_t attempts_left) {
    Curriculum curriculum;
    for (const char* id : {"ball", "box"})
      curriculum.exercises.push_back({id, std::string("The ") + id, "phantom-ball", "", "exam", "Exam"});
    for (ServerExercise& exercise : curriculum.exercises) exercise.assigned_only = exercise.exam = true;
    curriculum.trainees = {{"tom", ""}, {"zoe", ""}};
    TraineeStanding& tom = curriculum.standings["tom"];
    tom.courses = {"exam"};
    tom.steps = {{"ball", false, 0, {}, attempts_left, 0}, {"box", false, 0, {"ball"}, 1u, 0}};
    curriculum.standings["zoe"].steps = tom.steps;
    ASSERT_TRUE(CurriculumCache(options_.spool, options_.key_file).keep(curriculum).ok());
  }
  Status prepare() {
    run_.reset();
    home_.reset();
    home_ = std::make_unique<StationHome>(options_, observer_);
    RETURN_IF_ERROR(home_->openSpool());
    RETURN_IF_ERROR(home_->connect());
    run_ = std::make_unique<StationRun>(*home_, options_, signals_, GivenCode{});
    return run_->prepare();
  }
  std::string refusal() {
    const Status prepared = prepare();
    EXPECT_FALSE(prepared.ok());
    return prepared.ok() ? std::string() : prepared.error().message;
  }

  struct SeesAttempts : LessonObserver {
    std::optional<std::uint32_t> left;
    StationLesson lesson;
    void began(std::shared_ptr<const LessonBeginning> beginning) override {
      left = beginning->lesson.attempts_left;
      lesson = beginning->lesson;
    }
  } observer_;
  TempFolder folder_;
  sigset_t signals_{};
  StationOptions options_;
  std::unique_ptr<StationHome> home_;
  std::unique_ptr<StationRun> run_;
};

TEST_F(LessonFetchTest, offLineAnExamHasAsManyAttemptsAsWereLeft) {
  keep("ball", true);
  keepStandings(2);
  for (int attempt = 0; attempt < 2; ++attempt) {
    const Status prepared = prepare();
    ASSERT_TRUE(prepared.ok()) << prepared.error().message;
    EXPECT_EQ(observer_.left, 2u - static_cast<unsigned>(attempt)) << "with this one";
  }
  EXPECT_EQ(refusal(), "\"The ball\": no attempt is left; ask the instructor");
}

TEST_F(LessonFetchTest, offlineAnExamNeedsAKnownAssignment) {
  keep("ball", true);
  EXPECT_THAT(refusal(), HasSubstr("this station does not know that it is assigned to you"));
  keepStandings(1);
  for (const char* name : {"zoe", "guest", "eve"}) {
    options_.trainee = name;
    EXPECT_THAT(refusal(), HasSubstr("\"The ball\" is only for those to whom it is assigned")) << name;
  }
  options_.trainee = "tom";
  EXPECT_TRUE(prepare().ok());
}

TEST_F(LessonFetchTest, offLineAnExamGoesOnInItsOrder) {
  keep("ball", true);
  keep("box", true);
  keepStandings(1);
  options_.exercise = "box";
  EXPECT_THAT(refusal(), HasSubstr("still locked"));
  options_.exercise = "ball";
  ASSERT_TRUE(prepare().ok());
  options_.exercise = "box";
  EXPECT_TRUE(prepare().ok()) << "the earlier one was taken here";
}

TEST_F(LessonFetchTest, offLineOtherLessonsAreForAllWithoutACount) {
  keep("ball", false);
  for (int attempt = 0; attempt < 2; ++attempt) EXPECT_TRUE(prepare().ok());
}

TEST_F(LessonFetchTest, needsForTheServerAreExplainedInTheLabsWords) {
  options_.exercise = "never-fetched";
  // a server that cannot be reached is waited for
  EXPECT_EQ(refusal(), "The server cannot be reached, and no lessons are stored here: ask the instructor.");
  keep("ball", false);
  keep("box", true);
  EXPECT_EQ(refusal(),
            "The server cannot be reached. These lessons are stored here: \"The ball\". Others need the "
            "server: ask the instructor.");
  options_.servers.clear();
  keepStandings(1);  // by the server's last answer, ball now belongs to the exam
  EXPECT_EQ(refusal(),
            "This station has no server. These lessons are stored here: \"The ball\", \"The box\". Others "
            "need the server: ask the instructor.");
  for (int i = 0; i < 9; ++i) keep("x" + std::to_string(i), false);
  EXPECT_THAT(refusal(), HasSubstr("\"The x5\" and 3 more. Others need"));
}

TEST_F(LessonFetchTest, aComputerThatNeverHadAServerHasTheBodiesBuiltIn) {
  options_.servers.clear();
  for (const char* id : {"shoulder-median", "lumbar-heavy"}) {
    options_.exercise = id;
    const Status prepared = prepare();
    ASSERT_TRUE(prepared.ok()) << prepared.error().message;
    ASSERT_TRUE(observer_.lesson.exercise);
    EXPECT_EQ(observer_.lesson.exercise->id(), id);
    EXPECT_EQ(observer_.lesson.profile.id(), id);
    EXPECT_GT(observer_.lesson.exercise->requirements_size(), 0) << "what its verdict is made of";
  }
  options_.exercise = "shoulder-bursa";
  EXPECT_THAT(refusal(), HasSubstr("\"Shoulder: subacromial bursa\", \"Wrist: carpal tunnel\", "));
}

TEST_F(LessonFetchTest, aServersStationHasNoBuiltInLessons) {
  options_.exercise = "shoulder-median";
  EXPECT_EQ(refusal(), "The server cannot be reached, and no lessons are stored here: ask the instructor.");
  keep("ball", false);
  options_.servers.clear();
  EXPECT_EQ(
      refusal(),
      "This station has no server. These lessons are stored here: \"The ball\". Others need the server: "
      "ask the instructor.");
}

}  // namespace
}  // namespace needlelab::test
