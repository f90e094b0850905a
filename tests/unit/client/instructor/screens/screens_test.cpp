// Each screen against a server: its texts and its actions.
#include "tests/unit/client/instructor/screens/window_lab.h"

#include <GLFW/glfw3.h>

#include <algorithm>
#include <cmath>

#include "common/base/files/files.h"
#include "tests/unit/client/instructor/model/change_course.h"
#include "tests/unit/client/instructor/model/upload_lesson.h"
#include "tests/unit/client/instructor/status_alarms.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

class Screens : public WindowLab {
 protected:
  void logIn() {
    lab_->logIn();
    ASSERT_TRUE(until([&] {
      const std::string text = window_->text();
      return text.find("help") != std::string::npos || text.find("No station") != std::string::npos;
    })) << window_->text();
  }
};

TEST_F(Screens, aLabWithoutStationsSaysHowToAddOne) {
  frames(2);
  EXPECT_THAT(window_->text(), HasSubstr("needlelab: instructor"));
  lab_->logIn();
  ASSERT_TRUE(untilText("No stations yet")) << window_->text();
  EXPECT_THAT(window_->text(), HasSubstr("needlelab-admin station add"));
}

TEST_F(Screens, whoNeedsHelpComesFirstAndIsLookedOverByOneKey) {
  std::vector<std::unique_ptr<BenchStation>> benches;
  for (int i = 1; i <= 8; ++i) {
    const std::string name = "bench-" + std::to_string(i);
    benches.push_back(
        std::make_unique<BenchStation>(server_, name, server_.addStation(name),
                                       "trainee " + std::to_string(i), [i](pb::StationStatus& status) {
                                         if (i == 6) addAlarm(status, "hazard", 1, true, "axillary nerve");
                                       }));
  }
  logIn();
  ASSERT_TRUE(untilText("axillary nerve")) << window_->text();
  ASSERT_TRUE(
      until([&] { return lab_->overview.counts()[static_cast<std::size_t>(Need::kPractising)] == 7; }));
  EXPECT_THAT(window_->text(), HasSubstr("1 needs help"));
  press(GLFW_KEY_H);
  ASSERT_TRUE(untilText("bench-6 · trainee 6")) << window_->text();
  ASSERT_TRUE(
      until([&] { return lab_->live()->trace().lastTime_s() > lab_->live()->trace().firstTime_s() + 1; }));
  const auto limits = lab_->requirementsNow();
  EXPECT_TRUE(std::any_of(limits.begin(), limits.end(), [](const PlotRequirement& each) {
    return each.measure == "peak_force_n" && each.max;
  })) << "the plots draw what the exercise requires";
  EXPECT_GT(lab_->live()->latency().count(), 0u);
}

/// A course with so many long exercises that one page with all of them leaves no room for the courses after
/// it.
pb::Curriculum longCourse(const std::string& id) {
  pb::Curriculum course;
  course.set_id(id);
  course.set_name(id);
  for (int i = 0; i < 600; ++i) {
    pb::Exercise& exercise = *course.add_exercises();
    exercise.set_id(id + "-" + std::to_string(i));
    exercise.set_name("long");
    exercise.set_description(std::string(1000, 'x'));
    exercise.set_profile_id("shoulder-adult");
  }
  return course;
}

