// The instructor's window and a lab of eight: find the station in trouble, watch, send a message, replay,
// compare, export; and the behaviour when the instructor or the server is killed during a lesson.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/support/x_display.h"
#include "tests/windows/lab_of_eight.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// Returns of all output of the script's `latency`, in order, how many live frames had been on the screen.
std::vector<std::size_t> framesIn(const std::string& words) {
  std::vector<std::size_t> all;
  for (std::size_t at = 0; (at = words.find("capture to screen:", at)) != std::string::npos; ++at) {
    std::size_t frames = 0;
    if (std::sscanf(words.c_str() + at, "capture to screen: p50 %*f ms p99 %*f ms of %zu live frames",
                    &frames) == 1)
      all.push_back(frames);
  }
  return all;
}

class LabWindows : public testing::Test {
 protected:
  std::string shot(const std::string& name) const {
    return "screenshot " + lab_.picture(name).string() + "\n";
  }
  static bool says(const Process& process, const std::string& text, std::chrono::seconds limit = 180s) {
    return eventually([&] { return process.said().find(text) != std::string::npos; }, limit);
  }
  std::vector<std::string> audit(const std::string& action) const {
    std::vector<std::string> lines;
    for (const auto& row : lab_.rows({"audit", "--limit", "200"}))
      if (row["action"] == action)
        lines.push_back(row["who"].get<std::string>() + " " + row["subject"].get<std::string>() + ": " +
                        row["detail"].get<std::string>());
    return lines;
  }
  LabOfEight lab_;
};

TEST_F(LabWindows, aTroubledStationIsFoundWatchedReplayedAndExported) {
  XDisplay display(1280, 720);
  lab_.startServer();
  const std::string first = lab_.practise(7, 0.9, 8), second = lab_.practise(8, 0.2, 8);
  ASSERT_TRUE(!first.empty() && !second.empty());
  lab_.startStations();
  const auto report = lab_.path("report.html"), csv = lab_.path("samples.csv");
  const std::string script =
      "timeout 300\nlogin\n"
      "wait-station bench-1 lesson\nwait-station bench-8 lesson\nwait-station bench-5 help\n" +
      shot("instructor_lab.png") +
      // the rail names the station that needs help
      "open-first\nwait-text bench-5\nwait-text trainee-5\nwait-live 1\n" + shot("instructor_trouble.png") +
      "message \"take the needle out\"\n"
      // a running lesson
      "lab\nfilter all\nopen station bench-2\nwait-live 200\nlatency\n" +
      shot("instructor_live.png") +
      "annotate \"watch the angle\"\nmessage \"slower, please\"\naids \"depth, force\"\n"
      "pause\nscroll-back 3\n" +
      shot("instructor_scrolled.png") + "resume\nstop-lesson \"enough for today\"\n" +
      // afterwards
      "search trainee-\n" + shot("instructor_sessions.png") + "replay session " + first +
      "\nseek 2\nspeed 2\nplay\nwait-replay 4\npause\n" + shot("instructor_replay.png") +
      "annotate \"well done\"\n" + "scores\n" + shot("instructor_scores.png") + "export " + report.string() +
      "\nexport " + csv.string() + "\n" + "rerun own TRACKING_WALL\n" + shot("instructor_rerun.png") +
      "compare " + first + " " + second + " dtw\n" + shot("instructor_compare.png") + "frames\nquit\n";
  auto window = lab_.window("window", script, !display.isThere());
  ASSERT_EQ(window->wait(600s), kExitDone) << window->said();
  const std::string words = window->said();
  std::cout << words;

  // the messages to the trainees
  EXPECT_TRUE(says(lab_.station(5), "message from ines: take the needle out")) << lab_.station(5).said();
  EXPECT_TRUE(says(lab_.station(2), "message from ines: slower, please")) << lab_.station(2).said();
  EXPECT_TRUE(says(lab_.station(2), "stopped by ines: enough for today")) << lab_.station(2).said();
  EXPECT_EQ(lab_.station(2).wait(), kExitDone);
  // the entries of the audit log
  EXPECT_THAT(audit("message"), testing::UnorderedElementsAre("ines bench-5: take the needle out",
                                                              "ines bench-2: slower, please"));
  EXPECT_THAT(audit("aids"), testing::ElementsAre(HasSubstr("ines bench-2: DEPTH, FORCE")));
  EXPECT_THAT(audit("stop"), testing::ElementsAre(HasSubstr("ines bench-2: enough for today")));
  EXPECT_EQ(audit("annotate").size(), 2u);
  EXPECT_TRUE(audit("not delivered").empty());
  // that these are latencies: ScriptRunnerTest.latencyIsMeasuredAndJudged, LatencyMeter
  const auto frames = framesIn(words);
  ASSERT_EQ(frames.size(), 1u) << words;
  EXPECT_GE(frames[0], 200u);
  // the exported files
  const auto page = readWholeFile(report);
  ASSERT_TRUE(page.ok());
  for (const char* const text : {"<svg", "trainee-7", "Peak force", "Training ball: free practice"})
    EXPECT_NE(page->find(text), std::string::npos) << text;  // a page is too long to be printed
  EXPECT_EQ(page->find("<script"), std::string::npos);
  const auto shown = lab_.rows({"session", "show", first});
  ASSERT_EQ(shown.size(), 1u);
  ASSERT_EQ(shown[0]["annotations"].size(), 1u);
  EXPECT_EQ(shown[0]["annotations"][0]["text"], "well done");
  const auto samples = readWholeFile(csv);
  ASSERT_TRUE(samples.ok());
  EXPECT_GT(std::count(samples->begin(), samples->end(), '\n'), 5000) << "8 s at 1 kHz";

  lab_.stopStations();
  EXPECT_EQ(lab_.stopServer(), kExitDone);
  EXPECT_EQ(lab_.verifyAll().size(), 10u);
}

