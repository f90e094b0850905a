#include "client/station/run/lesson/ladder.h"

#include <gmock/gmock.h>

#include "tests/support/time_zone.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr std::int64_t kSecond_ns = 1'000'000'000, kHour_ns = 3600 * kSecond_ns, kDay_ns = 24 * kHour_ns;
constexpr std::int64_t kNow_ns = 1'795'000'000 * kSecond_ns;  // 2026-11-18 11:06:40 UTC

StepStanding step(const std::string& id) {
  StepStanding standing;
  standing.exercise_id = id;
  return standing;
}

std::vector<std::string> idsOf(const LadderSection& section) {
  std::vector<std::string> ids;
  for (const LadderStep& one : section.steps) ids.push_back(one.exercise_id);
  return ids;
}

class LadderTest : public testing::Test {
 protected:
  test::WithZone zone_{"UTC"};

  // two courses, of three and two steps
  LadderTest() {
    for (const char* id : {"a1", "a2", "a3"})
      curriculum_.exercises.push_back({id, std::string("The ") + id, "p", "", "a", "Course A"});
    for (const char* id : {"b1", "b2"})
      curriculum_.exercises.push_back({id, std::string("The ") + id, "p", "", "b", "Course B"});
    TraineeStanding& tom = curriculum_.standings["tom"];
    tom.as_of_unix_ns = kNow_ns;
    for (const char* id : {"a1", "a2", "a3", "b1", "b2"}) tom.steps.push_back(step(id));
  }
  TraineeStanding& tom() { return curriculum_.standings["tom"]; }
  StepStanding& standingIn(const std::string& id) {
    for (StepStanding& one : tom().steps)
      if (one.exercise_id == id) return one;
    throw std::logic_error("there is no " + id);
  }
  [[nodiscard]] Ladder ladder(const std::string& who = "tom") const {
    return ladderOf(curriculum_, who, kNow_ns);
  }
  [[nodiscard]] LadderStep stepIn(const std::string& id) const {
    for (const LadderSection& section : ladder().sections)
      for (const LadderStep& one : section.steps)
        if (one.exercise_id == id) return one;
    ADD_FAILURE() << "no step " << id;
    return {};
  }

  Curriculum curriculum_;
};

TEST_F(LadderTest, aCourseIsAHeadingWithNumberedSteps) {
  tom().courses = {"a", "b"};
  const Ladder made = ladder();
  ASSERT_EQ(made.sections.size(), 2u);
  EXPECT_EQ(made.sections[0].heading, "Course A");
  EXPECT_THAT(idsOf(made.sections[0]), ElementsAre("a1", "a2", "a3"));
  EXPECT_EQ(made.sections[1].heading, "Course B");
  for (const LadderSection& section : made.sections)
    for (std::size_t i = 0; i < section.steps.size(); ++i)
      EXPECT_EQ(section.steps[i].number, static_cast<int>(i) + 1) << section.steps[i].exercise_id;
}

TEST_F(LadderTest, assignedCoursesThenSingleExercisesThenWhatMayBePractisedFreely) {
  tom().courses = {"b"};
  tom().exercises = {"a2"};
  const Ladder made = ladder();
  ASSERT_EQ(made.sections.size(), 3u);
  EXPECT_EQ(made.sections[0].heading, "Course B");
  EXPECT_EQ(made.sections[1].heading, "Assigned to you");
  EXPECT_THAT(idsOf(made.sections[1]), ElementsAre("a2"));
  EXPECT_EQ(made.sections[1].steps[0].number, 0) << "outside its course it is not a step";
  EXPECT_EQ(made.sections[2].heading, "Practise freely: Course A");
  EXPECT_THAT(idsOf(made.sections[2]), ElementsAre("a1", "a3"));
  EXPECT_EQ(made.sections[2].steps[1].number, 3) << "the number is the course's";
}

TEST_F(LadderTest, anExerciseOfAnAssignedCourseIsListedOnce) {
  tom().courses = {"a"};
  tom().exercises = {"a2"};
  const Ladder made = ladder();
  ASSERT_EQ(made.sections.size(), 2u);
  EXPECT_THAT(idsOf(made.sections[0]), ElementsAre("a1", "a2", "a3"));
}

