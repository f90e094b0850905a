#include <gmock/gmock.h>

#include <cstdlib>
#include <ctime>
#include <memory>
#include <utility>

#include "client/station/window/lessons/start_choice.h"
#include "common/profile/profile.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

ListedExercise listed(const std::string& id, bool cached = true) {
  ListedExercise exercise;
  exercise.exercise_id = id;
  exercise.name = "Exercise " + id;
  if (cached) exercise.cached_revision = 1;
  return exercise;
}

BoardState withServer() {
  BoardState state;
  state.server = "server";
  state.lists.exercises = {listed("a"), listed("b", false), listed("c")};
  state.lists.descriptions = {{"a", "Exercise a", "p", "Feel it."}};
  state.lists.trainees = {"tom", "zoe"};
  state.lists.assigned = {{"zoe", "c"}};
  return state;
}

TEST(StartChoice, asksWhoAndWhat) {
  StartChoice choice;
  choice.update(withServer());
  EXPECT_THAT(choice.missing(), HasSubstr("Who"));
  choice.chooseTrainee("tom");
  EXPECT_THAT(choice.missing(), HasSubstr("Choose an exercise"));
  choice.step(1);
  EXPECT_EQ(choice.missing(), "");
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(*choice.choice(), (LessonChoice{"tom", "a", false}));
  EXPECT_EQ(choice.exercises()[0].description, "Feel it.");
}

TEST(StartChoice, assignedExercisesComeFirst) {
  StartChoice choice;
  choice.update(withServer());
  choice.chooseTrainee("zoe");
  EXPECT_EQ(choice.exercises()[0].choice.exercise, "c");
  EXPECT_EQ(choice.exercises()[0].note, "assigned");
  choice.chooseTrainee("tom");
  EXPECT_EQ(choice.exercises()[0].choice.exercise, "a");
}

TEST(StartChoice, thePersonsChoiceSurvivesNewListsAndGivesWayToAProposal) {
  StartChoice choice;
  BoardState state = withServer();
  choice.update(state);
  choice.chooseTrainee("tom");
  choice.chooseExercise(2);
  state.lists.exercises.insert(state.lists.exercises.begin(), listed("0"));
  choice.update(state);
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(choice.choice()->exercise, "c");
  // the next exercise, set by an instructor
  state.choice.exercise = "b";
  choice.update(state);
  EXPECT_EQ(choice.choice()->exercise, "b");
  EXPECT_EQ(choice.trainee(), "tom");
}

TEST(StartChoice, theCommandLinesExerciseNeedsNoList) {
  StartChoice choice;
  BoardState state;
  state.server = "server";
  state.choice = {"tom", "special", false};
  choice.update(state);
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(choice.choice()->exercise, "special");
}

TEST(StartChoice, withoutAServerOnlyTheCacheCanBePractised) {
  StartChoice choice;
  BoardState state = withServer();
  state.server_away = true;
  state.server = "server away, 3 chunks wait";
  choice.update(state);
  choice.chooseTrainee("tom");
  int b = 0;
  while (choice.exercises()[static_cast<std::size_t>(b)].choice.exercise != "b") ++b;
  choice.chooseExercise(b);
  EXPECT_FALSE(choice.choice());
  EXPECT_THAT(choice.missing(), HasSubstr("needs the server"));
}

TEST(StartChoice, aProfileAndAGuestWithoutAServer) {
  StartChoice choice;
  BoardState state;
  state.lists.profile_file = "/tmp/mine.json";
  state.choice.by_profile = true;
  choice.update(state);
  ASSERT_TRUE(choice.choice());
  EXPECT_TRUE(choice.choice()->by_profile);
  EXPECT_EQ(choice.exercises()[0].name, "mine.json");
}

TEST(StartChoice, anInvalidNameIsReported) {
  StartChoice choice;
  choice.update(withServer());
  choice.chooseExercise(0);
  choice.chooseTrainee(" tom");
  EXPECT_FALSE(choice.choice());
  EXPECT_NE(choice.missing(), "");
}

