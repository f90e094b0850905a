// The station as a child process that inherits the emulated USB: its lesson, its self-test, its crash. No
// test bounds a time: if the machine stalls for 20 ms, the station rightly takes the force away.
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/integration/process.h"
#include "tests/support/run_form.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

constexpr double kSkin_m = 0.010;  // below the middle of the workspace
constexpr double kDeep_m = 0.015;

class FalconUsbStation : public FalconOnUsb {
 protected:
  std::unique_ptr<Process> station(const std::vector<std::string>& arguments) {
    return std::make_unique<Process>("needlelab-station", arguments, folder_.path() / "log");
  }
  [[nodiscard]] nlohmann::json out() const {
    const auto text = readWholeFile(folder_.path() / "out.json");
    EXPECT_TRUE(text.ok());
    return text.ok() ? nlohmann::json::parse(*text) : nlohmann::json();
  }
  [[nodiscard]] std::vector<std::string> lesson(const std::string& seconds,
                                                const std::string& on_fault) const {
    return {"--device",
            "falcon",
            "--headless",
            "--profile",
            NEEDLELAB_SAMPLES "/shoulder-adult.json",
            "--seconds",
            seconds,
            "--placement",
            "0,0,-0.010,0,0,0,1",
            "--on-fault",
            on_fault,
            "--spool",
            folder_.path() / "spool",
            "--json",
            folder_.path() / "out.json"};
  }
  void home(Process& child) {
    moveOutAndIn();
    ASSERT_TRUE(eventually([this] { return falcon_.isHomed(); })) << child.said();
  }
  void expectNoTorqueAtTheEnd() {
    ASSERT_FALSE(falcon_.heard().empty());
    EXPECT_EQ(falcon_.heard().back().command.motor, Motors{});
    EXPECT_EQ(norm(falcon_.force_N()), 0);
  }

  const TempFolder folder_;
};

// from above the skin: in, rest, out again, and so on
HandPath strokes() {
  return [](double t) {
    t = std::fmod(t, 2.4);
    const double down = std::clamp((t - 0.2) / 0.6, 0.0, 1.0), up = std::clamp((t - 1.4) / 0.6, 0.0, 1.0);
    return Vec3{0, 0, -(kSkin_m + kDeep_m) * (down - up)};
  };
}

TEST_F(FalconUsbStation, aLessonRunsToItsEndAndLeavesNoTorque) {
  falcon_.plug();
  const auto child = station(lesson("4", "wait"));
  home(*child);
  falcon_.hold(strokes());
  falcon_.letGive();
  const auto code = child->wait(kPatience);
  const nlohmann::json summary = out()["rows"][0];
  if (summary["fault"].is_null()) {
    EXPECT_EQ(code, kExitDone) << child->said();
  } else {
    // the machine stalled: the only fault that a test may cause
    EXPECT_THAT(summary["fault"].get<std::string>(), testing::StartsWith("the device stopped reporting"))
        << child->said();
  }
  EXPECT_EQ(summary["samples"].get<int>() + summary["missed_ticks"].get<int>(), summary["ticks"].get<int>());
  // effects that this device cannot render are reported, listed and not live
  EXPECT_THAT(child->said(), testing::HasSubstr("does not measure how it is turned"));
  EXPECT_THAT(child->said(), testing::HasSubstr("ORIENTATION_LIMIT is not live"));
  EXPECT_GE(summary["device_notes"].size(), 2u) << summary["device_notes"];
  for (const auto& effect : summary["live_effects"]) EXPECT_NE(effect, "ORIENTATION_LIMIT");
  expectNoTorqueAtTheEnd();
}

/// Returns the id of the thread with this name, or −1.
pid_t threadOf(pid_t process, const std::string& name) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
    std::string found;
    std::getline(std::ifstream(task.path() / "comm"), found);
    if (found == name) return static_cast<pid_t>(std::stol(task.path().filename().string()));
  }
  return -1;
}

// On a busy machine the emulated device reports too late; then there is no force for a crash to leave behind.
TEST_F(FalconUsbStation, aCrashOfTheDevicesOwnThreadLeavesNoTorque) {
  if (!longForm()) GTEST_SKIP() << "needs a device that reports in time: NEEDLELAB_LONG=1";
  falcon_.plug();
  const auto child = station(lesson("600", "wait"));
  home(*child);
  falcon_.hold(strokes());
  // If the machine stalls, the force goes to zero; then acknowledge outside the tissue, as asked.
  std::size_t acknowledged = 0;
  ASSERT_TRUE(eventually([&] {
    std::size_t asked = 0;
    const std::string said = child->said();
    for (const std::string words : {"FAULT: ", "not yet: "})
      for (auto at = said.find(words); at != std::string::npos; at = said.find(words, at + 1)) ++asked;
    if (asked > acknowledged) child->signal(SIGUSR1);
    acknowledged = asked;
    return norm(falcon_.force_N()) > 0.3;
  })) << child->said();

  const pid_t thread = threadOf(child->pid(), "falcon-usb");
  ASSERT_GT(thread, 0);
  ASSERT_EQ(::syscall(SYS_tgkill, child->pid(), thread, SIGSEGV), 0);
  EXPECT_EQ(child->wait(kPatience), -SIGSEGV) << child->said();
  EXPECT_THAT(child->said(), testing::HasSubstr("zero force was sent to the device"));
  expectNoTorqueAtTheEnd();
}

TEST_F(FalconUsbStation, isListedAndTestsItselfWithoutTorque) {
  falcon_.plug();
  const auto list = station({"--list-devices", "--json", folder_.path() / "out.json"});
  ASSERT_EQ(list->wait(kPatience), kExitDone) << list->said();
  EXPECT_THAT(out().dump(), testing::HasSubstr("FALCON01"));
  EXPECT_EQ(falcon_.heard().size(), 0u) << "listing moves nothing";

  const auto test = station({"--self-test", "--device", "falcon", "--seconds", "1", "--spool",
                             folder_.path() / "spool", "--json", folder_.path() / "out.json"});
  home(*test);
  falcon_.holdAt({});
  ASSERT_TRUE(test->wait(kPatience)) << test->said();
  std::vector<std::string> seen;
  const nlohmann::json report = out();
  for (const auto& row : report["rows"])
    for (const char* name : {"device", "pose", "place", "force limits"})
      if (row["check"] == name) {
        EXPECT_EQ(row["verdict"], "OK") << row;
        seen.emplace_back(name);
      }
  EXPECT_THAT(seen, testing::UnorderedElementsAre("device", "pose", "place", "force limits")) << test->said();
  EXPECT_FALSE(falcon_.heard().empty());
  for (const Heard& heard : falcon_.heard()) ASSERT_EQ(heard.command.motor, Motors{});

  const auto calibration = station({"--calibrate", "--device", "falcon"});
  EXPECT_EQ(calibration->wait(kPatience), kExitInvalid);
  EXPECT_THAT(calibration->said(), testing::HasSubstr("its grip is the tip"));
}

}  // namespace
}  // namespace needlelab::test