TEST_F(Screens, theLivePlanFollowsTheLessonAndItsLimb) {
  server_.addUser("mia", pb::CURRICULUM_MANAGER, "battery horse correct");
  auto manager = server_.connect(personLogin("mia", "battery horse correct"));
  ASSERT_TRUE(manager.ok()) << manager.error().message;
  for (const char* const id : {"a-first", "a-second"})
    ASSERT_NO_FATAL_FAILURE(putCourse(*manager, longCourse(id)));
  pb::Request list;
  list.mutable_list_exercises();
  const auto first_page = manager->call(list);
  ASSERT_TRUE(first_page.ok()) << first_page.error().message;
  ASSERT_NE(first_page->exercises().next_page(), "") << "else this test shows nothing";
  (void)server_.addStation("bench-0");
  logIn();
  ASSERT_TRUE(until([&] { return !lab_->exercises().empty(); }));
  EXPECT_GT(lab_->exercises().size(), 1200u) << "those of all pages";

  // changed after the log-in, before the lesson
  ASSERT_NO_FATAL_FAILURE(changeExercise(*manager, "shoulder-bursa", [](pb::Exercise& exercise) {
    exercise.mutable_plan()->mutable_entry_m()->set_x(0.001);
    exercise.mutable_plan()->mutable_target_m()->set_x(0.001);
    exercise.mutable_plan()->clear_direction();
    exercise.mutable_plan()->mutable_target_m()->set_z(-0.02);
  }));
  // a quarter turn about y: the limb's z is W's x, and its x is W's −z
  BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina", {},
                     {0.1, 0.2, 0.3, 0, std::sqrt(0.5), 0, std::sqrt(0.5)});
  lab_->open("bench-1");
  ASSERT_TRUE(until([&] {
    const auto plan = lab_->planNow();
    return plan && norm(plan->entry_W_m - Vec3{0.1, 0.2, 0.3}) > 5e-4;
  })) << "the plan of the log-in, or none";
  const auto plan = lab_->planNow();
  EXPECT_NEAR(norm(plan->entry_W_m - Vec3{0.1, 0.2, 0.299}), 0, 1e-9);
  EXPECT_NEAR(norm(normalized(plan->to_W_m - plan->entry_W_m) - Vec3{-1, 0, 0}), 0, 1e-9);
}

TEST_F(Screens, anInstructorsMessageArrivesAndIsConfirmed) {
  BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_TRUE(script("login\nwait-station bench-1 lesson\nopen station bench-1\nwait-text latency\n"
                     "message \"slower, please\"\naids \"depth, force\"\n"
                     "stop-lesson \"enough for today\"")
                  .ok());
  const auto& notices = lab_->notices.all();
  ASSERT_FALSE(notices.empty());
  EXPECT_THAT(notices.back().text, HasSubstr("is stopped"));
  ASSERT_TRUE(script("screenshot " + (files_.path() / "live.png").string()).ok());
  EXPECT_THAT(bench.heard(), HasSubstr("anna: slower, please"));
  EXPECT_THAT(bench.heard(), HasSubstr("aids 2"));
  EXPECT_THAT(bench.heard(), HasSubstr("stop enough for today"));
  EXPECT_TRUE(std::filesystem::exists(files_.path() / "live.png"));
}

TEST_F(Screens, aLostServerTakesNothingAwayAndComesBackByItself) {
  auto bench = std::make_unique<BenchStation>(server_, "bench-1", server_.addStation("bench-1"), "tina");
  logIn();
  ASSERT_TRUE(untilText("tina"));
  lab_->open("bench-1");
  ASSERT_TRUE(until([&] { return lab_->live() != nullptr && lab_->live()->trace().lastTime_s() > 0.5; }));
  (void)server_.stop();
  ASSERT_TRUE(untilText("The screen keeps the last data")) << window_->text();
  EXPECT_EQ(lab_->screen, WindowScreen::kLive);
  EXPECT_FALSE(lab_->live()->trace().empty());
  const double before_s = lab_->live()->trace().lastTime_s();
  server_.start();
  ASSERT_TRUE(until([&] { return lab_->live()->trace().lastTime_s() > before_s + 0.5; })) << window_->text();
  EXPECT_THAT(window_->text(), Not(HasSubstr("The screen keeps the last data")));
  bench.reset();
}