TEST(StartChoice, traineesAreChosenByArrows) {
  StartChoice choice;
  choice.update(withServer());
  choice.stepTrainee(1);
  EXPECT_EQ(choice.trainee(), "tom");
  choice.stepTrainee(1);
  choice.stepTrainee(1);
  EXPECT_EQ(choice.trainee(), "zoe");
  choice.stepTrainee(-1);
  EXPECT_EQ(choice.trainee(), "tom");
}

TEST(StartChoice, arrowsStayWithinTheList) {
  StartChoice choice;
  choice.update(withServer());
  for (int i = 0; i < 9; ++i) choice.step(1);
  EXPECT_EQ(choice.exercise(), 2);
  for (int i = 0; i < 9; ++i) choice.step(-1);
  EXPECT_EQ(choice.exercise(), 0);
  StartChoice empty;
  empty.update(BoardState{});
  empty.step(1);
  EXPECT_EQ(empty.exercise(), -1);
  EXPECT_NE(empty.missing(), "");
}

// --- codes

BoardState withQuestion(std::uint64_t number = 1) {
  BoardState state = withServer();
  state.choice = {"tom", "a", false};
  state.code_question = CodeQuestion{"tom", "tom has a code", number > 1, number};
  return state;
}

TEST(CodeOfTheChoice, withoutAQuestionThereIsNothingToType) {
  StartChoice choice;
  choice.update(withServer());
  choice.chooseTrainee("tom");
  choice.chooseExercise(0);
  EXPECT_EQ(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.missing(), "");
  EXPECT_EQ(choice.takeCode(), "");
}

TEST(CodeOfTheChoice, theLessonBeginsOnceACodeIsTyped) {
  StartChoice choice;
  choice.update(withQuestion());
  ASSERT_NE(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.codeQuestion()->text, "tom has a code");
  EXPECT_THAT(choice.missing(), HasSubstr("badge"));
  EXPECT_FALSE(choice.choice());
  choice.typeCode("471");
  EXPECT_FALSE(choice.choice()) << "too short";
  choice.typeCode("4711");
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(*choice.choice(), (LessonChoice{"tom", "a", false}));
  EXPECT_EQ(choice.takeCode(), "4711");
  EXPECT_EQ(choice.typedCode(), "") << "it is forgotten with the request";
  EXPECT_FALSE(choice.choice()) << "and not sent twice";
}

TEST(CodeOfTheChoice, newListsKeepTheTypedCodeAndQuestionsClearIt) {
  StartChoice choice;
  choice.update(withQuestion());
  choice.typeCode("47");
  BoardState state = withQuestion();
  state.lists.exercises.push_back(listed("z"));
  choice.update(state);
  EXPECT_EQ(choice.typedCode(), "47");
  choice.chooseExercise(2);
  EXPECT_EQ(choice.typedCode(), "47") << "the same trainee";
  choice.update(withQuestion(2));
  EXPECT_EQ(choice.typedCode(), "");
  ASSERT_NE(choice.codeQuestion(), nullptr);
  EXPECT_TRUE(choice.codeQuestion()->wrong);
}

TEST(CodeOfTheChoice, anotherTraineeClearsIt) {
  StartChoice choice;
  choice.update(withQuestion());
  choice.typeCode("4711");
  choice.chooseTrainee("zoe");
  EXPECT_EQ(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.typedCode(), "");
  EXPECT_EQ(choice.missing(), "");
  choice.chooseTrainee("tom");
  EXPECT_EQ(choice.codeQuestion(), nullptr) << "the server asks again when tom begins";
  choice.update(withQuestion());
  EXPECT_EQ(choice.codeQuestion(), nullptr) << "this question is over";
  choice.update(withQuestion(2));
  EXPECT_NE(choice.codeQuestion(), nullptr);
}

TEST(CodeOfTheChoice, choosingTheSameTraineeAgainKeepsIt) {
  StartChoice choice;
  choice.update(withQuestion());
  choice.typeCode("4711");
  choice.chooseTrainee("tom");
  EXPECT_NE(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.typedCode(), "4711");
}

