// FAULT in the whole program: reported, waited out, acknowledged outside the tissue, and shown in the exit
// code.
#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "common/base/program.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// starts outside the tissue and rests for a second; then the device jumps to another position and stays there
class FaultProgram : public testing::Test {
 protected:
  FaultProgram() {
    std::ofstream csv(path("jump.csv"));
    csv << "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
    for (int k = 0; k < 8000; ++k) csv << k * 0.001 << "," << (k < 1000 ? 0 : 0.5) << ",0,1,0,0,0,1\n";
  }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const { return folder_.path() / name; }
  void start(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--profile",
                                          std::string(NEEDLELAB_SAMPLES) + "/shoulder-adult.json",
                                          "--spool",
                                          path("spool"),
                                          "--headless",
                                          "--json",
                                          path("out.json"),
                                          "--device",
                                          "recording:" + path("jump.csv").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    station_ = std::make_unique<Process>("needlelab-station", arguments, path("log"));
  }
  [[nodiscard]] nlohmann::json summary() const {
    std::ifstream file(path("out.json"));
    return nlohmann::json::parse(file);
  }
  [[nodiscard]] bool says(const std::string& text) {
    return eventually([&] { return station_->said().find(text) != std::string::npos; });
  }
  // acknowledges, and again if the station answers "not yet", because the cause lasts for some ticks
  [[nodiscard]] bool acknowledged() {
    std::size_t sent = 0;
    return eventually([&] {
      const std::string said = station_->said();
      std::size_t refused = 0;
      for (std::size_t at = 0; (at = said.find("not yet", at)) != std::string::npos; ++at) ++refused;
      if (refused == sent) {
        station_->signal(SIGUSR1);
        ++sent;
      }
      return said.find("the fault is over") != std::string::npos;
    });
  }
  TempFolder folder_;
  std::unique_ptr<Process> station_;
};

TEST_F(FaultProgram, acknowledgedWhileTheLessonGoesOnItEndsWell) {
  start({"--on-fault", "wait", "--seconds", "6"});
  ASSERT_TRUE(says("FAULT: the needle's tip jumped")) << station_->said();
  EXPECT_THAT(station_->said(), AllOf(HasSubstr("take the needle out"), HasSubstr("SIGUSR1")));
  ASSERT_TRUE(acknowledged()) << station_->said();
  ASSERT_EQ(station_->wait(), kExitDone) << station_->said();
  const auto out = summary();
  EXPECT_EQ(out["fault"], nullptr);
  EXPECT_EQ(out["fault_count"], 1);
  ASSERT_EQ(out["faults"].size(), 1u);
  const auto& fault = out["faults"][0];
  EXPECT_THAT(fault["reason"].get<std::string>(), HasSubstr("5 m/s"));
  EXPECT_EQ(fault["acknowledged"], true);
  EXPECT_NEAR(fault["time_s"].get<double>(), 1.006, 0.02);
  EXPECT_DOUBLE_EQ(fault["tick"].get<double>(), fault["time_s"].get<double>() * 1000);
  EXPECT_GT(fault["over_s"].get<double>(), fault["time_s"].get<double>());
  EXPECT_EQ(out["end"], "time is over") << "the lesson continued to its end";
  EXPECT_THAT(station_->said(), HasSubstr("acknowledged and over at"));
}

TEST_F(FaultProgram, anAcknowledgementBeforeTheFaultDoesNotCount) {
  start({"--on-fault", "wait", "--seconds", "3"});
  ASSERT_TRUE(says("real time:")) << station_->said();
  station_->signal(SIGUSR1);
  ASSERT_EQ(station_->wait(), kExitFailed) << station_->said();
  EXPECT_EQ(summary()["faults"][0]["acknowledged"], false);
  EXPECT_THAT(station_->said(), HasSubstr("the lesson ended in FAULT"));
}

TEST_F(FaultProgram, aStopSignalEndsALessonThatWaitsInFault) {
  start({"--on-fault", "wait"});
  ASSERT_TRUE(says("FAULT")) << station_->said();
  station_->signal(SIGTERM);
  ASSERT_EQ(station_->wait(), kExitFailed) << station_->said();
  EXPECT_EQ(summary()["end"], "stopped");
}

TEST_F(FaultProgram, anUnattendedLessonEndsWithTheFault) {
  start({});
  ASSERT_EQ(station_->wait(), kExitFailed) << station_->said();
  EXPECT_THAT(station_->said(), AllOf(HasSubstr("The lesson ends"), Not(HasSubstr("SIGUSR1"))));
  EXPECT_EQ(summary()["end"], "FAULT");
}

}  // namespace
}  // namespace needlelab::test
