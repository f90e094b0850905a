#include "client/station/window/screens/station_actions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace needlelab {
namespace {

using testing::HasSubstr;

bool offers(const std::vector<ScreenAction>& actions, StationAct act) {
  return std::any_of(actions.begin(), actions.end(), [&](const auto& action) { return action.id == act; });
}

// `left`: attempts, with this one
BoardState afterAttempt(std::uint32_t left) {
  LessonBeginning beginning;
  beginning.lesson.attempts_left = left;
  BoardState state;
  state.beginning = std::make_shared<LessonBeginning>(beginning);
  return state;
}

TEST(StationActions, everyScreenHasOneDefaultAndThatIsEnter) {
  BoardState plain, suggested;
  suggested.next = SuggestedExercise{"ines", "knee-recess"};
  const BoardState last = afterAttempt(1);
  for (const auto& actions :
       {startActions(true, true), startActions(false, false), endActions(plain, true),
        endActions(plain, false), endActions(suggested, true), failedActions(true), faultActions(),
        endLessonActions(), quitActions(), beginExamActions(), endActions(last, true)}) {
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

TEST(StationActions, withoutAnAttemptThereIsNoNextTry) {
  EXPECT_TRUE(offers(endActions(afterAttempt(2), true), kActAgain));
  const auto actions = endActions(afterAttempt(1), true);
  EXPECT_FALSE(offers(actions, kActAgain));
  EXPECT_EQ(actionOf(actions, ActionKey::kEnter), kActOther);
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
  for (const auto& answers : {endLessonActions(), quitActions(), beginExamActions()}) {
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

BoardState calm() {
  BoardState state;
  state.status.time_s = 10;
  state.status.spool = "recording";
  state.status.server = "server";
  state.status.wakeup.p99_ns = 45'000;
  return state;
}

std::string wordsOf(const std::vector<StationFact>& facts) {
  std::string words;
  for (const StationFact& fact : facts) words += fact.words + "\n";
  return words;
}

TEST(StationLight, isOneWordWhereAllIsWell) {
  LessonBeginning beginning;
  beginning.device_notes = {"the device renders no torque"};
  BoardState state = calm();
  state.aids_by = "ines";
  const auto facts = lessonFacts(state, beginning, 0, 0.4);
  EXPECT_EQ(lightOf(facts), Condition::kGood) << wordsOf(facts);
  EXPECT_STREQ(lightText(lightOf(facts)), "Station OK");
  for (const char* words : {"loop 1000 Hz: 99 % within 45 µs, 0 missed", "recording", "server",
                            "tilt limit α 23°", "the device renders no torque", "ines chose what is shown"})
    EXPECT_THAT(wordsOf(facts), HasSubstr(words));
}

TEST(StationLight, isThatOfTheWorstFact) {
  struct Row {
    Condition light;
    void (*break_it)(BoardState&);
  };
  const Row rows[] = {
      {Condition::kAttention, [](BoardState& s) { s.status.missed_ticks = 20; }},
      {Condition::kTrouble, [](BoardState& s) { s.status.missed_ticks = 200; }},
      {Condition::kTrouble, [](BoardState& s) { s.status.spool = "the disk is full"; }},
      {Condition::kAttention, [](BoardState& s) { s.status.server = "server away, 3 chunks wait"; }},
      {Condition::kAttention, [](BoardState& s) { s.status.server = "server has no room, 3 chunks wait"; }},
      {Condition::kAttention, [](BoardState& s) { s.status.server = "server refuses"; }},
      {Condition::kGood, [](BoardState& s) { s.status.server = "server, 3 chunks behind"; }},
      {Condition::kTrouble, [](BoardState& s) { s.status.room = "room for 20 minutes"; }},
  };
  for (const Row& row : rows) {
    BoardState state = calm();
    row.break_it(state);
    const auto facts = lessonFacts(state, LessonBeginning(), 0, 0);
    EXPECT_EQ(lightOf(facts), row.light) << wordsOf(facts);
    EXPECT_STREQ(lightText(lightOf(facts)), row.light == Condition::kGood ? "Station OK" : "Check station");
  }
  EXPECT_EQ(lightOf(lessonFacts(calm(), LessonBeginning(), 7, 0)), Condition::kAttention)
      << "a gap in the picture";
}

}  // namespace
}  // namespace needlelab
