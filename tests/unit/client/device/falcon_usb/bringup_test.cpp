// The station's self-test of a Falcon on the emulated USB: all rows but those of time, and no torque.
#include <gmock/gmock.h>

#include <bit>
#include <nlohmann/json.hpp>

#include "client/station/run/self_test.h"
#include "common/base/files.h"
#include "common/base/program.h"
#include "common/haptics/device_condition.h"
#include "tests/integration/process.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

const Check* find(const std::vector<Check>& checks, const std::string& name) {
  for (const Check& check : checks)
    if (check.name == name) return &check;
  return nullptr;
}

TEST_F(FalconOnUsb, selfTestFindsItWellAndGivesItNoTorque) {
  openDevice();
  home();
  device_->close();
  const std::uint64_t before = falcon_.commands();

  LoopTime clock;
  bool stopped = false;
  sigset_t none;
  sigemptyset(&none);
  SelfTestFacts facts;
  facts.device = measureDevice(
      *device_, clock, RtOptions{}, 0.5, none, [](const auto&) {}, stopped);
  ASSERT_EQ(facts.device.trouble, "");
  EXPECT_GT(facts.device.loop.fresh, 50u);
  // The rate of the emulated Falcon depends on the machine.
  facts.device.loop.condition_ticks.at(std::countr_zero(static_cast<std::uint32_t>(kDeviceOverrun))) = 0;
  const auto checks = judge(facts);
  EXPECT_EQ(find(checks, "condition")->verdict, Verdict::kOk) << find(checks, "condition")->found;
  EXPECT_EQ(find(checks, "pose")->verdict, Verdict::kOk);
  EXPECT_EQ(find(checks, "torque limits")->verdict, Verdict::kWarning);
  EXPECT_EQ(find(checks, "orientation")->verdict, Verdict::kWarning);
  EXPECT_EQ(find(checks, "tool"), nullptr);

  // No command to the device asked for torque.
  EXPECT_GT(falcon_.commands(), before + 50);
  for (const CommandSeen& seen : falcon_.history())
    for (const std::int16_t motor : seen.motors) EXPECT_EQ(motor, 0);
}

TEST_F(FalconOnUsb, selfTestSaysWhatTheHandHasToDoAndThatItWasNotDone) {
  falcon_.plug();
  FalconDevice device{FalconOptions{}};
  LoopTime clock;
  bool stopped = false;
  sigset_t none;
  sigemptyset(&none);
  std::vector<std::string> messages;
  SelfTestFacts all;
  all.device = measureDevice(
      device, clock, RtOptions{}, 0.2, none, [&](const auto& text) { messages.push_back(text); }, stopped,
      0.5);
  ASSERT_FALSE(messages.empty());
  EXPECT_THAT(messages.front(), HasSubstr("grip"));
  EXPECT_EQ(find(judge(all), "condition")->verdict, Verdict::kFailed);
}

// Returns the output that a technician sees.
std::string output(const TempFolder& folder, const std::vector<std::string>& arguments, int code) {
  const auto log = folder.path() / "log";
  Process station("needlelab-station", arguments, log);
  EXPECT_EQ(station.wait(std::chrono::seconds(60)), code);
  const auto text = readWholeFile(log);
  EXPECT_TRUE(text.ok());
  return text.ok() ? *text : std::string();
}

// Runs the program's self-test. Returns the wrong rows among those that do not depend on time.
std::string selfTestTrouble(const TempFolder& folder) {
  const auto json_file = folder.path() / "test.json";
  Process station("needlelab-station",
                  {"--self-test", "--device", "falcon", "--seconds", "1", "--spool",
                   (folder.path() / "spool").string(), "--json", json_file.string()},
                  folder.path() / "log");
  // The timing rows may fail.
  const std::optional<int> code = station.wait(std::chrono::seconds(60));
  if (code != kExitDone && code != kExitFailed) return "exit code " + std::to_string(code.value_or(-1));
  const auto text = readWholeFile(json_file);
  if (!text.ok()) return text.error().message;
  int rows = 0;
  const auto json = nlohmann::json::parse(*text);
  for (const auto& row : json["rows"])
    for (const char* name : {"device", "condition", "pose", "place", "force limits"})
      if (row["check"] == name) {
        const bool of_time =
            row["found"].get<std::string>().find("could not keep the rate") != std::string::npos;
        if (row["verdict"] != "OK" && !of_time) return row.dump();
        ++rows;
      }
  return rows >= 5 ? "" : "only " + std::to_string(rows) + " of the rows";
}

TEST_F(FalconOnUsb, theProgramListsAndTestsIt) {
  const TempFolder folder;
  openDevice();
  home();
  device_->close();
  EXPECT_THAT(output(folder, {"--list-devices"}, kExitDone), HasSubstr("FALCON01"));

  // A busy machine may starve the emulated Falcon, so that it looks unplugged.
  std::string found;
  for (int tries = 0; tries < 6 && (tries == 0 || !found.empty()); ++tries) found = selfTestTrouble(folder);
  EXPECT_EQ(found, "");
  EXPECT_THAT(output(folder, {"--calibrate", "--device", "falcon"}, kExitInvalid),
              HasSubstr("its grip is the tip"));
}

}  // namespace
}  // namespace needlelab::test
