// FORMAT.md names the values of phase, fault and flags, and the columns of exports: they must match the code.
#include <gmock/gmock.h>

#include <bit>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/sim_state.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

std::string page() {
  const auto text = readWholeFile(std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "common/gesture/FORMAT.md");
  EXPECT_TRUE(text.ok());
  return text.ok() ? *text : std::string();
}

/// "value name" for each row of the page's table whose first column has this header.
std::set<std::string> rowsOf(const std::string& head) {
  const std::string text = page();
  std::set<std::string> rows;
  auto at = text.find("\n| " + head + " | code |");
  EXPECT_NE(at, std::string::npos) << head;
  if (at == std::string::npos) return rows;
  at = text.find('\n', text.find('\n', at + 1) + 1) + 1;  // after the header and the line below it
  for (; text.compare(at, 2, "| ") == 0; at = text.find('\n', at) + 1) {
    const auto bar = text.find(" | `", at), end = text.find('`', bar + 4);
    rows.insert(text.substr(at + 2, bar - at - 2) + " " + text.substr(bar + 4, end - bar - 4));
  }
  return rows;
}

#define NEEDLELAB_VALUE(type, name) std::to_string(static_cast<int>(type::name)) + " " #name
#define NEEDLELAB_BIT(name) std::to_string(std::countr_zero(static_cast<std::uint32_t>(name))) + " " #name

TEST(FormatPage, namesThePhases) {
  const std::set<std::string> code = {NEEDLELAB_VALUE(Phase, kFree), NEEDLELAB_VALUE(Phase, kInserting),
                                      NEEDLELAB_VALUE(Phase, kStopped), NEEDLELAB_VALUE(Phase, kWithdrawing)};
  EXPECT_EQ(rowsOf("phase"), code);
}

TEST(FormatPage, namesTheFaults) {
  const std::set<std::string> code = {NEEDLELAB_VALUE(Fault, kNone),
                                      NEEDLELAB_VALUE(Fault, kSampleNotFinite),
                                      NEEDLELAB_VALUE(Fault, kTipTooFast),
                                      NEEDLELAB_VALUE(Fault, kDeviceTooFast),
                                      NEEDLELAB_VALUE(Fault, kDeviceSilent),
                                      NEEDLELAB_VALUE(Fault, kForceNotFinite),
                                      NEEDLELAB_VALUE(Fault, kOrientationInvalid),
                                      NEEDLELAB_VALUE(Fault, kEmergencyStop),
                                      NEEDLELAB_VALUE(Fault, kDeviceLost),
                                      NEEDLELAB_VALUE(Fault, kDeviceOverheated),
                                      NEEDLELAB_VALUE(Fault, kDeviceTrouble),
                                      NEEDLELAB_VALUE(Fault, kProgramTrouble)};
  EXPECT_EQ(rowsOf("fault"), code);
}

TEST(FormatPage, namesTheBitsOfFlags) {
  const std::set<std::string> code = {NEEDLELAB_BIT(kFlagEntry),
                                      NEEDLELAB_BIT(kFlagExit),
                                      NEEDLELAB_BIT(kFlagLayerChange),
                                      NEEDLELAB_BIT(kFlagRupture),
                                      NEEDLELAB_BIT(kFlagTurn),
                                      NEEDLELAB_BIT(kFlagClampCapped),
                                      NEEDLELAB_BIT(kFlagForceCapped),
                                      NEEDLELAB_BIT(kFlagTorque),
                                      NEEDLELAB_BIT(kFlagNotStepped),
                                      NEEDLELAB_BIT(kFlagStartedInside),
                                      NEEDLELAB_BIT(kFlagBeyondNeedle),
                                      NEEDLELAB_BIT(kFlagFlatEntry),
                                      NEEDLELAB_BIT(kFlagNewPath),
                                      NEEDLELAB_BIT(kFlagKeptPath),
                                      NEEDLELAB_BIT(kFlagCapped),
                                      NEEDLELAB_BIT(kFlagSkipped),
                                      NEEDLELAB_BIT(kGateSampleRejected),
                                      NEEDLELAB_BIT(kGatePeakLimited),
                                      NEEDLELAB_BIT(kGateThermalLimited),
                                      NEEDLELAB_BIT(kGateSlewLimited),
                                      NEEDLELAB_BIT(kGateStartRamp),
                                      NEEDLELAB_BIT(kGateFaulted),
                                      NEEDLELAB_BIT(kDeviceEmergencyStop),
                                      NEEDLELAB_BIT(kDeviceReleased),
                                      NEEDLELAB_BIT(kDevicePowerOff),
                                      NEEDLELAB_BIT(kDeviceOverheated),
                                      NEEDLELAB_BIT(kDeviceSaturated),
                                      NEEDLELAB_BIT(kDeviceOverrun),
                                      NEEDLELAB_BIT(kDeviceLost),
                                      NEEDLELAB_BIT(kDeviceTrouble),
                                      NEEDLELAB_BIT(kDeviceNotReady)};
  EXPECT_EQ(rowsOf("flag's bit"), code);
  // all of the device's bits, and the page's tables, have a name here
  std::uint32_t device_bits = 0;
  for (const std::string& row : code)
    if (row.find(" kDevice") != std::string::npos) device_bits |= 1u << std::stoi(row);
  EXPECT_EQ(device_bits, kDeviceFlags);
}

TEST(FormatPage, hasTheHeaderOfExports) {
  std::string header;
  appendSampleCsvHeader(header);
  EXPECT_THAT(page(), HasSubstr("```\n" + header + "```\n"));
}

}  // namespace
}  // namespace needlelab