TEST(CodeOfTheChoice, aLessonThatBeganEndsTheQuestion) {
  StartChoice choice;
  choice.update(withQuestion());
  choice.typeCode("4711");
  BoardState state = withQuestion();
  state.code_question.reset();
  choice.update(state);
  EXPECT_EQ(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.typedCode(), "");
}

TEST(CodeOfTheChoice, aKnownCodeIsAskedForButMayStayEmpty) {
  StartChoice choice;
  BoardState state = withQuestion();
  state.code_question.reset();
  state.lists.asks_code = {"tom", "zoe"};
  choice.update(state);
  ASSERT_NE(choice.codeQuestion(), nullptr);
  EXPECT_FALSE(choice.codeQuestion()->wrong);
  const std::uint64_t toms = choice.codeQuestion()->number;
  EXPECT_EQ(choice.missing(), "") << "the code may have been removed: the server says so";
  choice.typeCode("4711");
  choice.update(state);
  EXPECT_EQ(choice.typedCode(), "4711") << "new lists keep it";
  EXPECT_EQ(choice.takeCode(), "4711");
  choice.update(state);
  ASSERT_NE(choice.codeQuestion(), nullptr);
  EXPECT_NE(choice.codeQuestion()->number, toms) << "a new question after the lesson";
  choice.typeCode("4711");
  choice.chooseTrainee("zoe");
  ASSERT_NE(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.codeQuestion()->trainee, "zoe");
  EXPECT_EQ(choice.typedCode(), "");
  choice.chooseTrainee("mia");
  EXPECT_EQ(choice.codeQuestion(), nullptr);
  choice.chooseTrainee("tom");
  choice.update(withQuestion(2));
  ASSERT_NE(choice.codeQuestion(), nullptr);
  EXPECT_EQ(choice.codeQuestion()->text, "tom has a code") << "the server's question comes first";
}

TEST(CodeOfTheChoice, anInvalidCodeIsReportedInItsOwnWords) {
  StartChoice choice;
  choice.update(withQuestion());
  choice.typeCode(
      "b\xc3\xa4"
      "dge");
  EXPECT_THAT(choice.missing(), HasSubstr("not printable ASCII"));
  choice.typeCode(std::string(65, '1'));
  EXPECT_EQ(choice.missing(), "code: has 65 characters, allowed are 4 to 64");
  choice.typeCode("471");
  EXPECT_THAT(choice.missing(), HasSubstr("badge"));
}

TEST(CodeOfTheChoice, withoutTheServerNoCodeIsAskedFor) {
  StartChoice choice;
  BoardState state = withQuestion();
  state.server_away = true;
  choice.update(state);
  choice.typeCode("4711");
  EXPECT_EQ(choice.codeQuestion(), nullptr);
  EXPECT_TRUE(choice.choice());
  EXPECT_EQ(choice.takeCode(), "") << "no one could check it";
}

// --- with the server's courses and standings

constexpr std::int64_t kNow_ns = 1'795'000'000'000'000'000;  // 2026-11-18 11:06:40 UTC
constexpr std::int64_t kMinute_ns = 60'000'000'000;

// course A with the steps a, b, c, of which b is locked, and course B with d. Tom is assigned A and has
// passed a; zoe is assigned only d
BoardState withLadder() {
  BoardState state = withServer();
  Curriculum curriculum;
  for (const char* id : {"a", "b", "c"})
    curriculum.exercises.push_back({id, std::string("Exercise ") + id, "p", "", "course-a", "Course A"});
  curriculum.exercises.push_back({"d", "Exercise d", "p", "", "course-b", "Course B"});
  curriculum.trainees = {{"tom", "Tom Tailor"}, {"zoe", "Amy Zoe"}};
  for (const char* name : {"tom", "zoe"}) {
    TraineeStanding& standing = curriculum.standings[name];
    standing.as_of_unix_ns = kNow_ns;
    for (const char* id : {"a", "b", "c", "d"}) {
      standing.steps.emplace_back();
      standing.steps.back().exercise_id = id;
    }
  }
  TraineeStanding& tom = curriculum.standings["tom"];
  tom.courses = {"course-a"};
  tom.steps[0].done = true;
  tom.steps[1].locked_by = {"c"};
  curriculum.standings["zoe"].exercises = {"d"};
  state.lists.descriptions = curriculum.exercises;
  state.lists.curriculum = std::make_shared<const Curriculum>(std::move(curriculum));
  return state;
}