TEST_F(LabWindows, aKilledServerReturnsAndTheViewContinues) {
  lab_.startServer();
  lab_.startStations();
  auto window = lab_.window(
      "window",
      "timeout 300\nlogin\nwait-station bench-3 lesson\nopen station bench-3\nwait-live 50\nlatency\n"
      "print \"KILL NOW\"\nwait-text reconnecting\nprint \"SERVER IS AWAY\"\n"
      "wait-station bench-3 online\nwait-live 50\n" +
          shot("instructor_back.png") +
          "latency\nexpect bench-3\nmessage \"there you are\"\nannotate \"after the storm\"\nquit\n",
      true);
  ASSERT_TRUE(says(*window, "KILL NOW")) << window->said();
  lab_.killServer();
  ASSERT_TRUE(says(*window, "SERVER IS AWAY")) << window->said();
  lab_.startServer();
  ASSERT_EQ(window->wait(600s), kExitDone) << window->said();
  const auto frames = framesIn(window->said());
  ASSERT_EQ(frames.size(), 2u) << window->said();
  EXPECT_GE(frames[1], frames[0] + 50) << "live frames came again";
  EXPECT_TRUE(says(lab_.station(3), "message from ines: there you are")) << lab_.station(3).said();
  lab_.stopStations();
  EXPECT_EQ(lab_.stopServer(), kExitDone);
  EXPECT_EQ(lab_.verifyAll().size(), 8u) << "nothing is lost, and nothing doubled";
}

TEST_F(LabWindows, anInstructorWhoIsKilledInMidViewTakesNothingWithThem) {
  lab_.startServer();
  lab_.startStations();
  auto killed = lab_.window(
      "killed",
      "timeout 300\nlogin\nwait-station bench-1 lesson\nopen station bench-1\nwait-live 1\nannotate "
      "\"half a thought\"\nprint \"KILL NOW\"\nwait 1000\n",
      true);
  ASSERT_TRUE(says(*killed, "KILL NOW")) << killed->said();
  killed->signal(SIGKILL);
  ASSERT_EQ(killed->wait(), -SIGKILL);
  // A later instructor sees the same lab, and the remark.
  auto window = lab_.window(
      "window",
      "timeout 300\nlogin\nwait-station bench-1 lesson\nopen station bench-1\nwait-live 11\nlatency\nquit\n",
      true);
  ASSERT_EQ(window->wait(600s), kExitDone) << window->said();
  EXPECT_GE(framesIn(window->said()).at(0), 11u);
  EXPECT_EQ(audit("annotate").size(), 1u);
  // An instructor without a window sees the same.
  EXPECT_EQ(lab_.headless({"--station", "bench-4", "--message", "well done", "--once", "--seconds", "60"}),
            0);
  EXPECT_TRUE(says(lab_.station(4), "message from ines: well done")) << lab_.station(4).said();
  lab_.stopStations();
  EXPECT_EQ(lab_.stopServer(), kExitDone);
  EXPECT_EQ(lab_.verifyAll().size(), 8u);
}

}  // namespace
}  // namespace needlelab::test
