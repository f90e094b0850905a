// What clicks and keys do in the lab and while watching a lesson, and the texts that result.
#include "tests/unit/client/instructor/screens/mouse.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <utility>

#include "client/view/model/scene_view.h"
#include "tests/unit/client/instructor/model/lesson_frame.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

// --- the frame around the screens

using Actions = WithMouse;

TEST_F(Actions, theBarAndItsKeysLeadToEveryScreenAndOut) {
  press(GLFW_KEY_3, /*ctrl=*/true);
  EXPECT_EQ(lab_->screen, WindowScreen::kLogin) << "no one has logged in";
  logIn();
  EXPECT_EQ(lab_->screen, WindowScreen::kLab);
  const std::pair<const char*, WindowScreen> places[] = {
      {"Watch", WindowScreen::kLive},    {"Sessions", WindowScreen::kSessions},
      {"Replay", WindowScreen::kReplay}, {"Compare", WindowScreen::kCompare},
      {"Re-run", WindowScreen::kRerun},  {"Scores", WindowScreen::kScores},
      {"Lab", WindowScreen::kLab}};
  for (const auto& [label, screen] : places) {
    ASSERT_TRUE(click(label)) << label;
    EXPECT_EQ(lab_->screen, screen) << label;
  }
  for (int i = 0; i < 7; ++i) {
    press(GLFW_KEY_1 + i, /*ctrl=*/true);
    // "Lab" is on the first key, and last in the list
    EXPECT_EQ(lab_->screen, places[(i + 6) % 7].second) << i + 1;
  }
  EXPECT_TRUE(stands("anna @ " + lab_->form.server + " ")) << window_->text();
  EXPECT_TRUE(stands("online"));
  ASSERT_TRUE(click("Log out"));
  EXPECT_EQ(lab_->screen, WindowScreen::kLogin);
  EXPECT_FALSE(lab_->inside());
  EXPECT_EQ(lab_->form.password, "") << "the next user has to know it";
  EXPECT_FALSE(stands("Scores"));
}

TEST_F(Actions, escapeClosesTheListOfKeysThenTheNoticesThenTheScreen) {
  logIn();
  lab_->screen = WindowScreen::kSessions;
  lab_->notices.trouble("the printer burns");
  frames(2);
  ASSERT_TRUE(click(" ? "));
  ASSERT_TRUE(stands("Keyboard"));
  press(GLFW_KEY_ESCAPE);
  EXPECT_FALSE(window_->show_help);
  EXPECT_TRUE(stands("the printer burns"));
  press(GLFW_KEY_ESCAPE);
  EXPECT_FALSE(stands("the printer burns"));
  EXPECT_EQ(lab_->screen, WindowScreen::kSessions);
  press(GLFW_KEY_ESCAPE);
  EXPECT_EQ(lab_->screen, WindowScreen::kLab);
}

TEST_F(Actions, lettersShrinkAndGetTheirUsualSizeBack) {
  press(GLFW_KEY_MINUS, /*ctrl=*/true);
  EXPECT_NEAR(surface_->fontScale(), 0.9, 1e-9);
  press(GLFW_KEY_0, /*ctrl=*/true);
  EXPECT_EQ(surface_->fontScale(), 1);
}

TEST_F(Actions, enterIsTheWayOutOfAnEmptyScreen) {
  logIn();
  const std::pair<WindowScreen, WindowScreen> ways[] = {{WindowScreen::kLive, WindowScreen::kLab},
                                                        {WindowScreen::kReplay, WindowScreen::kSessions},
                                                        {WindowScreen::kCompare, WindowScreen::kSessions},
                                                        {WindowScreen::kRerun, WindowScreen::kSessions},
                                                        {WindowScreen::kScores, WindowScreen::kSessions}};
  for (const auto& [from, to] : ways) {
    lab_->screen = from;
    frames(2);
    press(GLFW_KEY_ENTER);
    EXPECT_EQ(lab_->screen, to) << static_cast<int>(from);
  }
}

TEST_F(Actions, enterLogsInAndTheFormReportsAWrongPassword) {
  lab_->form.password = "wrong";
  press(GLFW_KEY_ENTER);
  ASSERT_TRUE(untilText("does not accept this name and password")) << window_->text();
  EXPECT_EQ(lab_->screen, WindowScreen::kLogin);
  EXPECT_FALSE(stands("Log out")) << "there is no bar before the lab";
  lab_->form.password = "correct horse battery";
  ASSERT_TRUE(click("Log in"));
  ASSERT_TRUE(until([&] { return lab_->inside(); })) << window_->text();
}

// --- the lab

