#include <gmock/gmock.h>

#include "client/station/window/screens/lesson_screen.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

LessonStatus faulted(Fault fault) {
  LessonStatus status;
  status.fault = fault;
  status.waits = true;
  return status;
}

TEST(LessonScreen, saysWhoAndWhichAttemptOrThatACodeWasNotChecked) {
  LessonBeginning beginning;
  beginning.trainee = "tom";
  EXPECT_EQ(lessonLine(beginning), "tom");
  beginning.lesson.attempt = 2;
  beginning.lesson.attempts_left = 3;
  beginning.lesson.exercise.emplace().set_description("Stop when the resistance drops.");
  EXPECT_EQ(lessonLine(beginning),
            "tom, attempt 2 (3 left, this one included): Stop when the resistance drops.");
  beginning.code_unchecked = true;
  EXPECT_EQ(lessonLine(beginning),
            "tom: The server is away: your code was not checked. A manager confirms this session later.");
}

TEST(Overlay, calmIsNothing) {
  EXPECT_EQ(overlayOf({}).kind, Overlay::Kind::kNone);
}

TEST(Overlay, aFaultShowsItsCauseAndAdvice) {
  const Overlay overlay = overlayOf(faulted(Fault::kTipTooFast));
  EXPECT_EQ(overlay.kind, Overlay::Kind::kFault);
  EXPECT_THAT(overlay.what, HasSubstr(faultText(Fault::kTipTooFast) + 1));
  EXPECT_THAT(overlay.todo, HasSubstr("needle out"));
  EXPECT_THAT(overlay.todo, HasSubstr("Enter"));
  EXPECT_TRUE(overlay.can_acknowledge);
}

TEST(Overlay, aCauseThatLastsIsToBeMendedFirst) {
  LessonStatus status = faulted(Fault::kEmergencyStop);
  status.cause_lasts = true;
  const Overlay overlay = overlayOf(status);
  EXPECT_THAT(overlay.todo, HasSubstr("First let the emergency stop out"));
  EXPECT_FALSE(overlay.can_acknowledge);
}

TEST(Overlay, whoHasSeenItOnlyNeedsToTakeTheNeedleOut) {
  LessonStatus status = faulted(Fault::kDeviceTooFast);
  status.acknowledged = true;
  const Overlay overlay = overlayOf(status);
  EXPECT_THAT(overlay.todo, HasSubstr("Acknowledged"));
  EXPECT_FALSE(overlay.can_acknowledge);
}

TEST(Overlay, aLessonEndingFaultSaysThatTheLessonIsStored) {
  LessonStatus status = faulted(Fault::kTipTooFast);
  status.waits = false;
  EXPECT_THAT(overlayOf(status).todo, HasSubstr("stored"));
  EXPECT_FALSE(overlayOf(status).can_acknowledge);
}

TEST(Overlay, eachHoldHasItsRemedy) {
  const std::pair<std::uint32_t, const char*> holds[] = {{kDeviceReleased, "Take the handle"},
                                                         {kDevicePowerOff, "motors on"},
                                                         {kDeviceNotReady, "Wait"},
                                                         {0, "Take the needle out"}};
  for (const auto& [condition, todo] : holds) {
    LessonStatus status;
    status.hold = "the hold";
    status.condition = condition;
    const Overlay overlay = overlayOf(status);
    EXPECT_EQ(overlay.kind, Overlay::Kind::kHold);
    EXPECT_EQ(overlay.what, "The hold.");
    EXPECT_THAT(overlay.todo, HasSubstr(todo));
  }
}

TEST(Overlay, theDevicesOwnWordsGoFirst) {
  LessonStatus status;
  status.hold = "the motors have no power";
  status.device_status = "press the green button";
  EXPECT_EQ(overlayOf(status).what, "Press the green button.");
}

}  // namespace
}  // namespace needlelab