std::vector<std::string> rowsOf(const StartChoice& choice) {
  std::vector<std::string> rows;
  for (const ExerciseRow& row : choice.exercises()) {
    if (!row.heading.empty()) rows.push_back("# " + row.heading);
    rows.push_back(std::to_string(row.number) + " " + row.choice.exercise + ": " + row.note);
  }
  return rows;
}

TEST(StartChoice, theListIsTheLadderOfTheChosenTrainee) {
  StartChoice choice;
  choice.update(withLadder(), kNow_ns);
  choice.chooseTrainee("tom");
  EXPECT_THAT(rowsOf(choice), ElementsAre("# Course A", "1 a: done", "2 b: locked by step 3", "3 c: Next",
                                          "# Practise freely: Course B", "1 d: not begun"));
  choice.chooseTrainee("zoe");
  EXPECT_THAT(rowsOf(choice), ElementsAre("# Assigned to you", "0 d: Next", "# Practise freely: Course A",
                                          "1 a: not begun", "2 b: not begun", "3 c: not begun"));
}

TEST(StartChoice, theNextStepIsChosenUntilAPersonChooses) {
  StartChoice choice;
  BoardState state = withLadder();
  choice.update(state, kNow_ns);
  choice.chooseTrainee("tom");
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(choice.choice()->exercise, "c");
  choice.chooseTrainee("zoe");
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(choice.choice()->exercise, "d") << "the next step of this trainee";
  choice.step(1);
  EXPECT_EQ(choice.choice()->exercise, "a");
  choice.update(state, kNow_ns);
  EXPECT_EQ(choice.choice()->exercise, "a") << "new lists do not take it away";
}

TEST(StartChoice, theListFollowsATypedName) {
  StartChoice choice;
  choice.update(withLadder(), kNow_ns);
  EXPECT_THAT(choice.trainees(), ElementsAre("tom", "zoe"));
  choice.typeTrainee("AI", true);
  EXPECT_THAT(choice.trainees(), ElementsAre("tom")) << "Tom Tailor";
  EXPECT_EQ(choice.trainee(), "AI") << "a new name is not taken for a listed one";
  choice.stepTrainee(1);
  EXPECT_EQ(choice.trainee(), "tom");
  choice.typeTrainee("amy zoe", true);
  EXPECT_EQ(choice.trainee(), "zoe") << "in whatever case";
  choice.typeTrainee("nobody", true);
  EXPECT_THAT(choice.trainees(), ElementsAre());
  choice.showAllTrainees();
  EXPECT_THAT(choice.trainees(), ElementsAre("tom", "zoe"));
}

TEST(StartChoice, aCorrectedNameKeepsTheChosenExercise) {
  StartChoice choice;
  BoardState state = withLadder();
  state.lists.exercises[0].assigned_only = true;  // a: not for others than those of its course
  choice.update(state, kNow_ns);
  choice.chooseTrainee("tom");
  choice.chooseExercise(0);
  ASSERT_EQ(choice.choice()->exercise, "a");
  for (const char* typed : {"z", "zo", "zoe"}) choice.typeTrainee(typed, true);
  EXPECT_EQ(choice.choice()->exercise, "a");
  choice.chooseTrainee("tom");
  EXPECT_EQ(choice.choice()->exercise, "a");
  // after a lesson the next step is selected again
  state.lesson = 1;
  choice.update(state, kNow_ns);
  choice.chooseTrainee("zoe");
  EXPECT_EQ(choice.choice()->exercise, "d");
}