TEST_F(Actions, tilesAreButtonsAndFiltersAreBoxAndField) {
  (void)server_.addStation("bench-1");
  (void)server_.addStation("bench-2");
  logIn();
  ASSERT_TRUE(until([&] { return lab_->overview.size() == 2; }));
  frames(2);
  ASSERT_TRUE(click("only online"));
  EXPECT_TRUE(stands("No station matches")) << "both are offline";
  press(GLFW_KEY_ENTER);
  EXPECT_FALSE(lab_->filter.only_online) << "Enter shows all";
  ASSERT_TRUE(click("only online"));
  EXPECT_TRUE(lab_->filter.only_online);
  ASSERT_TRUE(click("Show all"));
  EXPECT_FALSE(lab_->filter.only_online);
  ASSERT_TRUE(click("##find"));
  type("h-2");
  EXPECT_EQ(lab_->filter.text, "h-2");
  EXPECT_TRUE(stands("bench-2"));
  EXPECT_FALSE(stands("bench-1"));
  EXPECT_FALSE(clickTile("bench-1"));
  ASSERT_TRUE(clickTile("bench-2"));
  ASSERT_NE(lab_->live(), nullptr);
  EXPECT_EQ(lab_->live()->station(), "bench-2");
  EXPECT_EQ(lab_->screen, WindowScreen::kLive);
}

// --- watching a lesson

/// The live screen, fed with a lesson's samples by hand; the person has logged in.
class LiveActions : public WithMouse {
 protected:
  void openWithSamples() {
    (void)server_.addStation("bench-1");
    ASSERT_NO_FATAL_FAILURE(logIn());
    lab_->open("bench-1");
    pb::StationStatus status;
    status.set_station("bench-1");
    status.set_online(true);
    status.set_session_id(info_.description().session_id());
    lab_->live()->onStatus(status);
    for (std::size_t k = 0; k < samples_.size(); k += 20) lab_->live()->feed(lessonFrame(info_, samples_, k));
    lab_->live()->setSession(info_);
    frames(2);
  }
  const std::string profile_ = sampleProfile("shoulder-adult");
  pb::SessionInfo info_ = lessonInfo(profile_);
  std::vector<GestureSample> samples_ = lessonSamples(profile_, {.depth_m = 0.02, .seconds = 1});
};

TEST_F(LiveActions, keysScrollPauseAndFollow) {
  ASSERT_NO_FATAL_FAILURE(openWithSamples());
  LiveStation& live = *lab_->live();
  const double first_s = live.trace().firstTime_s(), last_s = live.trace().lastTime_s();
  ASSERT_GT(last_s - first_s, 2);
  press(GLFW_KEY_LEFT);
  EXPECT_NEAR(live.viewEnd_s(), last_s - 1, 1e-9);
  EXPECT_TRUE(stands("PAUSED 1.0 s behind")) << window_->text();
  press(GLFW_KEY_RIGHT);
  EXPECT_NEAR(live.viewEnd_s(), last_s, 1e-9);
  EXPECT_TRUE(live.paused()) << "a person who scrolls has not asked to follow";
  press(GLFW_KEY_PAGE_UP);
  EXPECT_EQ(live.viewEnd_s(), first_s) << "10 s are more than there are";
  press(GLFW_KEY_PAGE_DOWN);
  EXPECT_EQ(live.viewEnd_s(), last_s);
  press(GLFW_KEY_HOME);
  EXPECT_EQ(live.viewEnd_s(), first_s);
  press(GLFW_KEY_END);
  EXPECT_FALSE(live.paused());
  press(GLFW_KEY_SPACE);
  EXPECT_TRUE(live.paused());
  press(GLFW_KEY_SPACE);
  EXPECT_FALSE(live.paused());
  // and presses no button, not even after an arrow key
  press(GLFW_KEY_LEFT);
  press(GLFW_KEY_SPACE);
  EXPECT_FALSE(live.paused());
  EXPECT_EQ(lab_->screen, WindowScreen::kLive);
  EXPECT_FALSE(lab_->stop_question.asking());
}

TEST_F(LiveActions, keysChangeThePlotsAndTheCamera) {
  ASSERT_NO_FATAL_FAILURE(openWithSamples());
  LiveStation& live = *lab_->live();
  const double span_s = live.span_s();
  press(GLFW_KEY_EQUAL);
  EXPECT_NEAR(live.span_s(), span_s / 1.5, 1e-9);
  press(GLFW_KEY_MINUS);
  press(GLFW_KEY_MINUS);
  EXPECT_NEAR(live.span_s(), span_s * 1.5, 1e-9);
  const std::pair<PlotSet, const char*> sets[] = {{PlotSet::kMotion, "● Motion"},
                                                  {PlotSet::kWallAndTip, "● Wall and tip"},
                                                  {PlotSet::kForces, "● Forces"}};
  for (const auto& [set, words] : sets) {
    press(GLFW_KEY_P);
    EXPECT_EQ(window_->live_screen.plots, set);
    EXPECT_TRUE(stands(words)) << words;
  }
  const std::pair<Look, const char*> looks[] = {
      {Look::kAbove, "● From above"}, {Look::kSide, "● From the side"}, {Look::kTrainee, "● As the trainee"}};
  for (const auto& [look, words] : looks) {
    press(GLFW_KEY_V);
    EXPECT_EQ(window_->live_screen.pane().looking(), look);
    EXPECT_TRUE(stands(words)) << words;
  }
  ASSERT_TRUE(click("Free (drag)"));
  EXPECT_EQ(window_->live_screen.pane().looking(), Look::kFree);
}

