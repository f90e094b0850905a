// A stalled network does not stop a station's lesson; an instructor in a terminal outlives its server.
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <algorithm>

#include "common/base/program.h"
#include "tests/integration/lab.h"
#include "tests/support/proxy/fault_proxy.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

// Two stations at once, one of them behind a network that hangs for most of its lesson. loop_proof_test shows
// without a clock that the loop waits for nothing.
TEST(StalledStationTest, practisesItsWholeLessonAndLosesNoSample) {
  Lab lab;
  ASSERT_EQ(lab.admin({"station", "add", "station-2", "--out", lab.path("station-2.key")}), 0);
  lab.startServer();
  // once, so that both have the exercise and the port is known
  const auto arguments = lab.stationArguments({"--exercise", "ball-free-practice", "--seconds", "4"});
  const auto given = [&](const std::string& option) {
    return std::find(arguments.begin(), arguments.end(), option) + 1;
  };
  const std::string server = *given("--server");
  FaultProxy proxy(static_cast<std::uint16_t>(std::stoi(server.substr(server.rfind(':') + 1))));
  auto stalled_arguments = arguments;
  const auto replace = [&](const std::string& option, const std::string& value) {
    *(std::find(stalled_arguments.begin(), stalled_arguments.end(), option) + 1) = value;
  };
  replace("--server", fmt::format("127.0.0.1:{}", proxy.port()));
  replace("--key", lab.path("station-2.key"));
  replace("--spool", lab.path("spool-2"));
  stalled_arguments.insert(stalled_arguments.end(), {"--json", lab.path("stalled.json")});
  Process stalled("needlelab-station", stalled_arguments, lab.path("stalled.log"));
  auto beside = lab.startStation("beside", {"--exercise", "ball-free-practice", "--seconds", "4"});
  // both lessons run once their sessions are on the server
  ASSERT_TRUE(eventually([&] { return lab.sessions().size() == 2; })) << stalled.said() << beside->said();
  std::this_thread::sleep_for(300ms);
  proxy.stallAll(true);
  std::this_thread::sleep_for(3s);
  proxy.stallAll(false);
  EXPECT_EQ(beside->wait(), kExitDone) << beside->said();
  EXPECT_EQ(stalled.wait(), kExitDone) << stalled.said();

  const auto bad = lab.summary("stalled");
  const auto count = [&](const char* what) { return bad.at(what).get<std::uint64_t>(); };
  EXPECT_EQ(count("ticks"), 4000u);
  EXPECT_EQ(count("samples") + count("missed_ticks"), 4000u) << "each tick that ran is recorded";
  EXPECT_EQ(count("spool_left"), 0u) << stalled.said();
  for (const pb::SessionInfo& info : lab.sessions()) EXPECT_EQ(info.state(), pb::SESSION_COMPLETE);
  EXPECT_TRUE(lab.verifies(bad.at("session_id").get<std::string>()));
}

