#include <gmock/gmock.h>

#include "client/station/run/loop/fault_watch.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A watch that is polled 20 times per second.
struct Watched {
  FaultWatch watch{true, "press Enter"};
  WatchedState state;
  std::vector<std::string> look() {
    state.now_s += 0.05;
    auto said = watch.update(state);
    state.acknowledge_pressed = false;
    return said;
  }
  std::vector<std::string> raise(Fault fault, std::uint32_t condition = 0, std::string words = "") {
    state.fault = fault;
    ++state.faults;
    state.cause_lasts = true;
    state.acknowledged = false;
    state.condition = condition;
    state.device_status = std::move(words);
    return look();
  }
};

TEST(FaultWatch, withoutTroubleItIsSilent) {
  Watched w;
  for (int k = 0; k < 100; ++k) EXPECT_THAT(w.look(), IsEmpty());
}

TEST(FaultWatch, keysPressedBeforeTheFaultWasShownDoNotCount) {
  Watched w;
  w.state.acknowledge_pressed = true;
  EXPECT_FALSE(w.watch.isAcknowledgement(w.state)) << "there is none";
  w.look();

  // The fault came after the last poll, and meanwhile Enter was pressed for another reason.
  w.state.fault = Fault::kTipTooFast;
  w.state.faults = 1;
  w.state.acknowledge_pressed = true;
  EXPECT_FALSE(w.watch.isAcknowledgement(w.state));
  EXPECT_EQ(w.look().size(), 1u) << "now it is reported";
  EXPECT_FALSE(w.watch.isAcknowledgement(w.state)) << "nothing was pressed since";
  w.state.acknowledge_pressed = true;
  EXPECT_TRUE(w.watch.isAcknowledgement(w.state));
  w.look();

  // The fault ends and another one follows at once: the new one has not been reported.
  w.state.fault = Fault::kDeviceLost;
  w.state.faults = 2;
  w.state.acknowledge_pressed = true;
  EXPECT_FALSE(w.watch.isAcknowledgement(w.state));
}

TEST(FaultWatch, aFaultIsReportedOnceWithReasonAndAdvice) {
  Watched w;
  const auto said =
      w.raise(Fault::kDeviceTrouble, kDeviceTrouble, "encoder 3 failed (0x12); switch it off and on");
  EXPECT_THAT(said, ElementsAre(AllOf(HasSubstr("FAULT: the device reported an error"),
                                      HasSubstr("encoder 3 failed (0x12)"),
                                      HasSubstr("Take the needle out of the tissue, then press Enter"))));
  for (int k = 0; k < 100; ++k) EXPECT_THAT(w.look(), IsEmpty());
}

TEST(FaultWatch, theEmergencyStopNamesTheFirstStep) {
  Watched w;
  EXPECT_THAT(
      w.raise(Fault::kEmergencyStop, kDeviceEmergencyStop),
      ElementsAre(HasSubstr("Please let the emergency stop out, take the needle out of the tissue, then "
                            "press Enter")));
}

TEST(FaultWatch, wholeStoryOfAnEmergencyStop) {
  Watched w;
  w.raise(Fault::kEmergencyStop, kDeviceEmergencyStop);
  w.state.acknowledge_pressed = true;  // too early
  EXPECT_THAT(w.look(), ElementsAre(AllOf(HasSubstr("not yet: the emergency stop is pressed"),
                                          HasSubstr("press Enter again"))));
  w.state.condition = 0;
  w.state.cause_lasts = false;
  EXPECT_THAT(w.look(), IsEmpty());
  w.state.acknowledge_pressed = true;
  EXPECT_THAT(w.look(), IsEmpty()) << "the loop has not heard of it yet";
  w.state.acknowledged = true;
  EXPECT_THAT(w.look(), ElementsAre(HasSubstr("when the needle is outside")));
  EXPECT_THAT(w.look(), IsEmpty());
  w.state.fault = Fault::kNone;
  w.state.acknowledged = false;
  EXPECT_THAT(w.look(), ElementsAre("the fault is over: the force comes back"));
  EXPECT_THAT(w.look(), IsEmpty());
}

TEST(FaultWatch, aRefusedAcknowledgementNamesTheObstacle) {
  Watched w;
  w.raise(Fault::kDeviceTooFast);
  w.state.condition = kDeviceLost;
  w.state.device_status = "the cable is out";
  w.look();
  w.state.acknowledge_pressed = true;
  EXPECT_THAT(w.look(), ElementsAre(AllOf(HasSubstr("unplugged"), HasSubstr("the cable is out"))));
}

