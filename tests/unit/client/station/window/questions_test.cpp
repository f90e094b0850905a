// No question in the trainee's window accepts a key that was pressed before the question was visible. The
// frames stand still here: everything is pressed between two of them.
#include <initializer_list>
#include <memory>

#include "tests/unit/client/station/window/stage.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

class Questions : public TraineeStage {
 protected:
  void tapAtOnce(std::initializer_list<int> keys) {
    for (const int key : keys)
      for (const bool down : {true, false}) surface_->setKey(key, down);
  }
};

TEST_F(Questions, whatIsPressedWithTheKeyThatAsksEndsNoLesson) {
  showLesson(1);
  picture();
  tapAtOnce({GLFW_KEY_ESCAPE, GLFW_KEY_DELETE, GLFW_KEY_ENTER, GLFW_KEY_DELETE});
  picture(12);
  EXPECT_FALSE(requests_.takeStop());
  EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kEndLesson) << "nothing has answered it";
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_TRUE(requests_.takeStop());
}

TEST_F(Questions, whatIsPressedBeforeTheCloseButtonAsksDoesNotQuit) {
  showLesson(1);
  picture();
  window_->askToQuit();
  tapAtOnce({GLFW_KEY_DELETE, GLFW_KEY_ENTER, GLFW_KEY_DELETE});
  picture(12);
  EXPECT_FALSE(board_.requestWaits());
  EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kQuit);
  press(screen(), GLFW_KEY_DELETE);
  EXPECT_EQ(board_.waitForRequest(0ms).kind, BoardRequest::Kind::kQuit);
}

TEST_F(Questions, theFrameLogMarksAnAnswerableQuestion) {
  showLesson(1);
  picture();
  press(screen(), GLFW_KEY_ESCAPE);
  for (int i = 0; i < 5 && window_->shownFrame().question == ShownQuestion::kNone; ++i) picture(1);
  EXPECT_EQ(window_->shownFrame().question, ShownQuestion::kEndLesson);
  tapAtOnce({GLFW_KEY_DELETE});
  picture(1);
  EXPECT_TRUE(requests_.takeStop());
}

TEST_F(Questions, enterPressedBeforeAFaultWasSeenDoesNotAcknowledgeIt) {
  showLesson(2.4);
  picture();
  for (const Fault fault : {Fault::kTipTooFast, Fault::kDeviceSilent}) {
    standing_.fault = fault;
    board_.status(standing_);
    tapAtOnce({GLFW_KEY_ENTER, GLFW_KEY_ENTER, GLFW_KEY_ENTER});
    picture(8);
    EXPECT_FALSE(requests_.takeAcknowledgement()) << faultText(fault);
    press(screen(), GLFW_KEY_ENTER);
    EXPECT_TRUE(requests_.takeAcknowledgement()) << faultText(fault);
  }
}

// keys count from 0.7 s after the outcome: 21 frames of 1/30 s; each tap takes a frame
TEST_F(Questions, enterPressedBeforeTheResultWasSeenStartsNoTry) {
  showLesson(6);
  picture(2);
  auto outcome = std::make_shared<LessonOutcome>();
  outcome->summary.session_id = "s1";
  outcome->summary.exercise = "shoulder-bursa";
  board_.change([&](BoardState& state) {
    state.stage = Stage::kEnd;
    state.outcome = outcome;
    state.choice = {"tom", "shoulder-bursa", false};
  });
  for (int i = 0; i < 40; ++i) tapAtOnce({GLFW_KEY_ENTER});
  picture(60);
  EXPECT_FALSE(board_.requestWaits());
  press(screen(), GLFW_KEY_ENTER);
  EXPECT_EQ(board_.waitForRequest(0ms).kind, BoardRequest::Kind::kBegin);
}

}  // namespace
}  // namespace needlelab::test