TEST_F(LiveActions, whatCannotBeSentStaysInItsField) {
  lab_->open("bench-1");
  frames(2);
  ASSERT_TRUE(click("##message"));
  type("slower, please");
  press(GLFW_KEY_ENTER);
  EXPECT_TRUE(stands("not done: there is no connection to the server now")) << window_->text();
  EXPECT_TRUE(stands("slower, please"));
  ASSERT_TRUE(click("##remark"));
  type("too steep");
  ASSERT_TRUE(click("Annotate"));
  EXPECT_TRUE(stands("there is no session to annotate: the station is idle")) << window_->text();
  EXPECT_TRUE(stands("too steep"));
}

TEST_F(LiveActions, theTraineeReceivesTypedClickedAndChosenMessages) {
  BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_NO_FATAL_FAILURE(logIn());
  ASSERT_TRUE(until([&] {
    const StationTile* const tile = lab_->overview.find("bench-1");
    return tile != nullptr && tile->online && !tile->session_id.empty();
  }));
  lab_->open("bench-1");
  ASSERT_TRUE(until([&] { return !lab_->live()->trace().empty() && !lab_->exercises().empty(); }));
  const auto heard = [&](const std::string& words) {
    return until(
        [&] { return lab_->commands.waiting() == 0 && bench.heard().find(words) != std::string::npos; });
  };

  // while a person types, keys are letters
  press(GLFW_KEY_M);
  const PlotSet plots = window_->live_screen.plots;
  type("hm");
  press(GLFW_KEY_P);
  press(GLFW_KEY_SPACE);
  EXPECT_EQ(window_->live_screen.plots, plots);
  EXPECT_FALSE(lab_->live()->paused());
  press(GLFW_KEY_ENTER);
  ASSERT_TRUE(heard("anna: hm\n")) << bench.heard();
  EXPECT_TRUE(untilText("bench-1: message delivered"));
  EXPECT_TRUE(stands("message to the trainee")) << "the field is empty again: " << window_->text();

  const AidList before = lab_->aidsNow();
  ASSERT_TRUE(hasAid(before, pb::Exercise::DEPTH)) << "else this test shows nothing";
  ASSERT_TRUE(click("##aids"));
  ASSERT_TRUE(click(std::string(aidWord(pb::Exercise::DEPTH))));
  EXPECT_FALSE(hasAid(lab_->aidsNow(), pb::Exercise::DEPTH));
  EXPECT_EQ(lab_->aidsNow().size(), before.size() - 1);
  EXPECT_TRUE(heard("aids " + std::to_string(before.size() - 1) + "\n")) << bench.heard();
  ASSERT_TRUE(click("As the exercise sets it"));
  EXPECT_TRUE(hasAid(lab_->aidsNow(), pb::Exercise::DEPTH));
  EXPECT_TRUE(heard("aids 0\n")) << "as it is reset: " << bench.heard();
  press(GLFW_KEY_ESCAPE);  // the list's Escape

  lab_->screen = WindowScreen::kLive;
  frames(2);
  const ExerciseChoice exercise = lab_->exercises().front();
  ASSERT_TRUE(click("##next"));
  ASSERT_TRUE(click(exercise.name + "##" + exercise.id));
  EXPECT_TRUE(heard("next " + exercise.id + "\n")) << bench.heard();

  // stopping a lesson asks a question; its Escape must not reach the screen
  for (const int harmless : {GLFW_KEY_ESCAPE, GLFW_KEY_ENTER}) {
    ASSERT_TRUE(click("Stop lesson …"));
    ASSERT_TRUE(lab_->stop_question.asking());
    press(harmless);
    EXPECT_FALSE(lab_->stop_question.asking());
    EXPECT_EQ(lab_->screen, WindowScreen::kLive);
    EXPECT_THAT(bench.heard(), Not(HasSubstr("stop ")));
  }
  ASSERT_TRUE(click("Stop lesson …"));
  ASSERT_TRUE(click("##reason"));
  type("wrong side");
  press(GLFW_KEY_ENTER);  // the field's Enter
  EXPECT_THAT(bench.heard(), Not(HasSubstr("stop ")));
  press(GLFW_KEY_DELETE);
  EXPECT_TRUE(heard("stop wrong side\n")) << bench.heard();
  EXPECT_FALSE(lab_->stop_question.asking());
  EXPECT_TRUE(untilText("bench-1: the lesson is stopped"));
}

}  // namespace
}  // namespace needlelab
