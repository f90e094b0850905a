// The screens' texts for each state of the model. The test fills the model; no news arrives.
#include "tests/unit/client/instructor/screens/window_lab.h"

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <limits>
#include <utility>

#include "common/base/text/text.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/pictures/picture_check.h"
#include "tests/unit/client/instructor/model/lesson_frame.h"
#include "tests/unit/client/instructor/status_alarms.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

/// Returns whether no channel of the pixel differs by more than `tolerance` from the colour.
bool isNear(const RgbaImage& picture, int x, int y, Rgb colour, int tolerance) {
  const unsigned pixel = pixelAt(picture, x, y);
  const auto channel = [&](unsigned shift, float share) {
    return std::abs(static_cast<int>((pixel >> shift) & 255u) - static_cast<int>(share * 255.0F)) <=
           tolerance;
  };
  return channel(16, colour.red) && channel(8, colour.green) && channel(0, colour.blue);
}

class States : public WindowLab {
 protected:
  /// Draws the model and returns the screen's text.
  const std::string& shown(int times = 2) {
    for (int i = 0; i < times; ++i) {
      EXPECT_TRUE(surface_->beginFrame());
      window_->draw(true);
      surface_->endFrame();
    }
    return window_->text();
  }
  static pb::StationStatus practising(const std::string& station) {
    pb::StationStatus status;
    status.set_station(station);
    status.set_online(true);
    status.set_session_id(std::string(16, 's'));
    status.set_trainee("tina");
    status.set_exercise_id("shoulder-bursa");
    status.set_phase(1);
    status.set_layer(2);
    status.set_tissue("muscle");
    status.set_insertion_m(0.0187);
    status.set_force_n(2);
    status.set_force_limit_n(5);
    status.set_wakeup_p99_us(43);
    return status;
  }
};