TEST_F(Screens, aRecordingIsFoundReplayedComparedRunAgainAndExported) {
  const std::string key = server_.addStation("bench-1");
  const std::string profile = sampleProfile("shoulder-adult");
  const auto first = lessonInfo(profile), second = lessonInfo(profile, "tina", 1);
  uploadLesson(server_, key, first, lessonSamples(profile, {.depth_m = 0.022, .seconds = 1}));
  uploadLesson(server_, key, second,
               lessonSamples(profile, {.depth_m = 0.02, .seconds = 1.5, .aside_m = 0.002}));
  const std::string html = (files_.path() / "report.html").string(),
                    csv = (files_.path() / "samples.csv").string();
  const std::string annotated = (files_.path() / "annotated.html").string();
  const Status done = script(
      "login\nsearch tin\nexpect \"2 sessions\"\nsearch nobody\nexpect \"No session matches\"\n"
      "replay newest\nexpect \"Shoulder phantom: subacromial bursa\"\nseek 1.2\nspeed 0.5\nloop 0.5 "
      "1.4\nplay\nwait-replay "
      "1.3\npause\n"
      "annotate \"look at the angle here\"\nstep -2\nexport " +
      annotated +
      "\n"
      "compare previous newest depth\nexpect \"second differs\"\ncompare newest previous dtw\nexpect "
      "\"warped onto\"\n"
      "rerun own DIRECT\nexpect \"did not feel this\"\nscores\nwait-text Measures\nexport " +
      html + "\nexport " + csv);
  ASSERT_TRUE(done.ok()) << done.error().message;
  // The annotated session is again the first one in the second comparison.
  ASSERT_EQ(lab_->analysis.remarks().size(), 1u);
  EXPECT_EQ(lab_->analysis.remarks()[0].author(), "anna");
  const auto page = readWholeFile(html);
  ASSERT_TRUE(page.ok());
  EXPECT_THAT(*page, HasSubstr("look at the angle here"));
  EXPECT_TRUE(std::filesystem::exists(csv));
  // The report contains a remark made a moment before.
  EXPECT_THAT(*readWholeFile(annotated), HasSubstr("anna: look at the angle here"));
  // an impossible action is reported, and nothing is lost
  EXPECT_THAT(script("export nowhere.txt").error().message, HasSubstr("must end in .html"));
  EXPECT_THAT(script("compare newest reference").error().message, HasSubstr("reference"));
  EXPECT_TRUE(lab_->analysis.first());
}

TEST_F(Screens, afterTheLessonATileHasTheServersVerdict) {
  const std::string profile = sampleProfile("shoulder-adult");
  const auto info = lessonInfo(profile);
  uploadLesson(server_, server_.addStation("bench-1"), info, lessonSamples(profile, {.depth_m = 0.022}));
  logIn();
  pb::StationStatus status;
  status.set_station("bench-1");
  status.set_online(true);
  for (const std::string& session : {info.description().session_id(), std::string()}) {
    status.set_session_id(session);
    lab_->overview.onStatus(status, lab_->now_s());
  }
  EXPECT_TRUE(untilText("not passed")) << window_->text();
}

TEST_F(Screens, emptyScreensSayWhatToDo) {
  (void)server_.addStation("bench-1");
  logIn();
  const std::vector<std::pair<WindowScreen, const char*>> rows = {
      {WindowScreen::kLive, "No station is being watched"},
      {WindowScreen::kSessions, "No session matches"},
      {WindowScreen::kReplay, "No session is loaded"},
      {WindowScreen::kCompare, "Nothing to compare yet"},
      {WindowScreen::kRerun, "No session is loaded"},
      {WindowScreen::kScores, "No session is loaded"}};
  for (const auto& [screen, words] : rows) {
    lab_->screen = screen;
    EXPECT_TRUE(untilText(words)) << words << ": " << window_->text();
  }
}

TEST_F(Screens, keysListThemselvesAndLettersGrow) {
  (void)server_.addStation("bench-1");
  logIn();
  press(GLFW_KEY_F1);
  EXPECT_THAT(window_->text(), HasSubstr("Keyboard"));
  press(GLFW_KEY_ESCAPE);
  EXPECT_THAT(window_->text(), Not(HasSubstr("Keyboard")));
  const double before = surface_->fontScale();
  press(GLFW_KEY_EQUAL, /*ctrl=*/true);
  EXPECT_NEAR(surface_->fontScale(), before + 0.1, 1e-6);
}

}  // namespace
}  // namespace needlelab