TEST(StartChoice, aBadgeIsNoName) {
  StartChoice choice;
  BoardState state = withLadder();
  state.lists.asks_code = {"tom"};
  choice.update(state, kNow_ns);
  choice.chooseTrainee("zoe");
  choice.typeTrainee("08154711", true);
  EXPECT_TRUE(choice.mayBeBadge());
  EXPECT_FALSE(choice.choice());
  choice.typeTrainee("zoe", true);
  EXPECT_FALSE(choice.mayBeBadge());
  choice.typeTrainee("a new trainee", false);
  EXPECT_FALSE(choice.mayBeBadge()) << "in the field";
}

TEST(StartChoice, aStandingThatComesLaterBringsTheNextStep) {
  StartChoice choice;
  BoardState state = withLadder();
  auto without = std::make_shared<Curriculum>(*state.lists.curriculum);
  without->standings.clear();
  const auto complete = std::exchange(state.lists.curriculum, without);
  choice.update(state, kNow_ns);
  choice.chooseTrainee("tom");
  EXPECT_FALSE(choice.choice());
  EXPECT_EQ(choice.standingWanted(), "tom");
  state.lists.curriculum = complete;
  choice.update(state, kNow_ns);
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(choice.choice()->exercise, "c");
  EXPECT_EQ(choice.standingWanted(), "");
}

TEST(StartChoice, theCommandLinesExerciseIsNotReplacedByTheNextStep) {
  StartChoice choice;
  BoardState state = withLadder();
  state.choice = {"tom", "a", false};
  choice.update(state, kNow_ns);
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(choice.choice()->exercise, "a");
}

TEST(StartChoice, aLockedStepCannotBeginAndGivesTheReason) {
  StartChoice choice;
  choice.update(withLadder(), kNow_ns);
  choice.chooseTrainee("tom");
  choice.chooseExercise(1);
  EXPECT_FALSE(choice.choice());
  EXPECT_EQ(choice.missing(), "Exercise b: locked by step 3");
}

TEST(StartChoice, offlineTheLadderShowsItsAgeAndTheCacheIsUsable) {
  ::setenv("TZ", "UTC", 1);
  ::tzset();
  StartChoice choice;
  BoardState state = withLadder();
  state.server_away = true;
  // kept: b, although it was locked then; a is not kept
  state.lists.exercises = {listed("a", false), listed("b"), listed("c")};
  choice.update(state, kNow_ns + 30 * 24 * 60 * kMinute_ns);
  choice.chooseTrainee("tom");
  EXPECT_EQ(choice.asOf(), "as of 2026-11-18 11:06");
  EXPECT_EQ(choice.standingWanted(), "") << "there is no one to ask";
  EXPECT_THAT(rowsOf(choice), ElementsAre("# Course A", "1 a: done · needs the server, which is unreachable",
                                          "2 b: locked by step 3", "3 c: Next", "# Practise freely: Course B",
                                          "1 d: not begun · needs the server, which is unreachable"));
  choice.chooseExercise(1);
  EXPECT_TRUE(choice.choice())
      << "who passed step 3 off line is not held back by what the server said before";
  choice.chooseExercise(0);
  EXPECT_FALSE(choice.choice());
}

TEST(StartChoice, anExamNeedsAnAssignmentAndOfflineARemainingAttempt) {
  BoardState state = withLadder();
  auto curriculum = std::make_shared<Curriculum>(*state.lists.curriculum);
  for (ServerExercise& exercise : curriculum->exercises)
    exercise.assigned_only = exercise.exam = exercise.course_id == "course-a";
  state.lists.curriculum = curriculum;
  for (const char* id : {"a", "b", "c", "d"}) state.lists.exercises.push_back(listed(id));
  for (ListedExercise& one : state.lists.exercises) one.assigned_only = one.exercise_id != "d";
  const auto shown = [](const StartChoice& choice) {
    std::string ids;
    for (const ExerciseRow& row : choice.exercises()) ids += row.choice.exercise + (row.usable ? "" : "!");
    return ids;
  };
  for (const bool away : {false, true}) {
    state.server_away = away;
    StartChoice choice;
    choice.update(state, kNow_ns);
    choice.chooseTrainee("tom");
    EXPECT_EQ(shown(choice), "ab!cd") << "b is locked";
    choice.chooseTrainee("guest");
    EXPECT_EQ(shown(choice), "d") << "neither its course nor what is kept of it";
  }
  for (StepStanding& step : curriculum->standings["tom"].steps)
    if (step.exercise_id == "c") step.attempts_left = 0;
  StartChoice choice;
  choice.update(state, kNow_ns);
  choice.chooseTrainee("tom");
  EXPECT_EQ(shown(choice), "ab!c!d");
  // the previous trainee's choice does not stay either
  choice.chooseExercise(0);
  choice.chooseTrainee("guest");
  EXPECT_EQ(shown(choice), "d");
}

