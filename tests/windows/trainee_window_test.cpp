// The trainee's window as a person uses it: a display, a mouse, keys.
#include <gmock/gmock.h>
#include <signal.h>

#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "common/base/program.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"
#include "tests/support/x_display.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class TraineeWindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!display_.isThere()) GTEST_SKIP() << "no Xvfb here: apt-get install xvfb xdotool";
  }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }
  void start(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--profile",       NEEDLELAB_SAMPLES "/shoulder-adult.json",
                                          "--spool",         path("spool"),
                                          "--json",          path("out.json"),
                                          "--window",        "1280x720",
                                          "--hand-tremor-m", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    station_ = std::make_unique<Process>("needlelab-station", arguments, path("log"));
  }
  bool says(const std::string& text) {
    return eventually([&] { return station_->said().find(text) != std::string::npos; }, 60s);
  }
  void pause(std::chrono::milliseconds time) { std::this_thread::sleep_for(time); }
  // The window is open and has the keyboard focus.
  void waitForWindow() {
    ASSERT_TRUE(eventually(
        [&] {
          return display_.tool({"search", "--name", "needlelab station"}) == 0;
        },
        60s))
        << station_->said();
    display_.moveTo(300, 300);
    pause(2s);
  }
  [[nodiscard]] nlohmann::json summary() const {
    std::ifstream file(path("out.json"));
    return nlohmann::json::parse(file, nullptr, false);
  }
  [[nodiscard]] std::map<std::string, double> score() const {
    std::map<std::string, double> values;
    const auto out = summary();
    for (const auto& row : out["score"])
      if (row["value"].is_number()) values[row["measure"]] = row["value"];
    return values;
  }

  TempFolder folder_;
  XDisplay display_;
  std::unique_ptr<Process> station_;
};

TEST_F(TraineeWindowTest, aLessonSteeredByMouseReachesTheTargetAndIsScored) {
  start({"--trainee", "tom"});
  waitForWindow();
  display_.key("Return");  // Start: everything is given, one key starts the lesson
  ASSERT_TRUE(says("session ")) << station_->said();
  pause(2s);
  display_.key("3");  // from above: right is W's y
  // the hand waits 15 mm to the right of the entry and 30 mm above it; a pixel is 0.1 mm, a notch 1 mm
  display_.moveTo(500, 350);
  display_.drag(1, -150, 0);
  pause(1s);
  // 26 mm below the skin
  for (int i = 0; i < 8; ++i) {
    display_.wheel(7);
    pause(700ms);
  }
  pause(3s);
  display_.key("x", 900ms);  // draws back
  pause(500ms);
  display_.key("space", 3s);  // injects
  pause(500ms);
  for (int i = 0; i < 8; ++i) {
    display_.wheel(-7);
    pause(300ms);
  }
  pause(1s);
  display_.key("Escape");
  display_.key("Return");
  ASSERT_TRUE(says("score  ")) << station_->said();
  station_->signal(SIGTERM);
  ASSERT_TRUE(station_->wait(60s)) << station_->said();

  const auto values = score();
  ASSERT_TRUE(values.contains("target_reached")) << station_->said();
  EXPECT_EQ(values.at("target_reached"), 1) << station_->said();
  EXPECT_GT(values.at("time_at_target_s"), 1);
  EXPECT_EQ(values.at("hazards_touched"), 0);
  EXPECT_EQ(values.at("entries"), 1);
  EXPECT_GT(values.at("peak_force_n"), 1) << "tissue resists";
  const auto syringe = summary()["syringe"];
  std::vector<std::string>
      events;  // a window that stalls lets the plunger rest: then one stroke is two events
  for (const auto& each : syringe)
    if (events.empty() || events.back() != each["event"]) events.push_back(each["event"]);
  EXPECT_EQ(events, (std::vector<std::string>{"ASPIRATION", "INJECTION"})) << syringe;
  EXPECT_EQ(summary()["stopped_by"], "tom");
  EXPECT_EQ(summary()["fault"], nullptr);
}

