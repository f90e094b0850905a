#include "client/station/window/overlay_words.h"

#include <gmock/gmock.h>

#include "common/haptics/device_condition.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

LessonStanding faulted(Fault fault) {
  LessonStanding standing;
  standing.fault = fault;
  standing.waits = true;
  return standing;
}

TEST(OverlayWords, calmIsNothing) {
  EXPECT_EQ(overlayOf({}).kind, Overlay::Kind::kNone);
}

TEST(OverlayWords, aFaultSaysWhatHappenedAndWhatToDo) {
  const Overlay overlay = overlayOf(faulted(Fault::kTipTooFast));
  EXPECT_EQ(overlay.kind, Overlay::Kind::kFault);
  EXPECT_THAT(overlay.what, HasSubstr(faultText(Fault::kTipTooFast) + 1));
  EXPECT_THAT(overlay.todo, HasSubstr("needle out"));
  EXPECT_THAT(overlay.todo, HasSubstr("Enter"));
  EXPECT_TRUE(overlay.can_acknowledge);
}

TEST(OverlayWords, aCauseThatLastsIsToBeMendedFirst) {
  LessonStanding standing = faulted(Fault::kEmergencyStop);
  standing.cause_lasts = true;
  const Overlay overlay = overlayOf(standing);
  EXPECT_THAT(overlay.todo, HasSubstr("First let the emergency stop out"));
  EXPECT_FALSE(overlay.can_acknowledge);
}

TEST(OverlayWords, whoHasSeenItOnlyNeedsToTakeTheNeedleOut) {
  LessonStanding standing = faulted(Fault::kDeviceTooFast);
  standing.acknowledged = true;
  const Overlay overlay = overlayOf(standing);
  EXPECT_THAT(overlay.todo, HasSubstr("Seen"));
  EXPECT_FALSE(overlay.can_acknowledge);
}

TEST(OverlayWords, aFaultThatEndsTheLessonSaysThatItIsStored) {
  LessonStanding standing = faulted(Fault::kTipTooFast);
  standing.waits = false;
  EXPECT_THAT(overlayOf(standing).todo, HasSubstr("stored"));
  EXPECT_FALSE(overlayOf(standing).can_acknowledge);
}

TEST(OverlayWords, eachHoldHasItsRemedy) {
  const std::pair<std::uint32_t, const char*> holds[] = {{kDeviceReleased, "Take the handle"},
                                                         {kDevicePowerOff, "motors on"},
                                                         {kDeviceNotReady, "Wait"},
                                                         {0, "Draw the needle out"}};
  for (const auto& [condition, todo] : holds) {
    LessonStanding standing;
    standing.hold = "the hold";
    standing.condition = condition;
    const Overlay overlay = overlayOf(standing);
    EXPECT_EQ(overlay.kind, Overlay::Kind::kHold);
    EXPECT_EQ(overlay.what, "The hold.");
    EXPECT_THAT(overlay.todo, HasSubstr(todo));
  }
}

TEST(OverlayWords, theDevicesOwnWordsGoFirst) {
  LessonStanding standing;
  standing.hold = "the motors have no power";
  standing.device_words = "press the green button";
  EXPECT_EQ(overlayOf(standing).what, "Press the green button.");
}

}  // namespace
}  // namespace needlelab
