// The trainee's window with a real server: an instructor's messages and actions reach the window, and its
// recordings reach the server.
#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/base/program.h"
#include "tests/integration/lab.h"
#include "tests/support/x_display.h"
#include "tests/windows/shown_frames.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class TraineeServerTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!display_.isThere()) GTEST_SKIP() << "no Xvfb here: apt-get install xvfb xdotool";
    lab_.startServer();
  }
  std::unique_ptr<Process> startWindow(const std::vector<std::string>& more) {
    auto arguments = lab_.stationArguments(more);
    arguments.erase(std::find(arguments.begin(), arguments.end(), "--headless"));
    // --drain: recordings are sent before the end on a busy machine, too
    arguments.insert(arguments.end(), {"--window", "1280x720", "--json", lab_.path("window.json"),
                                       "--frame-log", lab_.path("frames.csv"), "--drain", "120"});
    return std::make_unique<Process>("needlelab-station", arguments, lab_.path("window.log"));
  }
  // what the station's window shows
  [[nodiscard]] ShownFrames framesOf(Process& station) const {
    return {lab_.path("frames.csv"), [&station] { return station.wait(0ms).has_value(); }};
  }
  // Presses Enter once, as soon as the End screen takes it.
  [[nodiscard]] testing::AssertionResult goesOnFromTheEnd(Process& station) {
    if (!framesOf(station).until(
            [](const SeenFrame& frame) { return frame.screen == "end" && frame.can_begin; }))
      return testing::AssertionFailure() << "no End screen: " << station.said();
    display_.key("Return");
    return testing::AssertionSuccess();
  }
  static bool says(Process& station, const std::string& text) {
    return eventually([&] { return station.said().find(text) != std::string::npos; }, 60s);
  }
  void tell(const pb::Request& request) const {
    auto client = lab_.instructor();
    ASSERT_TRUE(client.ok()) << client.error().message;
    const auto reply = client->call(request);
    ASSERT_TRUE(reply.ok()) << reply.error().message;
  }
  Lab lab_;
  XDisplay display_;
};

TEST_F(TraineeServerTest, anInstructorTalksChangesAidsStopsAndChoosesWhatComesNext) {
  auto station = startWindow(
      {"--exercise", "ball-free-practice", "--start", "--hand-plan", "rest", "--hand-repeat", "0"});
  ASSERT_TRUE(says(*station, "session ")) << station->said();
  // The server knows of it.
  ASSERT_TRUE(eventually([&] { return lab_.sessions().size() == 1; }, 60s)) << station->said();
  pb::Request request;
  request.mutable_trainee_message()->set_station("station-1");
  request.mutable_trainee_message()->set_text("Slower, please.");
  tell(request);
  request.mutable_set_aids()->set_station("station-1");
  request.mutable_set_aids()->add_aids(pb::Exercise::DEPTH);
  tell(request);
  request.mutable_next_exercise()->set_station("station-1");
  request.mutable_next_exercise()->set_exercise_id("knee-recess");
  tell(request);
  ASSERT_TRUE(says(*station, "Slower, please.")) << station->said();
  ASSERT_TRUE(says(*station, "ines changed what is shown")) << station->said();
  request.mutable_stop_lesson()->set_station("station-1");
  request.mutable_stop_lesson()->set_reason("wrong side");
  tell(request);
  ASSERT_TRUE(says(*station, "stopped by ines: wrong side")) << station->said();
  // scored by the server
  ASSERT_TRUE(says(*station, "session COMPLETE")) << station->said();

  // The End screen offers the instructor's choice: one key starts it.
  display_.moveTo(600, 400);
  ASSERT_TRUE(goesOnFromTheEnd(*station));
  ASSERT_TRUE(framesOf(*station).until([](const SeenFrame& frame) {
    return frame.lesson == 2 && frame.lesson_s > 0;
  })) << station->said();
  ASSERT_TRUE(eventually([&] { return lab_.sessions().size() == 2; }, 60s)) << station->said();
  station->signal(SIGTERM);
  ASSERT_EQ(station->wait(), kExitDone) << station->said();

  const auto out = lab_.summary("window");
  ASSERT_EQ(out["rows"].size(), 2u) << station->said();
  EXPECT_EQ(out["rows"][0]["stopped_by"], "ines");
  EXPECT_EQ(out["rows"][0]["stop_reason"], "wrong side");
  EXPECT_EQ(out["rows"][0]["state"], "COMPLETE");
  EXPECT_EQ(out["rows"][1]["exercise"], "knee-recess");
  EXPECT_EQ(out["rows"][1]["state"], "COMPLETE") << "recordings are sent before the end";
  for (const pb::SessionInfo& info : lab_.sessions()) EXPECT_EQ(info.state(), pb::SESSION_COMPLETE);
}

TEST_F(TraineeServerTest, aBadgeIsReadAndNotShown) {
  ASSERT_EQ(lab_.stopServer(), kExitDone);
  std::ofstream(lab_.path("code")) << "badge-4711\n";
  std::filesystem::permissions(lab_.path("code"), std::filesystem::perms::owner_read);
  ASSERT_EQ(lab_.admin({"user", "code", "tom", "--code-file", lab_.path("code")}), kExitDone);
  lab_.startServer();
  auto station = startWindow({"--exercise", "ball-free-practice", "--start", "--hand-plan", "rest",
                              "--hand-repeat", "0", "--seconds", "1"});
  ASSERT_TRUE(says(*station, "tom has a code")) << station->said();
  ASSERT_TRUE(framesOf(*station).untilScreen("start")) << station->said();
  display_.moveTo(600, 400);
  ASSERT_TRUE(framesOf(*station).sawInput()) << station->said();
  // as a reader does: all of it at once, with Enter. Again if the screen was not there yet; three times at
  // most, because five wrong codes make tom wait
  const auto readUntil = [&](const char* badge, const std::string& text) {
    for (int time = 0; time < 3; ++time) {
      display_.tool({"type", "--delay", "1", badge});
      display_.key("Return");  // xdotool types a line end as another key
      if (eventually([&] { return station->said().find(text) != std::string::npos; }, 10s)) return true;
    }
    return false;
  };
  ASSERT_TRUE(readUntil("badge-4711", "session COMPLETE")) << station->said();
  for (const pb::SessionInfo& info : lab_.sessions()) EXPECT_TRUE(info.description().code_checked());
  station->signal(SIGTERM);
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  EXPECT_EQ(station->said().find("badge-4711"), std::string::npos);
}

TEST_F(TraineeServerTest, aLostDisplayEndsTheLessonAndUploadsAllOfIt) {
  auto station = startWindow(
      {"--exercise", "ball-free-practice", "--start", "--hand-plan", "rest", "--hand-repeat", "0"});
  ASSERT_TRUE(eventually([&] { return lab_.sessions().size() == 1; }, 60s)) << station->said();
  display_.end();
  ASSERT_EQ(station->wait(), kExitFailed) << station->said();
  EXPECT_THAT(station->said(), HasSubstr("the display is gone"));
  const auto out = lab_.summary("window");
  EXPECT_EQ(out["state"], "COMPLETE") << station->said();
  EXPECT_EQ(out["samples_acked"], out["samples"]);
  const auto sessions = lab_.sessions();
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions.front().state(), pb::SESSION_COMPLETE);
}

}  // namespace
}  // namespace needlelab::test
