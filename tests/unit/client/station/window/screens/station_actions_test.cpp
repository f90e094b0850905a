#include "client/station/window/screens/station_actions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace needlelab {
namespace {

using testing::HasSubstr;

bool offers(const std::vector<ScreenAction>& actions, StationAct act) {
  return std::any_of(actions.begin(), actions.end(), [&](const auto& action) { return action.id == act; });
}

TEST(StationActions, everyScreenHasOneDefaultAndThatIsEnter) {
  BoardState plain, suggested;
  suggested.next = SuggestedExercise{"ines", "knee-recess"};
  for (const auto& actions : {startActions(true, true), startActions(false, false), endActions(plain, true),
                              endActions(plain, false), endActions(suggested, true), failedActions(true),
                              faultActions(), endLessonActions(), quitActions()}) {
    const auto is_default = [](const ScreenAction& action) { return action.isDefault(); };
    EXPECT_EQ(std::count_if(actions.begin(), actions.end(), is_default), 1);
    const auto found = std::find_if(actions.begin(), actions.end(), is_default);
    EXPECT_EQ(actionOf(actions, ActionKey::kEnter), found->enabled ? std::optional(found->id) : std::nullopt);
  }
  EXPECT_EQ(actionOf(startActions(false, true), ActionKey::kEnter), std::nullopt) << "something is missing";
}

TEST(StationActions, afterALessonEnterStartsTheNextTryOrTheSuggestion) {
  BoardState state;
  state.lists.exercises.emplace_back().exercise_id = "knee-recess";
  EXPECT_EQ(actionOf(endActions(state, true), ActionKey::kEnter), kActAgain);
  EXPECT_EQ(actionOf(endActions(state, true), ActionKey::kO), kActOther);
  state.next = SuggestedExercise{"ines", "knee-recess"};
  const auto actions = endActions(state, true);
  EXPECT_EQ(actionOf(actions, ActionKey::kEnter), kActNext);
  EXPECT_THAT(actions.front().label, HasSubstr("ines"));
  EXPECT_TRUE(offers(actions, kActAgain));
}

TEST(StationActions, whoMayNotQuitIsNotOfferedIt) {
  const BoardState state;
  EXPECT_TRUE(offers(startActions(true, true), kActQuit)) << "a full screen has no other way out";
  EXPECT_FALSE(offers(startActions(true, false), kActQuit));
  EXPECT_TRUE(offers(endActions(state, true), kActQuit));
  EXPECT_FALSE(offers(endActions(state, false), kActQuit));
  EXPECT_TRUE(offers(failedActions(true), kActQuit));
  EXPECT_FALSE(offers(failedActions(false), kActQuit));
}

TEST(StationActions, quittingSaysWhatHappensToTheLesson) {
  BoardState state;
  const auto text = [&](Stage stage) {
    state.stage = stage;
    return quitText(state);
  };
  EXPECT_THAT(text(Stage::kLesson), HasSubstr("Everything up to here is kept and scored"));
  EXPECT_THAT(text(Stage::kPreparing), HasSubstr("will not start"));
  EXPECT_THAT(text(Stage::kConcluding), HasSubstr("recording is kept"));
  EXPECT_THAT(text(Stage::kEnd), HasSubstr("recording is kept"));
  EXPECT_THAT(text(Stage::kStart), HasSubstr("No lesson"));
}

TEST(StationActions, aQuestionsDefaultLeavesEverythingAsItIs) {
  for (const auto& answers : {endLessonActions(), quitActions()}) {
    EXPECT_EQ(actionOf(answers, ActionKey::kEnter), kActNo);
    EXPECT_EQ(actionOf(answers, ActionKey::kEscape), kActNo);
    EXPECT_EQ(actionOf(answers, ActionKey::kDelete), kActYes);
  }
}

TEST(StationActions, afterABadgeNoKeyBeginsTheLastTraineesNextLesson) {
  for (const int action : {kActNext, kActAgain}) {
    EXPECT_EQ(endActionByKey(action, false), action);
    EXPECT_EQ(endActionByKey(action, true), kActOther);
  }
  EXPECT_EQ(endActionByKey(kActOther, true), kActOther);
}

}  // namespace
}  // namespace needlelab
