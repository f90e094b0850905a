// The question whether to stop a lesson accepts no key or click that was meant for something else. The frames
// stand still here: everything is typed and clicked between two of them.
#include "tests/unit/client/instructor/screens/mouse.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <initializer_list>
#include <string>
#include <utility>

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

class Questions : public WithMouse {
 protected:
  void watch(const BenchStation& bench) {
    bench_ = &bench;
    ASSERT_NO_FATAL_FAILURE(logIn());
    ASSERT_TRUE(until([&] {
      const StationTile* const tile = lab_->overview.find("bench-1");
      return tile != nullptr && tile->online && !tile->session_id.empty();
    }));
    lab_->open("bench-1");
    ASSERT_TRUE(until([&] { return !lab_->live()->trace().empty(); }));
    frames(2);
  }
  void tapAtOnce(std::initializer_list<int> keys) {
    for (const int key : keys)
      for (const bool down : {true, false}) surface_->setKey(key, down);
  }
  void clickAtOnce(ImVec2 place) {
    surface_->moveMouse(static_cast<double>(place.x), static_cast<double>(place.y));
    for (const bool down : {true, false}) surface_->setMouseButton(0, down);
  }
  bool heard(const std::string& words) {
    return until(
        [&] { return lab_->commands.waiting() == 0 && bench_->heard().find(words) != std::string::npos; });
  }
  const BenchStation* bench_ = nullptr;
};

TEST_F(Questions, aMessageIsSentBeforeTheQuestionAndItsEnterStopsNothing) {
  const BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_NO_FATAL_FAILURE(watch(bench));
  const auto stop = placeOf("Stop lesson …"), message = placeOf("##message");
  ASSERT_TRUE(stop && message);
  clickAtOnce(*message);
  surface_->typeText("slower, please");
  tapAtOnce({GLFW_KEY_ENTER});
  clickAtOnce(*stop);
  tapAtOnce({GLFW_KEY_ENTER, GLFW_KEY_DELETE, GLFW_KEY_ESCAPE});
  frames(20);
  EXPECT_TRUE(lab_->stop_question.asking()) << "nothing has answered it";
  ASSERT_TRUE(heard("anna: slower, please\n")) << bench.heard();
  EXPECT_TRUE(stands("message to the trainee")) << "the field is empty again: " << window_->text();
  press(GLFW_KEY_ENTER);
  EXPECT_FALSE(lab_->stop_question.asking()) << "Enter continues";
  ASSERT_TRUE(click("Stop lesson …"));
  press(GLFW_KEY_DELETE);
  ASSERT_TRUE(heard("stop \n")) << bench.heard();
  const std::string all = bench.heard();
  EXPECT_LT(all.find("slower, please"), all.find("stop ")) << all;
  EXPECT_EQ(all.find("stop "), all.rfind("stop ")) << all;
}

TEST_F(Questions, aMessageThatIsNotSentYetOutlivesTheQuestion) {
  const BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_NO_FATAL_FAILURE(watch(bench));
  const auto stop = placeOf("Stop lesson …"), message = placeOf("##message");
  ASSERT_TRUE(stop && message);
  clickAtOnce(*message);
  surface_->typeText("slower, please");
  clickAtOnce(*stop);
  frames(12);
  ASSERT_TRUE(lab_->stop_question.asking());
  press(GLFW_KEY_ESCAPE);
  EXPECT_FALSE(lab_->stop_question.asking());
  EXPECT_TRUE(stands("slower, please")) << window_->text();
  ASSERT_TRUE(click("Send"));
  EXPECT_TRUE(heard("anna: slower, please\n")) << bench.heard();
  EXPECT_THAT(bench.heard(), Not(HasSubstr("stop ")));
}

TEST_F(Questions, moreClicksOnStopLessonStopNothing) {
  const BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_NO_FATAL_FAILURE(watch(bench));
  ASSERT_TRUE(click("Stop lesson …"));
  const auto yes = placeOf("■ Stop now (Del)");
  ASSERT_TRUE(yes) << window_->text();
  press(GLFW_KEY_ESCAPE);
  const auto stop = placeOf("Stop lesson …");
  ASSERT_TRUE(stop);
  clickAtOnce(*stop);
  for (int i = 0; i < 3; ++i) clickAtOnce(*yes);
  frames(20);
  EXPECT_TRUE(lab_->stop_question.asking()) << "nothing has answered it";
  EXPECT_EQ(lab_->commands.waiting(), 0u);
  EXPECT_THAT(bench.heard(), Not(HasSubstr("stop ")));
  clickAt(*yes);
  EXPECT_TRUE(heard("stop \n")) << bench.heard();
}

TEST_F(Questions, theFirstLettersOfAMessageAreNoShortcuts) {
  const BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_NO_FATAL_FAILURE(watch(bench));
  const PlotSet plots = window_->live_screen.plots;
  // M leads to the message field, N would lead to the remark field
  for (const auto& [key, text] : {std::pair(GLFW_KEY_M, "m"), std::pair(GLFW_KEY_N, "n"),
                                  std::pair(GLFW_KEY_O, "o"), std::pair(GLFW_KEY_P, "p")}) {
    surface_->setKey(key, true);
    surface_->typeText(text);
    surface_->setKey(key, false);
  }
  tapAtOnce({GLFW_KEY_ENTER});
  frames(12);
  EXPECT_EQ(window_->live_screen.plots, plots);
  EXPECT_TRUE(heard("anna: nop\n")) << bench.heard();
}

}  // namespace
}  // namespace needlelab
