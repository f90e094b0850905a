#include <gmock/gmock.h>

#include "client/station/window/start_choice.h"

namespace needlelab {
namespace {

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
  EXPECT_THAT(choice.missing(), HasSubstr("What"));
  choice.step(1);
  EXPECT_EQ(choice.missing(), "");
  ASSERT_TRUE(choice.choice());
  EXPECT_EQ(*choice.choice(), (LessonChoice{"tom", "a", false}));
  EXPECT_EQ(choice.exercises()[0].description, "Feel it.");
}

TEST(StartChoice, whatIsAssignedStandsFirst) {
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
  // an instructor's next exercise
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

TEST(StartChoice, aNameThatIsNoneIsSaid) {
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

}  // namespace
}  // namespace needlelab