// A station and an instructor that know two servers, here two routes to one; the first route is cut in the
// middle of the lesson.
TEST(TwoServersTest, lessonAndViewGoOnAtTheOtherOne) {
  Lab lab;
  lab.startServer();
  const auto port = static_cast<std::uint16_t>(lab.port());
  FaultProxy first(port), second(port);
  const std::string to_first = fmt::format("127.0.0.1:{}", first.port());
  const std::string to_second = fmt::format("127.0.0.1:{}", second.port());
  const std::string both = to_first + "," + to_second;
  auto arguments = lab.stationArguments({"--exercise", "ball-free-practice", "--seconds", "8"});
  *(std::find(arguments.begin(), arguments.end(), "--server") + 1) = both;
  arguments.insert(arguments.end(), {"--json", lab.path("two.json")});
  Process instructor(
      "needlelab-instructor",
      {"--server", both, "--ca", lab.path("data") / "tls" / "ca.crt", "--user", "ines", "--password-file",
       lab.path("password"), "--headless", "--station", "station-1", "--seconds", "60"},
      lab.path("watch.log"));
  const auto said = [](const std::string& text, const std::string& words) {
    return text.find(words) != std::string::npos;
  };
  ASSERT_TRUE(eventually([&] { return said(instructor.said(), "connected to " + to_first); }))
      << instructor.said();
  Process station("needlelab-station", arguments, lab.path("two.log"));
  ASSERT_TRUE(eventually([&] { return !lab.sessions().empty(); })) << station.said();
  ASSERT_TRUE(eventually([&] { return said(instructor.said(), "station-1 is online"); }))
      << instructor.said();
  first.refuseAll(true);
  first.cutAll(Cut::kReset);
  EXPECT_EQ(station.wait(), kExitDone) << station.said();
  EXPECT_TRUE(said(station.said(), "trying another server")) << station.said();
  EXPECT_TRUE(said(station.said(), "connected to " + to_second + " as station-1")) << station.said();
  EXPECT_TRUE(said(instructor.said(), "connected again, to " + to_second)) << instructor.said();
  // live lines after the change of server
  const std::string words = instructor.said();
  std::size_t lines = 0;
  for (auto at = words.find("connected again, to " + to_second); at != words.npos;
       at = words.find("station-1", at + 1))
    ++lines;
  EXPECT_GT(lines, 10u) << words;
  instructor.signal(SIGINT);
  EXPECT_EQ(instructor.wait(), kExitDone) << instructor.said();

  const auto summary = lab.summary("two");
  const auto count = [&](const char* what) { return summary.at(what).get<std::uint64_t>(); };
  EXPECT_EQ(count("samples") + count("missed_ticks"), 8000u) << "each tick that ran is recorded";
  EXPECT_EQ(count("spool_left"), 0u) << station.said();
  const auto sessions = lab.sessions();
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0].state(), pb::SESSION_COMPLETE);
  EXPECT_TRUE(lab.verifies(summary.at("session_id").get<std::string>()));
}

using namespace std::chrono_literals;

std::unique_ptr<Process> watch(const Lab& lab, const std::string& station, const std::string& log) {
  const auto arguments = lab.stationArguments({});
  const auto server = *(std::find(arguments.begin(), arguments.end(), "--server") + 1);
  return std::make_unique<Process>(
      "needlelab-instructor",
      std::vector<std::string>{"--server", server, "--ca", lab.path("data") / "tls" / "ca.crt", "--user",
                               "ines", "--password-file", lab.path("password"), "--headless", "--station",
                               station, "--seconds", "40"},
      lab.path(log));
}

std::size_t count(const std::string& text, const std::string& word) {
  std::size_t n = 0;
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

TEST(ReconnectingInstructorTest, watchesOnAfterTheServerWasKilled) {
  Lab lab;
  lab.startServer();
  auto instructor = watch(lab, "station-1", "watch.log");
  auto unknown = watch(lab, "station-one", "unknown.log");
  ASSERT_TRUE(eventually([&] { return count(instructor->said(), "is not online") == 1; }))
      << instructor->said();
  auto station = lab.startStation("s", {"--exercise", "ball-free-practice", "--seconds", "30"});
  const std::string line = "station-1";
  ASSERT_TRUE(eventually([&] { return count(instructor->said(), line) > 6; })) << instructor->said();
  EXPECT_TRUE(eventually([&] {
    return unknown->said().find("knows no station 'station-one'; it knows station-1") != std::string::npos;
  })) << unknown->said();

  lab.killServer();
  ASSERT_TRUE(eventually([&] { return count(instructor->said(), "connecting again") == 1; }))
      << instructor->said();
  lab.startServer();
  ASSERT_TRUE(eventually([&] { return count(instructor->said(), "connected again") == 1; }))
      << instructor->said();
  const std::size_t lines = count(instructor->said(), line);
  EXPECT_TRUE(eventually([&] { return count(instructor->said(), line) > lines + 10; }))
      << "live lines come again\n"
      << instructor->said() << station->said();
  station->signal(SIGTERM);
  EXPECT_EQ(station->wait(), kExitDone) << station->said();
  for (Process* each : {instructor.get(), unknown.get()}) {
    each->signal(SIGINT);
    EXPECT_EQ(each->wait(), kExitDone) << each->said();
  }
}

}  // namespace

}  // namespace needlelab::test