TEST_F(LadderTest, anAssignedOnlyCourseIsShownToItsAssigneesOnly) {
  for (ServerExercise& exercise : curriculum_.exercises) exercise.assigned_only = exercise.course_id == "a";
  const auto headings = [&](const std::string& who) {
    std::vector<std::string> all;
    for (const LadderSection& section : ladder(who).sections) all.push_back(section.heading);
    return all;
  };
  EXPECT_THAT(headings("tom"), ElementsAre("Practise freely: Course B"));
  EXPECT_THAT(headings("no one is known so"), ElementsAre("Course B"));
  tom().exercises = {"a2"};
  EXPECT_THAT(headings("tom"), ElementsAre("Assigned to you", "Practise freely: Course B"));
  EXPECT_THAT(idsOf(ladder().sections[0]), ElementsAre("a2"));
  tom().courses = {"a"};
  EXPECT_THAT(idsOf(ladder().sections[0]), ElementsAre("a1", "a2", "a3"));
}

TEST_F(LadderTest, aStepOfAnExamIsMarked) {
  for (ServerExercise& exercise : curriculum_.exercises) exercise.exam = exercise.course_id == "a";
  tom().courses = {"b"};
  tom().exercises = {"a2"};
  standingIn("a2").attempts_left = 1;
  EXPECT_EQ(stepText(stepIn("a2")), "exam · not begun · 1 attempt left");
  EXPECT_EQ(stepText(stepIn("a1")), "exam · not begun");
  EXPECT_EQ(stepText(stepIn("b1")), "Next");
}

TEST_F(LadderTest, onlyTheFirstOpenAssignedStepIsNext) {
  tom().courses = {"b"};
  tom().exercises = {"a3"};
  EXPECT_EQ(ladder().next, "b1") << "not a1, which may only be practised freely";
  standingIn("b1").done = true;
  EXPECT_EQ(ladder().next, "b2");
  EXPECT_EQ(stepIn("b1").state, StepState::kDone);
  EXPECT_EQ(stepIn("b2").state, StepState::kNext);
  EXPECT_EQ(stepIn("a3").state, StepState::kOpen);
  standingIn("b2").locked_by = {"a1"};
  EXPECT_EQ(ladder().next, "a3");
  standingIn("a3").attempts_left = 0;
  EXPECT_EQ(ladder().next, "");
}

TEST_F(LadderTest, aLockNamesTheStepOrTheExerciseElsewhere) {
  tom().courses = {"a"};
  tom().exercises = {"b2"};
  standingIn("a3").locked_by = {"a1", "a2"};
  standingIn("b2").locked_by = {"b1"};
  standingIn("a2").locked_by = {"b1", "gone"};
  EXPECT_EQ(stepIn("a3").locked_by, "step 1, step 2");
  EXPECT_EQ(stepIn("a3").state, StepState::kLocked);
  EXPECT_FALSE(stepIn("a3").may_begin);
  EXPECT_EQ(stepText(stepIn("a3")), "locked by step 1, step 2");
  EXPECT_EQ(stepIn("b2").locked_by, "\"The b1\"") << "not beside the steps of its course";
  EXPECT_EQ(stepIn("a2").locked_by, "\"The b1\", \"gone\"");
}

TEST_F(LadderTest, remainingAttemptsAreShownAndNoneLeftClosesTheStep) {
  tom().courses = {"a", "b"};
  standingIn("a1").attempts_left = 2;
  standingIn("a2").attempts_left = 1;
  standingIn("a3").attempts_left = 0;
  standingIn("b1").done = true;
  standingIn("b1").attempts_left = 0;
  EXPECT_EQ(stepText(stepIn("a1")), "Next · 2 attempts left");
  EXPECT_EQ(stepText(stepIn("a2")), "not begun · 1 attempt left");
  EXPECT_EQ(stepIn("a3").state, StepState::kUsedUp);
  EXPECT_FALSE(stepIn("a3").may_begin);
  EXPECT_EQ(stepText(stepIn("a3")), "no attempt left, ask your instructor");
  EXPECT_EQ(stepIn("b1").state, StepState::kDone);
  EXPECT_FALSE(stepIn("b1").may_begin) << "the server refuses it";
  EXPECT_EQ(stepText(stepIn("b1")), "done · no attempt left");
  EXPECT_EQ(stepText(stepIn("b2")), "not begun") << "unlimited";
}