TEST(StartChoice, aBlockedStartGivesAdviceForALab) {
  StartChoice choice;
  BoardState state;
  state.choice.trainee = "tom";
  choice.update(state);
  EXPECT_EQ(choice.missing(), "This station has no server and no stored lessons: ask the instructor.");
  state.server = "server";
  choice.update(state);
  EXPECT_EQ(choice.missing(), "No lessons here yet: wait for the server.");
  state.server_away = true;
  choice.update(state);
  EXPECT_EQ(choice.missing(),
            "The server cannot be reached, and no lessons are stored here: ask the instructor.");
}

TEST(StartChoice, aFreshStandingHasNoTimeAnOldOneIsRefetched) {
  StartChoice choice;
  const BoardState state = withLadder();
  choice.update(state, kNow_ns + 2 * kMinute_ns - 1);
  choice.chooseTrainee("tom");
  EXPECT_EQ(choice.standingWanted(), "");
  EXPECT_EQ(choice.asOf(), "");
  choice.update(state, kNow_ns + 2 * kMinute_ns);
  EXPECT_EQ(choice.standingWanted(), "tom");
  EXPECT_EQ(choice.asOf(), "");
  choice.update(state, kNow_ns + 5 * kMinute_ns);
  EXPECT_NE(choice.asOf(), "");
}

TEST(StartChoice, peopleAreShownByFullNamesAndMeantByEitherName) {
  StartChoice choice;
  choice.update(withLadder(), kNow_ns);
  EXPECT_EQ(choice.shown("tom"), "Tom Tailor");
  EXPECT_EQ(choice.shown("guest"), "guest");
  choice.chooseTrainee("Amy Zoe");
  EXPECT_EQ(choice.trainee(), "zoe");
  choice.chooseTrainee("tom");
  EXPECT_EQ(choice.trainee(), "tom");
}

TEST(StartChoice, exercisesUnknownToTheServerComeLast) {
  StartChoice choice;
  BoardState state = withLadder();
  state.lists.exercises.push_back(listed("old"));
  choice.update(state, kNow_ns);
  choice.chooseTrainee("tom");
  const auto rows = rowsOf(choice);
  ASSERT_GE(rows.size(), 2u);
  EXPECT_EQ(rows[rows.size() - 2], "# Kept on this station");
  EXPECT_EQ(rows.back(), "0 old: ");
}

// --- the lists without a server

TEST(StartLists, aComputerThatNeverHadAServerListsTheBodies) {
  const test::TempFolder folder;
  StationOptions options;
  options.spool = folder.path() / "spool";
  const auto spool = std::move(*Spool::open(options.spool));
  const auto course = loadCurriculum(NEEDLELAB_SAMPLES "/volumes/bodies-curriculum.json");
  ASSERT_TRUE(course.ok());
  StartChoice choice;
  BoardState state;
  state.lists = localLists(options, *spool);
  choice.update(state);
  ASSERT_EQ(static_cast<int>(choice.exercises().size()), course->exercises_size());
  for (int i = 0; i < course->exercises_size(); ++i) {
    const ExerciseRow& row = choice.exercises()[static_cast<std::size_t>(i)];
    EXPECT_EQ(row.choice.exercise, course->exercises(i).id()) << "in the order of the course";
    EXPECT_EQ(row.name, course->exercises(i).name());
    EXPECT_EQ(row.description, course->exercises(i).description());
    EXPECT_TRUE(row.usable) << row.note;
    EXPECT_EQ(row.note, "");
  }
  ASSERT_TRUE(choice.choice()) << "Enter begins: " << choice.missing();
  EXPECT_EQ(*choice.choice(), (LessonChoice{"", "shoulder-median", false})) << "as guest";
  choice.chooseTrainee("tom");
  choice.step(1);
  EXPECT_EQ(*choice.choice(), (LessonChoice{"tom", "wrist-median", false}));

  options.servers = {{"127.0.0.1", 1}};
  EXPECT_TRUE(localLists(options, *spool).exercises.empty()) << "a server's exercises are its own";
  options.servers.clear();
  options.profile_file = "own.json";
  EXPECT_TRUE(localLists(options, *spool).exercises.empty());
}

