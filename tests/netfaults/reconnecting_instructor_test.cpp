// A person who watches: a server that dies comes back by itself, and a name that nobody has is said.
#include <gtest/gtest.h>

#include <algorithm>

#include "common/base/program.h"
#include "tests/integration/lab.h"

namespace needlelab::test {
namespace {

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
  EXPECT_EQ(station->wait(30s), kExitDone) << station->said();
  for (Process* each : {instructor.get(), unknown.get()}) {
    each->signal(SIGINT);
    EXPECT_EQ(each->wait(10s), kExitDone) << each->said();
  }
}

}  // namespace
}  // namespace needlelab::test