TEST_F(LadderTest, whatWasTriedInVainIsNotCalledOpen) {
  tom().courses = {"a", "b"};
  standingIn("a1").attempts = 1;
  standingIn("a2").attempts = 3;
  standingIn("a2").attempts_left = 2;
  standingIn("b1").attempts = 2;
  standingIn("b1").done = true;
  EXPECT_EQ(stepText(stepIn("a1")), "Next · not passed, 1 attempt");
  EXPECT_EQ(stepText(stepIn("a2")), "not passed, 3 attempts · 2 attempts left");
  EXPECT_EQ(stepText(stepIn("a3")), "not begun");
  EXPECT_EQ(stepText(stepIn("b1")), "done");
}

TEST_F(LadderTest, aDateIsLaterSoonOverOrOfNoMatterOnceDone) {
  tom().courses = {"a", "b"};
  standingIn("a1").due_unix_ns = kNow_ns + 3 * kDay_ns + 1;
  standingIn("a2").due_unix_ns = kNow_ns + 3 * kDay_ns;
  standingIn("a3").due_unix_ns = kNow_ns - 1;
  standingIn("b1").due_unix_ns = kNow_ns - kDay_ns;
  standingIn("b1").done = true;
  EXPECT_EQ(stepIn("a1").due, DueState::kLater);
  EXPECT_EQ(stepIn("a2").due, DueState::kSoon);
  EXPECT_EQ(stepIn("a3").due, DueState::kOver);
  EXPECT_EQ(stepIn("b1").due, DueState::kNone);
  EXPECT_EQ(stepIn("b2").due, DueState::kNone);
  EXPECT_EQ(stepText(stepIn("a1")), "Next · due 2026-11-21 11:06");
  EXPECT_EQ(stepText(stepIn("a2")), "not begun · due soon: 2026-11-21 11:06");
  EXPECT_EQ(stepText(stepIn("a3")), "not begun · overdue since 2026-11-18 11:06");
  EXPECT_EQ(stepText(stepIn("b1")), "done");
}

TEST_F(LadderTest, aDateIsInLocalTime) {
  LadderStep step;
  step.state = StepState::kOpen;
  step.due = DueState::kLater;
  step.due_unix_ns = 1'794'996'000 * kSecond_ns;  // 2026-11-18 10:00 UTC
  EXPECT_EQ(stepText(step), "not begun · due 2026-11-18 10:00");
  const test::WithZone zone("XYZ-5:30");
  EXPECT_EQ(stepText(step), "not begun · due 2026-11-18 15:30");
}

TEST_F(LadderTest, withoutAStandingTheCoursesAreShownWithoutStates) {
  const Ladder made = ladder("somebody");
  EXPECT_EQ(made.as_of_unix_ns, 0);
  EXPECT_EQ(made.next, "");
  ASSERT_EQ(made.sections.size(), 2u);
  EXPECT_EQ(made.sections[0].heading, "Course A");
  for (const LadderStep& one : made.sections[0].steps) {
    EXPECT_EQ(one.state, StepState::kUnknown);
    EXPECT_EQ(stepText(one), "");
    EXPECT_TRUE(one.may_begin) << "the server decides";
  }
  EXPECT_THAT(ladderText(made, "somebody", false), HasSubstr("does not know"));
}

TEST_F(LadderTest, theTextHasALinePerStepAndItsTimestamp) {
  tom().courses = {"a"};
  tom().as_of_unix_ns = kNow_ns - kHour_ns;
  standingIn("a1").done = true;
  const std::string away = ladderText(ladder(), "Tom Tailor", true);
  EXPECT_EQ(away.substr(0, away.find('\n')), "Tom Tailor, as of 2026-11-18 10:06");
  EXPECT_THAT(away, HasSubstr("\nCourse A\n"
                              "  1.  a1  The a1  done\n"
                              "  2.  a2  The a2  Next\n"
                              "  3.  a3  The a3  not begun\n"));
  EXPECT_THAT(away, HasSubstr("\nPractise freely: Course B\n  1.  b1"));
  EXPECT_THAT(ladderText(ladder(), "Tom Tailor", false), Not(HasSubstr("as of")));
}

}  // namespace
}  // namespace needlelab
