// The whole station on the stand-in for the Virtuose's library: a lesson, and the messages to a technician
// when something is missing.
#include <gmock/gmock.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "client/device/virtuose/virtuose_api.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/integration/lab.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// straight into the shoulder from above, and out; times count from the first reading
const char* const kStroke =
    "0.0 place 0 0 0.02 1 0 0 0\n"
    "0.2 hand 0 0 -0.02 1 0 0 0 0.6\n"
    "1.2 hand 0 0 0.03 1 0 0 0 0.6\n";

class VirtuoseStation : public testing::Test {
 protected:
  VirtuoseStation() { ::setenv(kVirtuoseLibraryVariable, NEEDLELAB_STANDIN, 1); }
  ~VirtuoseStation() override {
    ::unsetenv(kVirtuoseLibraryVariable);
    ::unsetenv("NEEDLELAB_STANDIN_SCRIPT");
  }
  void script(const std::string& text) {
    ::setenv("NEEDLELAB_STANDIN_SCRIPT", folder_.write("script.txt", text).c_str(), 1);
  }
  // runs a lesson; returns its output and its exit code
  int lesson(const std::vector<std::string>& more = {"--seconds", "2"}) {
    std::vector<std::string> arguments{"--device",
                                       "virtuose",
                                       "--headless",
                                       "--profile",
                                       NEEDLELAB_SAMPLES "/shoulder-adult.json",
                                       "--spool",
                                       folder_.path() / "spool",
                                       "--json",
                                       folder_.path() / "summary.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Process station("needlelab-station", arguments, folder_.path() / "log");
    const auto code = station.wait();
    said_ = station.said();
    return code.value_or(-1000);
  }
  nlohmann::json row() {
    const auto text = readWholeFile(folder_.path() / "summary.json");
    return text.ok() ? nlohmann::json::parse(*text)["rows"][0] : nlohmann::json{};
  }

  const TempFolder folder_;
  std::string said_;
};

TEST_F(VirtuoseStation, aWholeLessonRunsOnTheStandIn) {
  script(kStroke);
  ASSERT_EQ(lesson(), kExitDone) << said_;
  const auto summary = row();
  EXPECT_THAT(summary["device"], HasSubstr("Virtuose 6D Desktop at 127.0.0.1#53210"));
  EXPECT_EQ(summary["axial_model"], "ENHANCED_TRACKING_WALL");
  EXPECT_TRUE(summary["fault"].is_null()) << summary["fault"];
  EXPECT_GE(summary["events"]["entries into the tissue"], 1);
  EXPECT_GT(scoreOf(summary, "greatest_insertion_m"), 0.005);
  EXPECT_GT(scoreOf(summary, "peak_force_n"), 0.5);
  EXPECT_LE(scoreOf(summary, "peak_force_n"), 10.001);
}

TEST_F(VirtuoseStation, aMissingLibraryIsReportedWithAdvice) {
  ::setenv(kVirtuoseLibraryVariable, "/nowhere/libVirtuoseAPI.so", 1);
  EXPECT_EQ(lesson(), kExitFailed);
  EXPECT_THAT(said_, HasSubstr("Haption"));
  EXPECT_THAT(said_, HasSubstr("NEEDLELAB_VIRTUOSE_LIBRARY"));
}

TEST_F(VirtuoseStation, aWrongRateIsWrongUsage) {
  EXPECT_EQ(lesson({"--seconds", "1", "--rate", "2000"}), kExitInvalid);
  EXPECT_THAT(said_, HasSubstr("[50, 1000]"));
}

}  // namespace
}  // namespace needlelab::test