// --- the lists from a server

TEST(StartLists, theServersTraineesStandInTheOrderOfTheirShownNames) {
  const AskServer ask = [](const pb::Request& request) -> Result<pb::Reply> {
    pb::Reply reply;
    if (request.has_list_curricula()) {
      reply.mutable_curricula()->add_curricula()->set_id("course-a");
    } else if (request.has_get_curriculum()) {
      reply.mutable_curriculum()->set_json(R"({"exercises": [{"id": "a", "name": "Exercise a"}]})");
    } else if (request.has_get_results() && request.get_results().trainee().empty()) {
      const char* names[][2] = {{"tom", "Tom Tailor"}, {"zoe", "Amy Zoe"}};
      for (const auto& [name, full_name] : names) {
        auto* row = reply.mutable_results()->add_rows();
        row->set_trainee(name);
        row->set_full_name(full_name);
      }
    } else if (request.has_get_results()) {
      auto* row = reply.mutable_results()->add_rows();
      row->set_trainee(request.get_results().trainee());
      row->add_cells()->set_exercise_id("a");
    } else {
      reply.mutable_assignments();
    }
    return reply;
  };
  StartLists lists;
  ASSERT_TRUE(addServerLists(lists, {}, "", ask, kNow_ns).ok());
  EXPECT_THAT(lists.trainees, ElementsAre("zoe", "tom"))
      << "Amy Zoe, Tom Tailor; nothing is assigned to them";
  ASSERT_TRUE(lists.curriculum);
  EXPECT_TRUE(lists.curriculum->standings.empty());
  ASSERT_TRUE(addStanding(lists, "tom", ask, kNow_ns).ok());
  ASSERT_EQ(lists.curriculum->standings.count("tom"), 1u);
  EXPECT_EQ(lists.curriculum->standings.at("tom").as_of_unix_ns, kNow_ns);
}

TEST(StartLists, knowAllAssignmentsAndDetectChanges) {
  std::vector<pb::Assignment> all(3);
  all[0].set_course_id("a");
  all[0].set_group_id("class");
  all[1].set_exercise_id("b2");
  all[1].set_trainee("tom");
  all[2].set_course_id("c");
  all[2].set_trainee("zoe");
  const AskServer ask = [&](const pb::Request& request) -> Result<pb::Reply> {
    pb::Reply reply;
    if (request.has_list_assignments())
      for (const pb::Assignment& one : all) *reply.mutable_assignments()->add_assignments() = one;
    return reply;
  };
  StartLists lists;
  EXPECT_EQ(lists.assignments, 0u);
  ASSERT_TRUE(addServerLists(lists, {}, "", ask, kNow_ns).ok());
  EXPECT_THAT(lists.assigned_courses, ElementsAre("a", "c"));
  EXPECT_THAT(lists.assigned_exercises, ElementsAre("b2"));
  const std::size_t before = lists.assignments;
  EXPECT_NE(before, 0u);
  ASSERT_TRUE(addServerLists(lists, {}, "", ask, kNow_ns).ok());
  EXPECT_EQ(lists.assignments, before);
  all.pop_back();
  ASSERT_TRUE(addServerLists(lists, {}, "", ask, kNow_ns).ok());
  EXPECT_NE(lists.assignments, before);
  EXPECT_THAT(lists.assigned_courses, ElementsAre("a"));
}

}  // namespace
}  // namespace needlelab
