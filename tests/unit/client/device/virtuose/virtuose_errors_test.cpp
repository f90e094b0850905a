// Every error code and alarm has a message that tells the user what to do.
#include <gmock/gmock.h>

#include "client/device/virtuose/virtuose_errors.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

TEST(VirtuoseErrors, everyErrorHasItsNumberItsMeaningAndWhatToDo) {
  const struct {
    int code;
    const char *means, *to_do;
    std::uint32_t condition;
  } rows[] = {
      {1, "memory", "close other programs", kDeviceTrouble},
      {2, "nothing answers", "Ethernet cable", kDeviceLost},
      {3, "not valid any more", "opened again by itself", kDeviceLost},
      {4, "misses a file", "install the vendor's software", kDeviceTrouble},
      {5, "cannot read a file", "install the vendor's software", kDeviceTrouble},
      {6, "did not answer in time", "Ethernet cable", kDeviceLost},
      {7, "does not have that function", "current VirtuoseAPI", kDeviceTrouble},
      {8, "does not have that value", "Virtuose 6D", kDeviceTrouble},
      {9, "refuses the value", "report it", kDeviceTrouble},
      {10, "address", "HOST#PORT", kDeviceTrouble},
      {11, "hardware error", "off and on again", kDeviceTrouble},
      {12, "jumped", "into its rest", kDeviceTrouble},
      {13, "part of its own", "install the vendor's software", kDeviceTrouble},
      {14, "loop could not start", "report it", kDeviceTrouble},
      {15, "clock", "call the vendor", kDeviceTrouble},
      {16, "version", "belongs to the device's software", kDeviceTrouble},
      {17, "mode", "report it", kDeviceTrouble},
      {18, "cannot render forces", "Virtuose 6D", kDeviceTrouble},
      {19, "wrong time", "report it", kDeviceTrouble},
      {20, "do not fit together", "belongs to the device's software", kDeviceTrouble},
      {21, "mechanism", "report it", kDeviceTrouble},
      {22, "already", "report it", kDeviceTrouble},
  };
  for (const auto& row : rows) {
    SCOPED_TRACE(row.code);
    const std::string words = virtuoseErrorText(row.code, "the vendor's");
    EXPECT_THAT(words, StartsWith("error " + std::to_string(row.code) + ", "));
    EXPECT_THAT(words, HasSubstr(row.means));
    EXPECT_THAT(words, HasSubstr(row.to_do));
    EXPECT_EQ(virtuoseConditionOfError(row.code), row.condition);
    EXPECT_EQ(virtuoseLinkIsLost(row.code), row.condition == kDeviceLost);
  }
}

TEST(VirtuoseErrors, anUnknownErrorGivesTheVendorsOwnText) {
  EXPECT_THAT(virtuoseErrorText(77, "le bras dort"), HasSubstr("error 77, "));
  EXPECT_THAT(virtuoseErrorText(77, "le bras dort"), HasSubstr("\"le bras dort\""));
  EXPECT_THAT(virtuoseErrorText(77, nullptr), HasSubstr("nothing of it"));
  EXPECT_THAT(virtuoseErrorText(-4, ""), HasSubstr("nothing of it"));
  EXPECT_EQ(virtuoseConditionOfError(77), static_cast<std::uint32_t>(kDeviceTrouble));
}

TEST(VirtuoseErrors, everyAlarmHasItsWordsAndItsFlag) {
  const struct {
    std::uint32_t bit, condition;
    const char* words;
  } rows[] = {
      {0x4000, kDeviceOverheated, "too hot"},
      {0x8000, kDeviceSaturated, "at their limit"},
      {0x20000, kDeviceOverrun, "too fast"},
      {0x40000, kDeviceTrouble, "its own position"},
      {0x100000, 0, "battery"},
      {0x2, 0, "alarm 0x2, which needlelab does not know"},
  };
  std::uint32_t all = 0, conditions = 0;
  for (const auto& row : rows) {
    EXPECT_THAT(virtuoseAlarmText(row.bit), HasSubstr(row.words));
    EXPECT_EQ(virtuoseConditionOfAlarm(row.bit), row.condition) << std::hex << row.bit;
    all |= row.bit;
    conditions |= row.condition;
  }
  for (const auto& row : rows) EXPECT_THAT(virtuoseAlarmText(all), HasSubstr(row.words));
  EXPECT_EQ(virtuoseConditionOfAlarm(all), conditions);
  EXPECT_EQ(virtuoseAlarmText(0), "");
}

TEST(VirtuoseErrors, aFailureNamesItsMotors) {
  EXPECT_EQ(virtuoseFailureText(0), "");
  EXPECT_THAT(virtuoseFailureText(0x5), HasSubstr("encoder 1"));
  EXPECT_THAT(virtuoseFailureText(0x5), HasSubstr("encoder 3"));
  EXPECT_THAT(virtuoseFailureText(0x5), Not(HasSubstr("encoder 2")));
  EXPECT_THAT(virtuoseFailureText(0x80), HasSubstr("encoder 8"));
  EXPECT_THAT(virtuoseFailureText(0x400), HasSubstr("failure 0x400"));
  EXPECT_EQ(virtuoseConditionOfFailure(0x400), static_cast<std::uint32_t>(kDeviceTrouble));
  EXPECT_EQ(virtuoseConditionOfFailure(0), 0u);
}

TEST(VirtuoseErrors, ofWhatHindersThePersonHearsTheFirstThingToDo) {
  EXPECT_EQ(virtuoseStateText(0, 0, 0), "");
  EXPECT_THAT(virtuoseStateText(kDevicePowerOff, 0, 0), HasSubstr("power switch"));
  // Without a hand there is no power either, so the hand is reported first.
  const std::string released = virtuoseStateText(kDeviceReleased | kDevicePowerOff, 0, 0);
  EXPECT_THAT(released, HasSubstr("holds the handle"));
  EXPECT_THAT(released, Not(HasSubstr("power switch")));
  const std::string stopped =
      virtuoseStateText(kDeviceEmergencyStop | kDeviceReleased | kDevicePowerOff, 0x4000, 2);
  EXPECT_THAT(stopped, StartsWith("the emergency stop is pressed"));
  EXPECT_THAT(stopped, HasSubstr("too hot"));
  EXPECT_THAT(stopped, HasSubstr("encoder 2"));
}

}  // namespace
}  // namespace needlelab
