// What clicks and keys do with stored lessons: sessions, replay, compare, re-run.
#include "tests/unit/client/instructor/screens/mouse.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "tests/unit/client/instructor/model/upload_lesson.h"

namespace needlelab {
namespace {

using namespace test;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Two stored lessons of 2.5 s: ada's and, a minute later, tina's.
class StoredActions : public WithMouse {
 protected:
  void SetUp() override {
    WithMouse::SetUp();
    if (!surface_) return;
    const std::string key = server_.addStation("bench-1"), profile = sampleProfile("shoulder-adult");
    const auto first = lessonInfo(profile, "ada"), second = lessonInfo(profile, "tina", 1);
    uploadLesson(server_, key, first, lessonSamples(profile, {.depth_m = 0.022, .seconds = 1}));
    uploadLesson(server_, key, second, lessonSamples(profile, {.depth_m = 0.02, .seconds = 1}));
    ada_ = first.description().session_id();
    tina_ = second.description().session_id();
  }
  void showSessions() {
    ASSERT_TRUE(script("login\nsessions\nwait-text \"2 sessions\"").ok()) << window_->text();
  }
  [[nodiscard]] std::string traineeOfRow(std::size_t i) const {
    return lab_->sessions.rows().at(i).description().trainee();
  }
  bool loaded() {
    return until([&] { return !lab_->analysis.busy() && lab_->analysis.first() != nullptr; });
  }
  std::string ada_, tina_;
};

TEST_F(StoredActions, aColumnsHeadSortsInItsOneDirection) {
  ASSERT_NO_FATAL_FAILURE(showSessions());
  ASSERT_EQ(lab_->sessions.rows().size(), 2u);
  EXPECT_EQ(traineeOfRow(0), "tina") << "the newest first";
  EXPECT_THAT(window_->text(), AllOf(HasSubstr("2025-11-21 00:40"), HasSubstr("2025-11-21 00:41")));
  constexpr int kColumns = 8, kWhen = 0, kTrainee = 1;
  for (int time = 0; time < 2; ++time) {
    EXPECT_EQ(clickHead(kColumns, kTrainee), ImGuiSortDirection_Ascending);
    EXPECT_EQ(traineeOfRow(0), "ada") << "also after the second click";
  }
  for (int time = 0; time < 2; ++time) {
    EXPECT_EQ(clickHead(kColumns, kWhen), ImGuiSortDirection_Descending);
    EXPECT_EQ(traineeOfRow(0), "tina");
  }
}

TEST_F(StoredActions, aRowsButtonsLoadItsSession) {
  ASSERT_NO_FATAL_FAILURE(showSessions());
  EXPECT_FALSE(click("beside", 1)) << "nothing is loaded that it could stand beside";
  ASSERT_TRUE(click("Replay", 1));
  EXPECT_EQ(lab_->screen, WindowScreen::kReplay);
  ASSERT_TRUE(loaded());
  EXPECT_EQ(lab_->analysis.first()->info.description().session_id(), ada_);
  frames(2);
  EXPECT_TRUE(stands("ada, Shoulder phantom: subacromial bursa, 2025-11-21 00:40")) << window_->text();
  lab_->screen = WindowScreen::kSessions;
  frames(2);
  ASSERT_TRUE(click("beside", 0));
  EXPECT_EQ(lab_->screen, WindowScreen::kCompare);
  ASSERT_TRUE(until([&] { return lab_->analysis.comparison().has_value(); }));
  EXPECT_EQ(lab_->analysis.second()->info.description().session_id(), tina_);
  frames(2);
  EXPECT_TRUE(
      stands("— ada, Shoulder phantom: subacromial bursa, 2025-11-21 00:40 – – tina, Shoulder phantom: "
             "subacromial bursa, 2025-11-21 00:41"))
      << window_->text();
  ASSERT_TRUE(click("by time"));
  ASSERT_TRUE(until([&] { return lab_->analysis.comparison()->alignment == Alignment::kTime; }));
  ASSERT_TRUE(click("Other session …"));
  EXPECT_EQ(lab_->screen, WindowScreen::kSessions);
  frames(2);
  ASSERT_TRUE(click("Scores", 0));
  EXPECT_EQ(lab_->screen, WindowScreen::kScores);
  ASSERT_TRUE(until([&] {
    return lab_->analysis.report().has_value() &&
           lab_->analysis.first()->info.description().session_id() == tina_;
  })) << window_->text();
}

TEST_F(StoredActions, aSearchUsesFieldListAndKeyAndFlagsInvalidDays) {
  ASSERT_NO_FATAL_FAILURE(showSessions());
  ASSERT_TRUE(click("##who"));
  type("ad");
  press(GLFW_KEY_ENTER);
  EXPECT_EQ(lab_->sessions.query().search, "ad");
  ASSERT_TRUE(untilText("1 session ")) << window_->text();
  EXPECT_EQ(traineeOfRow(0), "ada");
  ASSERT_TRUE(click("##verdict"));
  ASSERT_TRUE(click("passed"));
  EXPECT_EQ(lab_->sessions.query().verdict, pb::ListSessions::PASSED) << "a choice searches at once";
  // Enter starts the search; on an empty list it leaves the screen
  window_->sessions_screen.query = {};
  window_->sessions_screen.query.from = "yesterday";
  ASSERT_TRUE(click("Search"));
  EXPECT_TRUE(stands("from: 'yesterday' is not a date; write it as 2026-11-21")) << window_->text();
  EXPECT_FALSE(stands("0 sessions")) << "nothing was looked for";
  window_->sessions_screen.query = {};
  window_->sessions_screen.query.search = "nobody";
  press(GLFW_KEY_ENTER);
  ASSERT_TRUE(untilText("No session matches")) << window_->text();
  press(GLFW_KEY_ENTER);
  EXPECT_EQ(lab_->sessions.query(), SessionQuery{});
  ASSERT_TRUE(untilText("2 sessions"));
}

TEST_F(StoredActions, keysAndButtonsPlayStepAndLoop) {
  ASSERT_TRUE(script("login\nreplay newest").ok()) << window_->text();
  ReplayPlayer& player = lab_->analysis.player;
  const double first_s = player.first_s(), last_s = player.last_s();
  ASSERT_NEAR(last_s - first_s, 2.499, 1e-6);
  EXPECT_TRUE(stands("1× speed"));
  EXPECT_TRUE(stands("0:00.0 of 0:02.5")) << window_->text();
  press(GLFW_KEY_RIGHT);
  EXPECT_NEAR(player.at_s(), first_s + 0.01, 1e-9);
  press(GLFW_KEY_PAGE_DOWN);
  EXPECT_NEAR(player.at_s(), first_s + 0.11, 1e-9);
  press(GLFW_KEY_LEFT);
  press(GLFW_KEY_PAGE_UP);
  EXPECT_NEAR(player.at_s(), first_s, 1e-9);
  press(GLFW_KEY_SPACE);
  EXPECT_TRUE(player.playing());
  EXPECT_EQ(lab_->screen, WindowScreen::kReplay) << "Space presses no button, also not after an arrow";
  EXPECT_TRUE(stands("Pause"));
  press(GLFW_KEY_SPACE);
  EXPECT_FALSE(player.playing());
  press(GLFW_KEY_END);
  EXPECT_EQ(player.at_s(), last_s);
  press(GLFW_KEY_HOME);
  EXPECT_EQ(player.at_s(), first_s);
  press(GLFW_KEY_EQUAL);
  EXPECT_EQ(player.speed(), 2);
  press(GLFW_KEY_MINUS);
  press(GLFW_KEY_MINUS);
  EXPECT_EQ(player.speed(), 0.5);
  EXPECT_TRUE(stands("0.5× speed"));

  press(GLFW_KEY_L);
  ASSERT_TRUE(player.loop());
  EXPECT_EQ(player.loop()->from_s, first_s);
  EXPECT_NEAR(player.loop()->to_s, first_s + 2, 1e-9);
  EXPECT_TRUE(stands("End the loop"));
  press(GLFW_KEY_L);
  EXPECT_FALSE(player.loop());

  ASSERT_TRUE(click("step ▶"));
  EXPECT_NEAR(player.at_s(), first_s + 0.01, 1e-9);
  ASSERT_TRUE(click("◀ step"));
  EXPECT_NEAR(player.at_s(), first_s, 1e-9);
  ASSERT_TRUE(click("##speed"));
  ASSERT_TRUE(click("0.25×"));
  EXPECT_EQ(player.speed(), 0.25);
  player.seek(first_s + 0.5);
  ASSERT_TRUE(click("Loop 2 s from here"));
  EXPECT_NEAR(player.loop().value_or(ReplayLoop{}).from_s, first_s + 0.5, 1e-9);
  EXPECT_EQ(player.loop().value_or(ReplayLoop{}).to_s, last_s) << "the recording ends before";
  player.seek(last_s);
  ASSERT_TRUE(click("❙◀"));
  EXPECT_NEAR(player.at_s(), first_s + 0.5, 1e-9) << "the loop's beginning";
  EXPECT_TRUE(stands("0:00.5 of 0:02.5")) << window_->text();

  press(GLFW_KEY_N);
  type("look at this");
  press(GLFW_KEY_ENTER);
  ASSERT_TRUE(until([&] { return lab_->analysis.remarks().size() == 1; })) << window_->text();
  EXPECT_EQ(lab_->analysis.remarks()[0].text(), "look at this");
  EXPECT_EQ(lab_->analysis.remarks()[0].tick(), 500u) << "at 1 kHz";
}

TEST_F(StoredActions, aScreenDoesNotBlameItsWorkForAnothersError) {
  ASSERT_TRUE(script("login\nreplay newest").ok()) << window_->text();
  lab_->analysis.exportTo("nowhere.txt");
  const std::string trouble = "nowhere.txt: the name must end in .html (report) or .csv (samples)";
  EXPECT_EQ(lab_->analysis.trouble(), trouble);
  lab_->screen = WindowScreen::kRerun;
  frames(2);
  EXPECT_THAT(window_->text(),
              AllOf(HasSubstr("Choose a patient or a model, then run"), Not(HasSubstr("The re-run failed"))));
  lab_->screen = WindowScreen::kCompare;
  frames(2);
  EXPECT_THAT(window_->text(),
              AllOf(HasSubstr("One session is loaded"), Not(HasSubstr("The comparison failed"))));

  lab_->analysis.rerun("no-such-patient", "");
  ASSERT_TRUE(until([&] { return !lab_->analysis.busy() && !lab_->analysis.trouble().empty(); }));
  frames(2);
  EXPECT_THAT(window_->text(),
              AllOf(HasSubstr("One session is loaded"), Not(HasSubstr("The comparison failed"))));
  lab_->screen = WindowScreen::kRerun;
  frames(2);
  EXPECT_THAT(window_->text(), AllOf(HasSubstr("The re-run failed"), HasSubstr(lab_->analysis.trouble())));

  ASSERT_TRUE(click("force model"));
  ASSERT_TRUE(click("direct"));
  ASSERT_TRUE(click("Run"));
  ASSERT_TRUE(until([&] { return lab_->analysis.rerunResult() != nullptr; })) << window_->text();
  frames(2);
  EXPECT_THAT(window_->text(), AllOf(HasSubstr("did not feel this"), Not(HasSubstr("The re-run failed"))));
}

TEST_F(StoredActions, aRemarksKeyBeforeASessionIsLoadedWaitsForNoField) {
  ASSERT_TRUE(script("login").ok());
  lab_->screen = WindowScreen::kReplay;
  press(GLFW_KEY_N);
  ASSERT_TRUE(script("replay newest").ok()) << window_->text();
  frames(3);
  press(GLFW_KEY_SPACE);
  EXPECT_TRUE(lab_->analysis.player.playing()) << "the key is not typed into a field";
}

}  // namespace
}  // namespace needlelab