TEST(FaultWatch, aFaultThatEndsTheLessonAsksForNothing) {
  FaultWatch watch(false, "press Enter");
  WatchedState state;
  state.fault = Fault::kDeviceSilent;
  state.faults = 1;
  EXPECT_THAT(watch.update(state), ElementsAre(AllOf(HasSubstr("The lesson ends"), Not(HasSubstr("Enter")))));
}

TEST(FaultWatch, aCrashOfTheProgramCannotBeAcknowledged) {
  Watched w;
  EXPECT_THAT(w.raise(Fault::kProgramTrouble),
              ElementsAre(AllOf(HasSubstr("The lesson ends"), Not(HasSubstr("Enter")))));
}

TEST(FaultWatch, aFaultBetweenTwoLooksIsNotLost) {
  Watched w;
  ++w.state.faults;  // came and went
  EXPECT_THAT(w.look(), ElementsAre(HasSubstr("there was a FAULT")));
  w.raise(Fault::kDeviceSilent);
  // The fault ends and another one of the same kind follows at once.
  EXPECT_THAT(w.raise(Fault::kDeviceSilent), ElementsAre(HasSubstr("FAULT")));
}

TEST(FaultWatch, holdsAreReportedAtBeginAndEndWithoutFlicker) {
  Watched w;
  w.state.condition = kDeviceReleased;
  EXPECT_THAT(w.look(), ElementsAre("no one holds the handle: no force"));
  for (int k = 0; k < 40; ++k) EXPECT_THAT(w.look(), IsEmpty());
  w.state.condition = 0;
  EXPECT_THAT(w.look(), ElementsAre("the handle is held again: the force comes back"));
  // Flicker: no further message for 10 s.
  for (int k = 0; k < 100; ++k) {
    w.state.condition = k % 2 == 0 ? std::uint32_t{kDeviceReleased} : 0;
    EXPECT_THAT(w.look(), IsEmpty()) << k;
  }
  w.state.now_s += 10;
  w.state.condition = kDeviceReleased;
  EXPECT_THAT(w.look(), ElementsAre("no one holds the handle: no force"));
}

TEST(FaultWatch, eachHoldHasItsWordsAndForceReturnsAfterTheLast) {
  Watched w;
  w.state.condition = kDevicePowerOff | kDeviceNotReady;
  EXPECT_EQ(w.look().size(), 2u);
  w.state.condition = kDevicePowerOff;
  EXPECT_THAT(w.look(), IsEmpty());
  w.state.condition = 0;
  EXPECT_THAT(w.look(), ElementsAre(HasSubstr("the force comes back")));
}

TEST(FaultWatch, theDevicesOwnWordsReplaceOurs) {
  Watched w;
  w.state.condition = kDeviceReleased;
  w.state.device_status = "the dead-man sensor is not covered";
  EXPECT_THAT(w.look(), ElementsAre("the dead-man sensor is not covered: no force"));
  EXPECT_THAT(w.look(), IsEmpty()) << "and are not said twice";
}

TEST(FaultWatch, theEmergencyStopSuppressesTheAdviceOnMotors) {
  Watched w;
  w.raise(Fault::kEmergencyStop, kDeviceEmergencyStop);
  w.state.condition = kDeviceEmergencyStop | kDevicePowerOff;
  for (int k = 0; k < 100; ++k) EXPECT_THAT(w.look(), IsEmpty());
  w.state.condition = kDevicePowerOff;
  EXPECT_THAT(w.look(), ElementsAre(HasSubstr("power")));
}

TEST(FaultWatch, twoHoldsWithTheSameTextAreReportedOnce) {
  Watched w;
  w.state.condition = kDeviceReleased;
  w.state.device_status = "no one holds the handle (take it)";
  EXPECT_THAT(w.look(), ElementsAre("no one holds the handle (take it): no force"));
  w.state.condition = kDeviceReleased | kDevicePowerOff;
  EXPECT_THAT(w.look(), IsEmpty());
}

TEST(FaultWatch, aDeviceThatCountsItsAttemptsIsNotRepeated) {
  Watched w;
  w.raise(Fault::kDeviceLost, kDeviceLost, "looked for again; try 1");
  int lines = 0;
  for (int k = 2; k < 200; ++k) {
    w.state.device_status = "looked for again; try " + std::to_string(k);
    lines += static_cast<int>(w.look().size());
  }
  EXPECT_LE(lines, 2) << "in 10 s";
}

}  // namespace
}  // namespace needlelab
