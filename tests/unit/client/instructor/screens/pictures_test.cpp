// Compares each screen with a reference picture that a person has checked.
#include "tests/unit/client/instructor/screens/window_lab.h"

#include <algorithm>

#include "tests/support/pictures/picture_check.h"
#include "tests/unit/client/instructor/model/upload_lesson.h"
#include "tests/unit/client/instructor/status_alarms.h"

namespace needlelab {
namespace {

using namespace test;

class Pictures : public WindowLab {
 protected:
  std::string key_, second_key_;
  void SetUp() override {
    WindowLab::SetUp();
    if (!surface_) return;
    key_ = server_.addStation("bench-1");
  }
  /// Two lessons of tina, always the same.
  void upload() {
    const std::string profile = sampleProfile("shoulder-adult");
    const auto first = lessonInfo(profile), second = lessonInfo(profile, "tina", 1);
    uploadLesson(server_, key_, first, lessonSamples(profile, {.depth_m = 0.022, .seconds = 1}));
    uploadLesson(server_, key_, second,
                 lessonSamples(profile, {.depth_m = 0.024, .seconds = 1.5, .aside_m = 0.003}));
  }
  /// `more`: further areas that differ from run to run.
  void looksAsIs(const std::string& name, std::vector<PictureArea> more = {}) {
    frames(3);
    PictureTolerance tolerance;
    // the server's port
    tolerance.passed_over = {{640, 0, 640, 44}};
    tolerance.passed_over.insert(tolerance.passed_over.end(), more.begin(), more.end());
    EXPECT_TRUE(
        looksLike(surface_->picture(), std::string(NEEDLELAB_REFERENCE) + "/" + name + ".png", tolerance));
  }
};

TEST_F(Pictures, logIn) {
  lab_->form = {};
  lab_->logIn();
  looksAsIs("login");
}

TEST_F(Pictures, lab) {
  for (int i = 2; i <= 8; ++i) (void)server_.addStation("bench-" + std::to_string(i));
  ASSERT_TRUE(script("login\nwait-text \"8 offline\"").ok());
  const auto say = [&](int i, const std::string& trainee,
                       const std::function<void(pb::StationStatus&)>& change) {
    pb::StationStatus status;
    status.set_station("bench-" + std::to_string(i));
    status.set_online(true);
    status.set_session_id(std::string(16, static_cast<char>(i)));
    status.set_trainee(trainee);
    status.set_exercise_id("shoulder-bursa");
    status.set_phase(1);
    status.set_layer(2);
    status.set_tissue("muscle");
    status.set_insertion_m(0.0187);
    status.set_force_limit_n(5);
    status.set_wakeup_p99_us(43);
    for (int n = 0; n < 40; ++n) {
      status.set_force_n(2 + std::sin(0.3 * n + i));
      status.set_peak_force_n(std::max(status.peak_force_n(), status.force_n()));
      if (change) change(status);
      lab_->overview.onStatus(status, lab_->now_s());
    }
  };
  say(1, "anna", {});
  say(2, "bert", [](auto& s) { addAlarm(s, "hazard", 1, true, "axillary nerve"); });
  say(3, "carl", [](auto& s) { s.set_fault(4); });
  say(4, "dora", [](auto& s) {
    s.set_force_n(6.3);
    addAlarm(s, "force", 1, true, "6.3 N, allowed 5 N");
  });
  say(5, "emil", [](auto& s) { s.clear_session_id(), s.clear_trainee(); });
  say(6, "fay",
      [](auto& s) { s.set_trouble("the disk is nearly full: 300 MB are left"), s.set_missed_ticks(12); });
  say(7, "gus", {});
  say(7, "gus", [](auto& s) { s.clear_session_id(); });
  pb::SessionInfo failed;
  failed.mutable_description()->set_session_id(std::string(16, 7));
  failed.set_score_json("[]");
  failed.set_passed(false);
  lab_->overview.takeVerdict(failed);
  say(8, "hal", [](auto& s) { addAlarm(s, "hazard", 1, true, "axillary nerve"); });
  say(8, "ida", [](auto& s) { s.set_session_id("another-session-"); });
  looksAsIs("lab");
}

TEST_F(Pictures, lookOver) {
  BenchStation bench(server_, "bench-1", key_, "tina");
  ASSERT_TRUE(script("login\nwait-station bench-1 lesson\nopen station bench-1\nwait-text latency").ok());
  // a viewer that joins in tissue has no exact forces until the tip has left it: the round shown begins later
  ASSERT_TRUE(
      until([&] { return lab_->live()->trace().lastTime_s() - lab_->live()->trace().firstTime_s() > 10.2; }));
  lab_->live()->setSpan(2);
  // The hand repeats its motion every 3 s: 0.9 s into a round it is on the way in.
  const double newest_s = lab_->live()->trace().lastTime_s();
  lab_->live()->scrollTo(std::floor((newest_s - 3) / 3) * 3 + 0.9);
  looksAsIs("look-over", {{380, 80, 900, 30}, {680, 570, 600, 40}});
}

TEST_F(Pictures, sessionsReplayCompareRerunScores) {
  upload();
  ASSERT_TRUE(script("login\nsessions\nwait-text \"2 sessions\"").ok());
  looksAsIs("sessions");
  ASSERT_TRUE(script("replay newest\nseek 1.3").ok());
  looksAsIs("replay");
  ASSERT_TRUE(script("compare previous newest depth").ok());
  looksAsIs("compare");
  ASSERT_TRUE(script("rerun own DIRECT").ok());
  looksAsIs("rerun");
  ASSERT_TRUE(script("scores\nwait-text Measures\nwait-gone progress\nwait-gone reading").ok());
  looksAsIs("scores");
  window_->show_help = true;
  looksAsIs("help");
}

}  // namespace
}  // namespace needlelab