TEST_F(States, aTileShowsWhatItsStationDoesAndNeeds) {
  struct Row {
    const char* name;
    std::function<void(pb::StationStatus&)> change;
    std::vector<const char*> said;
    std::vector<const char*> not_said;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Row> rows = {
      {"a lesson",
       [](auto&) {},
       {"bench-1", "practising", "tina", "shoulder-bursa", "going in, 18.7 mm, tip in muscle",
        "no one needs help", "1 practising"},
       {"missed", "spool", "no news", "loop"}},
      {"an unnamed layer", [](auto& s) { s.clear_tissue(); }, {"18.7 mm, tip in layer 3"}, {}},
      {"a layer that cannot be",
       [](auto& s) {
         s.clear_tissue(), s.set_layer(std::numeric_limits<std::int32_t>::max()), s.set_phase(0);
       },
       {"layer 2147"},
       {"layer -"}},
      {"outside", [](auto& s) { s.set_phase(0), s.set_layer(-1); }, {"outside"}, {"18.7 mm", "muscle"}},
      {"a phase that cannot be", [](auto& s) { s.set_phase(4'000'000'000u); }, {"outside, 18.7 mm"}, {}},
      {"no numbers",
       [nan](auto& s) { s.set_force_n(nan), s.set_insertion_m(nan), s.set_force_limit_n(nan); },
       {"going in, 0.0 mm"},
       {"nan"}},
      {"idle",
       [](auto& s) { s.clear_session_id(), s.clear_trainee(); },
       {"no one needs help", "1 waiting"},
       {"18.7"}},
      {"missed ticks and a spool",
       [](auto& s) { s.set_samples(5000), s.set_missed_ticks(12), s.set_spool_left(3); },
       {"no one needs help"},
       {"missed", "chunk"}},
      {"missed ticks that a hand feels",
       [](auto& s) { s.set_samples(5000), s.set_missed_ticks(120); },
       {"the force stutters", "1 needs help"},
       {"missed"}},
      {"a hand", [](auto& s) { s.set_hand_raised(true); }, {"hand up", "asks for help", "1 needs help"}, {}},
      {"a fault",
       [](auto& s) { s.set_fault(static_cast<std::uint32_t>(Fault::kTipTooFast)); },
       {"FAULT", "the needle's tip jumped", "1 needs help", "0 practising"},
       {}},
      {"too much force",
       [](auto& s) { addAlarm(s, "force", 1, true, "9.1 N, allowed 5 N"); },
       {"alarm", "TOO MUCH FORCE 9.1 N, allowed 5 N", "Seen"},
       {}},
      {"never online",
       [](auto& s) { s.set_online(false); },
       {"offline", "1 offline", "no one needs help"},
       {"18.7 mm", "loop: 99 %"}}};
  lab_->screen = WindowScreen::kLab;
  for (const Row& row : rows) {
    SCOPED_TRACE(row.name);
    lab_->overview = {};
    auto status = practising("bench-1");
    row.change(status);
    lab_->overview.onStatus(status, 0);
    const std::string& text = shown();
    for (const char* words : row.said) EXPECT_THAT(text, HasSubstr(words));
    for (const char* words : row.not_said) EXPECT_THAT(text, Not(HasSubstr(words)));
  }
}

TEST_F(States, aStationOfWhichNothingIsHeardIsNotShownAsHealthy) {
  lab_->screen = WindowScreen::kLab;
  lab_->overview.onStatus(practising("bench-1"), 0);
  lab_->overview.tick(kStale_s + 1);
  EXPECT_THAT(shown(), AllOf(HasSubstr("no news"), Not(HasSubstr("18.7 mm"))));
  lab_->overview.onStatus(practising("bench-1"), kStale_s + 2);
  EXPECT_THAT(shown(), AllOf(HasSubstr("18.7 mm"), Not(HasSubstr("no news"))));
  lab_->overview.connectionLost();
  EXPECT_THAT(shown(), HasSubstr("no news"));
  auto away = practising("bench-1");
  away.set_online(false);
  lab_->overview.onStatus(away, kStale_s + 3);
  EXPECT_THAT(shown(), AllOf(HasSubstr("lost mid-lesson"), HasSubstr("the lesson continues"),
                             HasSubstr("1 needs help")));
}

TEST_F(States, aTilesNeedIsVisibleNextToTheLongestName) {
  lab_->screen = WindowScreen::kLab;
  for (const double scale : {1.0, 1.5, 2.5}) {
    surface_->setFontScale(scale);
    for (const std::size_t letters : {std::size_t{4}, kMaxNameBytes}) {
      lab_->overview = {};
      auto status = practising(std::string(letters, 'W'));
      status.set_trainee(std::string(kMaxNameBytes, 'M'));
      status.set_fault(2);
      lab_->overview.onStatus(status, 0);
      shown(3);
      const RgbaImage picture = surface_->picture();
      // the tile has its own background; on it, letters in the colour of trouble
      const Rgb trouble = styleOf(Condition::kTrouble).colour;
      const Rgb ground = mixed(kPanelGrey, trouble, 0.2F);
      int left = picture.width, right = -1, top = picture.height, bottom = -1;
      for (int y = 0; y < picture.height; ++y)
        for (int x = 0; x < picture.width; ++x) {
          if (!isNear(picture, x, y, ground, 2)) continue;
          left = std::min(left, x), right = std::max(right, x);
          top = std::min(top, y), bottom = std::max(bottom, y);
        }
      ASSERT_GT(right - left, 200) << letters << " letters at " << scale;
      int lit = 0;
      for (int y = top + 2; y < bottom - 2; ++y)
        for (int x = left + 2; x < right - 2; ++x) lit += isNear(picture, x, y, trouble, 40) ? 1 : 0;
      EXPECT_GT(lit, 60) << letters << " letters at " << scale;
    }
  }
}

TEST_F(States, ofFiftyStationsTheRailNamesThoseInNeedTheMostUrgentFirst) {
  lab_->screen = WindowScreen::kLab;
  for (int i = 0; i < 50; ++i) {
    auto status = practising((i < 3 ? "z-" : i < 8 ? "y-" : i < 15 ? "x-" : "w-") + std::to_string(i));
    if (i < 3) status.set_fault(2);
    if (i >= 3 && i < 8) addAlarm(status, "hazard", 1, true, "nerve");
    if (i >= 8 && i < 15) status.clear_session_id();
    if (i >= 45) status.clear_session_id(), status.set_online(false);
    lab_->overview.onStatus(status, 0);
  }
  const std::string text = shown();
  for (const char* words : {"8 need help", "30 practising", "7 waiting", "0 done", "5 offline"})
    EXPECT_THAT(text, HasSubstr(words));
  std::size_t before = text.find("8 need help");
  for (const char* station : {"z-0 ", "z-1 ", "z-2 ", "y-3 ", "y-7 "}) {
    const std::size_t at = text.find(station, before);
    ASSERT_NE(at, std::string::npos) << station << text;
    EXPECT_GT(at, before) << station;
    before = at;
  }
}

TEST_F(States, logInMarksTheWrongField) {
  struct Row {
    std::function<void(LoginForm&)> change;
    const char* said;
  };
  const std::vector<Row> rows = {{[](auto& form) { form.server = "[::1"; }, "Server: "},
                                 {[](auto& form) { form.ca_file.clear(); }, "The CA file is missing"},
                                 {[](auto& form) { form.user.clear(); }, "Type your name"},
                                 {[](auto& form) { form.password.clear(); }, "Type your password"}};
  const LoginForm usable = lab_->form;
  for (const Row& row : rows) {
    lab_->form = usable;
    row.change(lab_->form);
    lab_->logIn();
    EXPECT_THAT(shown(), HasSubstr(row.said));
  }
}

/// The live screen, fed with a lesson's samples by hand.
class LiveStates : public States {
 protected:
  void SetUp() override {
    States::SetUp();
    if (surface_) lab_->open("bench-1");
  }
  void feed(std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; k += 20) lab_->live()->feed(lessonFrame(info_, samples_, k));
  }
  void say(bool online, bool lesson, std::uint32_t fault = 0, const std::string& trouble = {}) {
    pb::StationStatus status;
    status.set_station("bench-1");
    status.set_online(online);
    if (lesson) status.set_session_id(info_.description().session_id());
    status.set_fault(fault);
    status.set_trouble(trouble);
    lab_->live()->onStatus(status);
  }
  const std::string profile_ = sampleProfile("shoulder-adult");
  pb::SessionInfo info_ = lessonInfo(profile_);
  std::vector<GestureSample> samples_ = lessonSamples(profile_, {.depth_m = 0.02, .seconds = 1});
};

TEST_F(LiveStates, beforeTheFirstSampleItShowsWhatItWaitsFor) {
  EXPECT_THAT(shown(), AllOf(HasSubstr("Waiting for the first samples"),
                             HasSubstr("The station is not online."), HasSubstr("waiting for it")));
  say(true, false);
  EXPECT_THAT(shown(), AllOf(HasSubstr("Waiting for the first samples"), HasSubstr("with the next lesson"),
                             HasSubstr("no lesson at the moment")));
  say(true, false, 0, "the disk is full");
  EXPECT_THAT(shown(), HasSubstr("the disk is full"));
}

TEST_F(LiveStates, anEndedLessonStaysInViewAndIsMarkedEnded) {
  say(true, true);
  feed(0, 600);
  lab_->live()->setSession(info_);
  EXPECT_THAT(shown(), AllOf(HasSubstr("bench-1 · tina"), HasSubstr("shoulder-bursa"), HasSubstr("going in"),
                             HasSubstr("30 frames, 0 dropped"), Not(HasSubstr("Waiting for"))));
  say(true, false);
  EXPECT_THAT(shown(), AllOf(HasSubstr("bench-1 · tina"), HasSubstr("no lesson at the moment"),
                             HasSubstr("30 frames"), Not(HasSubstr("Waiting for"))));
  say(false, false);
  EXPECT_THAT(shown(), AllOf(HasSubstr("the station is not online"), HasSubstr("30 frames")));
}

TEST_F(LiveStates, aFaultIsShownWhilePausedAndClearedAfterItsLesson) {
  const auto fault = static_cast<std::uint8_t>(Fault::kTipTooFast);
  for (std::size_t i = 200; i < 400; ++i) samples_[i].fault = fault;
  say(true, true);
  feed(0, 200);
  lab_->live()->setSession(info_);
  EXPECT_THAT(shown(), Not(HasSubstr("FAULT")));
  lab_->live()->pause();
  feed(200, 400);
  say(true, true, fault);
  EXPECT_THAT(shown(), AllOf(HasSubstr("PAUSED 0.2 s behind"), HasSubstr("FAULT: the needle's tip jumped")));
  lab_->live()->resume();
  EXPECT_THAT(shown(), HasSubstr("FAULT: the needle's tip jumped"));
  say(true, false);
  EXPECT_THAT(shown(), AllOf(HasSubstr("no lesson at the moment"), Not(HasSubstr("FAULT"))));
}

TEST_F(LiveStates, lossesAreCounted) {
  say(true, true);
  feed(0, 700);
  lab_->live()->setSession(info_);
  EXPECT_THAT(shown(), HasSubstr("35 frames, 0 dropped"));
  feed(800, 840);
  // both fit into one line of a 1280-pixel window
  EXPECT_THAT(shown(),
              AllOf(HasSubstr("cannot follow: total force only"), HasSubstr("37 frames, 5 dropped")));
  lab_->live()->pause();
  EXPECT_THAT(shown(), AllOf(HasSubstr("cannot follow: total force only"), HasSubstr("PAUSED 0.0 s behind")));
}

TEST_F(LiveStates, aLessonWithoutAReadableProfileIsMarked) {
  info_.mutable_description()->set_profile_json("{}");
  feed(0, 100);
  lab_->live()->setSession(info_);
  EXPECT_THAT(shown(), HasSubstr("The scene is not known yet."));
  EXPECT_FALSE(lab_->live()->trace().empty()) << "its plots are there";
}

}  // namespace
}  // namespace needlelab
