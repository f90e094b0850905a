// What is said of a class in the end, and what is refused before it begins.
#include "tests/class/class_run.h"

#include <gmock/gmock.h>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

const std::vector<ClassTrainee> kTwo = {{"anna", 0.1}, {"liam", 0.9}};
const std::vector<std::string> kExercises = {"step-1", "step-2"};

ClassSession session(std::size_t trainee, std::size_t exercise, std::optional<bool> passed) {
  ClassSession s;
  s.plan = {trainee, exercise, 0, kTwo[trainee].skill, 1'700'000'000'000'000'000, 1};
  s.session_id = "id";
  s.samples = 1234;
  s.closed = true;
  s.passed = passed;
  return s;
}

TEST(ClassRun, theTableHasARowASession) {
  ClassSession locked;
  locked.plan = {0, 1, 2, 0.125, 1'700'000'060'000'000'000, 1};
  locked.locked = true;
  locked.trouble = "first pass \"step-1\", then\ncome back";
  EXPECT_EQ(classTable({session(0, 0, false), session(1, 0, std::nullopt), locked}, kTwo, kExercises),
            "session,trainee,exercise,attempt,skill,started_unix_s,samples,closed,passed,trouble\n"
            "id,anna,step-1,1,0.1000,1700000000,1234,1,0,\n"
            "id,liam,step-1,1,0.9000,1700000000,1234,1,,\n"
            ",anna,step-2,3,0.1250,1700000060,0,0,,\"first pass \"\"step-1\"\", then come back\"\n");
}

TEST(ClassRun, theTextCountsByHalves) {
  ClassSession locked;
  locked.plan.exercise = 1;
  locked.locked = true;
  const std::string text =
      classText({session(0, 0, false), session(0, 0, true), session(1, 0, true), locked}, kTwo, kExercises);
  EXPECT_THAT(text, ::testing::ContainsRegex("step-1 +1/2 +1/1 +0\n"));
  EXPECT_THAT(text, ::testing::ContainsRegex("step-2 +0/0 +0/0 +1\n"));
}

TEST(ClassRun, refusesNumbersOutOfRangeByName) {
  ClassOptions options;
  EXPECT_TRUE(checkClass(options).ok());
  options.timetable.attempts = 51;
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--attempts: 51"));
  options.timetable = {};
  options.timetable.weeks = 0;
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--weeks"));
  options.timetable = {};
  options.timetable.practice = 0.6;
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--practice"));
  options.timetable = {};
  options.keys.resize(33);
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--key: 33"));
}

TEST(ClassRun, refusesAnAddressAndAKeyThatAreNone) {
  const test::TempFolder folder;
  sigset_t none;
  ::sigemptyset(&none);
  ClassOptions options;
  options.exercises = kExercises;
  options.server = "127.0.0.1:99999";
  options.keys = {(folder.path() / "missing.key").string()};
  options.spool = folder.path().string();
  EXPECT_THAT(runClass(options, kTwo, none).error().message, HasSubstr("--server"));
  options.server = "127.0.0.1:1";
  const auto refused = runClass(options, kTwo, none);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("missing.key"));
}

}  // namespace
}  // namespace needlelab
