// A question accepts no key or click made before it was visible. The frames stand still here: everything is
// pressed between two of them.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <gtest/gtest.h>
#include <imgui/imgui.h>

#include <vector>

#include "client/view/action_bar.h"
#include "client/view/theme.h"
#include "tests/support/pictures/view_stage.h"

namespace needlelab {
namespace {

constexpr int kNo = 1, kYes = 2;
const std::vector<ScreenAction> kAnswers = {{kNo, "Continue", ActionKey::kEnterOrEscape, "", true},
                                            {kYes, "Stop it", ActionKey::kDelete, "", true}};

class QuestionTest : public test::ViewStage {
 protected:
  QuestionTest() {
    options_.width_px = 400;
    options_.height_px = 240;
  }
  void tap(int key) {
    surface_->setKey(key, true);
    surface_->setKey(key, false);
  }
  void clickAtOnce(double x_px, double y_px) {
    surface_->moveMouse(x_px, y_px);
    surface_->setMouseButton(0, true);
    surface_->setMouseButton(0, false);
  }
  /// A button that asks a question, which appears above the screen.
  std::function<void()> above() {
    return [this] {
      beginScreen("s");
      ImGui::SetCursorScreenPos({20, 20});
      if (ImGui::Button("ask", {100, 40})) question_.ask();
      if (const auto answer = question_.show("Stop it?", kAnswers)) answers_.push_back(*answer);
      endScreen();
    };
  }
  /// A button that is replaced by its own question.
  std::function<void()> within() {
    return [this] {
      beginScreen("s");
      const bool open = gate_.opens(asked_);
      ImGui::SetCursorScreenPos({20, 20});
      if (asked_ == 0) {
        if (ImGui::Button("ask", {100, 40})) asked_ = 1;
      } else {
        ImGui::BeginDisabled(!open);
        if (ImGui::Button("stop it", {100, 40})) answers_.push_back(kYes);
        ImGui::EndDisabled();
      }
      endScreen();
    };
  }

  Question question_{"Stop?"};
  AnswerGate gate_;
  int asked_ = 0;
  std::vector<int> answers_;
};

TEST_F(QuestionTest, aKeyPressedBeforeItWasSeenAnswersNothing) {
  draw(above());
  for (const int key : {GLFW_KEY_ENTER, GLFW_KEY_KP_ENTER, GLFW_KEY_ESCAPE, GLFW_KEY_DELETE}) {
    clickAtOnce(70, 40);
    for (int i = 0; i < 3; ++i) tap(key);
    draw(above(), 12);
    EXPECT_TRUE(answers_.empty()) << key;
    EXPECT_TRUE(question_.shown());
    press(above(), key);
    EXPECT_EQ(answers_, (std::vector<int>{key == GLFW_KEY_DELETE ? kYes : kNo}));
    EXPECT_FALSE(question_.asked());
    answers_.clear();
    draw(above(), 2);
  }
}

TEST_F(QuestionTest, itCanBeAnsweredFromItsSecondFrameOn) {
  draw(above());
  question_.ask();
  draw(above(), 1);
  EXPECT_TRUE(question_.asked());
  EXPECT_FALSE(question_.shown()) << "measured, and not drawn yet";
  tap(GLFW_KEY_DELETE);  // the person still sees the previous frame
  draw(above(), 1);
  EXPECT_TRUE(question_.shown());
  EXPECT_TRUE(answers_.empty());
  tap(GLFW_KEY_DELETE);
  draw(above(), 1);
  EXPECT_EQ(answers_, (std::vector<int>{kYes}));
}

TEST_F(QuestionTest, clicksOnWhatStoodThereBeforeAnswerNothing) {
  draw(within());
  for (int i = 0; i < 4; ++i) clickAtOnce(70, 40);
  draw(within(), 16);
  EXPECT_EQ(asked_, 1);
  EXPECT_TRUE(answers_.empty());
  click(within(), 70, 40);
  EXPECT_EQ(answers_, (std::vector<int>{kYes}));
}

TEST_F(QuestionTest, anotherOrReturningQuestionMustBeSeenAgain) {
  bool open = false;
  const auto asks = [&](int asked) {
    draw([&] { open = gate_.opens(asked); }, 1);
    return open;
  };
  EXPECT_FALSE(asks(0));
  EXPECT_FALSE(asks(1));
  EXPECT_TRUE(asks(1));
  EXPECT_FALSE(asks(2)) << "it asks something else";
  EXPECT_TRUE(asks(2));
  draw([] {}, 1);
  EXPECT_FALSE(asks(2)) << "it was away for a frame";
  EXPECT_TRUE(asks(2));
}

}  // namespace
}  // namespace needlelab