TEST_F(TraineeWindowTest, keysAloneSuffice) {
  start({"--trainee", "tom", "--start"});
  waitForWindow();
  ASSERT_TRUE(says("session ")) << station_->said();
  pause(2s);
  display_.key("3");
  display_.key("w", 2s);  // 12 mm/s
  display_.key("Left", 700ms);
  pause(1s);
  display_.key("Escape");
  display_.key("Escape");  // not yet
  pause(500ms);
  display_.key("Escape");
  display_.key("Return");
  ASSERT_TRUE(says("score  ")) << station_->said();
  // Once more, by one key. It is pressed again until the End screen appears (in a lesson it does nothing).
  ASSERT_TRUE(eventually(
      [&] {
        const std::string said = station_->said();
        if (said.rfind("real time: ") > said.find("score  ")) return true;
        display_.key("Return");
        pause(500ms);
        return false;
      },
      60s))
      << station_->said();
  pause(1s);
  station_->signal(SIGTERM);
  ASSERT_EQ(station_->wait(60s), kExitDone) << station_->said();
  ASSERT_EQ(summary()["rows"].size(), 2u);
  // two seconds of W and more than half a second of Left are in the recording
  EXPECT_GT(summary()["rows"][0]["score"][0]["value"], 3.0);
}

TEST_F(TraineeWindowTest, theCloseButtonEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  waitForWindow();
  ASSERT_TRUE(says("session ")) << station_->said();
  pause(2s);
  // the message of a window manager's close button
  display_.tool({"search", "--name", "needlelab station", "windowclose"});
  ASSERT_TRUE(station_->wait(60s)) << station_->said();
  const auto out = summary();
  EXPECT_GT(out["samples"], 500) << station_->said();
  EXPECT_EQ(out["fault"], nullptr);
  EXPECT_EQ(out["samples_lost"], 0);
}

TEST_F(TraineeWindowTest, aDisplayThatGoesEndsTheLessonAndKeepsIt) {
  start({"--trainee", "tom", "--start"});
  waitForWindow();
  ASSERT_TRUE(says("session ")) << station_->said();
  pause(2s);
  display_.end();
  ASSERT_TRUE(station_->wait(60s)) << station_->said();
  EXPECT_THAT(station_->said(), HasSubstr("the display is gone"));
  const auto out = summary();
  EXPECT_GT(out["samples"], 500) << station_->said();
  EXPECT_EQ(out["fault"], nullptr);
}

TEST(TraineeWithoutADisplay, isToldWhatElseThereIs) {
  TempFolder folder;
  ::unsetenv("DISPLAY");
  Process station("needlelab-station",
                  {"--profile", NEEDLELAB_SAMPLES "/shoulder-adult.json", "--spool", folder.path() / "spool"},
                  folder.path() / "log");
  EXPECT_EQ(station.wait(60s), kExitFailed);
  EXPECT_THAT(station.said(), HasSubstr("--headless"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "spool")) << "nothing was begun";
}

TEST(TraineeWithoutADisplay, picturesAreTakenOfALessonThatEndsByItself) {
  TempFolder folder;
  ::unsetenv("DISPLAY");
  Process station("needlelab-station", {"--profile",    NEEDLELAB_SAMPLES "/shoulder-adult.json",
                                        "--spool",      folder.path() / "spool",
                                        "--seconds",    "3",
                                        "--screenshot", folder.path() / "start.png",
                                        "--at",         "start",
                                        "--screenshot", folder.path() / "lesson.png",
                                        "--at",         "1.5",
                                        "--screenshot", folder.path() / "end.png",
                                        "--at",         "end",
                                        "--window",     "1280x720"},
                  folder.path() / "log");
  EXPECT_EQ(station.wait(120s), kExitDone) << station.said();
  for (const char* name : {"start.png", "lesson.png", "end.png"})
    EXPECT_GT(std::filesystem::file_size(folder.path() / name), 10'000u) << name;
}

}  // namespace
}  // namespace needlelab::test
