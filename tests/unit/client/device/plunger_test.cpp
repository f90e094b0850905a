#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "client/device/plunger.h"
#include "tests/support/realtime/no_alloc.h"

namespace needlelab {
namespace {

constexpr double kPlungerRate_hz = 1000;
constexpr std::uint32_t kPush = 1u << 0, kPull = 1u << 1;

PlungerSettings buttons() {
  PlungerSettings settings;
  settings.source = PlungerSource::kButtons;
  return settings;
}

DeviceReading pressing(std::uint32_t bits) {
  DeviceReading reading;
  reading.buttons = bits;
  reading.plunger = 0.77;  // not queried on a device with buttons
  return reading;
}

void hold(Plunger& plunger, std::uint32_t bits, int ticks) {
  for (int i = 0; i < ticks; ++i) plunger.update(pressing(bits), true, 1);
}

TEST(Plunger, aButtonPressesItDownInThreeSecondsAnotherDrawsItBack) {
  Plunger plunger(buttons(), kPlungerRate_hz);
  EXPECT_EQ(plunger.position(), 0.2) << "so that one can aspirate";
  hold(plunger, kPull, 300);
  EXPECT_NEAR(plunger.position(), 0.1, 1e-12);
  hold(plunger, 0, 500);
  EXPECT_NEAR(plunger.position(), 0.1, 1e-12);
  hold(plunger, kPush, 1500);
  EXPECT_NEAR(plunger.position(), 0.6, 1e-12);
  hold(plunger, kPush | kPull, 1000);
  EXPECT_NEAR(plunger.position(), 0.6, 1e-12) << "both: it stays";
  hold(plunger, ~(kPush | kPull), 1000);
  EXPECT_NEAR(plunger.position(), 0.6, 1e-12) << "other buttons are not its own";
}

TEST(Plunger, stopsAtItsEnds) {
  Plunger plunger(buttons(), kPlungerRate_hz);
  hold(plunger, kPush, 10'000);
  EXPECT_EQ(plunger.position(), 1);
  hold(plunger, kPull, 10'000);
  EXPECT_EQ(plunger.position(), 0);
}

TEST(Plunger, takesTheSameTimeAtEveryRate) {
  for (const double rate : {250.0, 1000.0, 4000.0}) {
    Plunger plunger(buttons(), rate);
    for (int i = 0; i < static_cast<int>(rate); ++i) plunger.update(pressing(kPush), true, 1);
    EXPECT_NEAR(plunger.position(), 0.2 + 1.0 / 3, 1e-9) << rate;
  }
}

TEST(Plunger, missedTicksCountButNotALongStall) {
  Plunger plunger(buttons(), kPlungerRate_hz);
  plunger.update(pressing(kPush), true, 50);
  EXPECT_NEAR(plunger.position(), 0.2 + 50 / 3000.0, 1e-12);
  plunger.update(pressing(kPush), true, 10'000);
  EXPECT_NEAR(plunger.position(), 0.2 + 150 / 3000.0, 1e-12) << "100 ms of it";
  plunger.update(pressing(kPush), true, -5);
  EXPECT_NEAR(plunger.position(), 0.2 + 150 / 3000.0, 1e-12);
}

TEST(Plunger, aLostDeviceDoesNotGoOnInjecting) {
  Plunger plunger(buttons(), kPlungerRate_hz);
  hold(plunger, kPush, 300);
  for (int i = 0; i < 2000; ++i) plunger.update(pressing(kPush), false, 1);
  EXPECT_NEAR(plunger.position(), 0.3, 1e-12);
  // The first reading after a gap contains only its own state, not the gap's.
  plunger.update(pressing(0), true, 1);
  EXPECT_NEAR(plunger.position(), 0.3, 1e-12);
  // Every second tick is fresh, as with a slow device: no press is lost.
  for (int i = 0; i < 300; ++i) plunger.update(pressing(kPush), i % 2 == 1, 1);
  EXPECT_NEAR(plunger.position(), 0.4, 1e-12);
}

TEST(Plunger, isAsMeasuredWhereItIsMeasured) {
  Plunger plunger({}, kPlungerRate_hz);
  EXPECT_EQ(plunger.position(), 0);
  DeviceReading reading;
  reading.buttons = kPush;
  reading.plunger = 0.4375;
  EXPECT_EQ(plunger.update(reading, true, 1), 0.4375);
  reading.plunger = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(plunger.update(reading, true, 1), 0.4375);
  reading.plunger = std::numeric_limits<double>::infinity();
  EXPECT_EQ(plunger.update(reading, true, 1), 0.4375);
  reading.plunger = 7;
  EXPECT_EQ(plunger.update(reading, true, 1), 1);
  reading.plunger = -0.1;
  EXPECT_EQ(plunger.update(reading, true, 1), 0);
  reading.plunger = 0.5;
  EXPECT_EQ(plunger.update(reading, false, 1), 0);
}

TEST(Plunger, staysWhereADeviceHasNone) {
  PlungerSettings none;
  none.source = PlungerSource::kNone;
  Plunger plunger(none, kPlungerRate_hz);
  EXPECT_EQ(plunger.update(pressing(kPush), true, 1), 0);
}

TEST(Plunger, buttonsThatAreNoneMoveNothing) {
  PlungerSettings settings = buttons();
  settings.pull_button = -1;
  settings.push_button = 31;
  Plunger plunger(settings, kPlungerRate_hz);
  hold(plunger, kPull | kPush, 100);
  EXPECT_EQ(plunger.position(), 0.2);
  hold(plunger, 1u << 31, 300);
  EXPECT_NEAR(plunger.position(), 0.3, 1e-12);
}

TEST(Plunger, allocatesNothing) {
  Plunger plunger(buttons(), kPlungerRate_hz);
  const test::NoAllocScope guard;
  hold(plunger, kPush, 100);
  EXPECT_EQ(guard.calls(), 0u);
}

TEST(PlungerOption, takesOneOrTwoButtons) {
  PlungerSettings settings;
  ASSERT_TRUE(parsePlungerOption("2,5", settings).ok());
  EXPECT_EQ(settings.push_button, 2);
  EXPECT_EQ(settings.pull_button, 5);
  ASSERT_TRUE(parsePlungerOption("31", settings).ok());
  EXPECT_EQ(settings.push_button, 31);
  EXPECT_EQ(settings.pull_button, -1);
}

TEST(PlungerOption, refusesOtherValuesAndListsTheAllowedOnes) {
  for (const char* wrong :
       {"", ",", "1,", ",1", "1,1", "32", "-1", "a", "0,b", "0,1,2", "0 ,1", "1.0", "0x1"}) {
    PlungerSettings settings;
    const Status status = parsePlungerOption(wrong, settings);
    ASSERT_FALSE(status.ok()) << wrong;
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(status.error().message.find("--plunger"), std::string::npos);
    EXPECT_NE(status.error().message.find("0 to 31"), std::string::npos);
    EXPECT_EQ(settings.push_button, 0) << "nothing was taken";
  }
}

}  // namespace
}  // namespace needlelab
