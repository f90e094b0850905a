// The backend's readings, states and errors against the stand-in.
#include <cmath>

#include "tests/support/realtime/no_alloc.h"
#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

class VirtuoseDeviceTest : public VirtuoseTest {};

TEST_F(VirtuoseDeviceTest, isThePlaceSpeedAndTurnOfTheHandle) {
  standin_.command("place 0.1 -0.2 0.3 0 0 0 1");
  open();
  standin_.command("hand 0.15 -0.2 0.3 0 0.19866933 0 0.98006658 0.5");  // 0.4 rad about y
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(tick(), DeviceRead::kFresh);
    const StandinState truth = standin_.state();
    ASSERT_NEAR(reading_.X_WH.p.x, truth.position_m[0], 5.1e-6);
    ASSERT_NEAR(reading_.X_WH.p.y, truth.position_m[1], 5.1e-6);
    ASSERT_NEAR(reading_.X_WH.q.y, truth.orientation[1], 1e-4);
    // The device sends floats; we convert them to a rotation in doubles.
    ASSERT_NEAR(dot(reading_.X_WH.q, reading_.X_WH.q), 1, 1e-14);
    const double* v = truth.velocity_mps;
    ASSERT_NEAR(reading_.speed_mps, std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), 1e-6);
  }
  EXPECT_NEAR(reading_.X_WH.p.x, 0.15, 2e-4);
  EXPECT_NEAR(2 * std::asin(reading_.X_WH.q.y), 0.4, 2e-3);
  EXPECT_EQ(standin_.complaints(), "");
}

TEST_F(VirtuoseDeviceTest, buttonsAreBitsWithinSevenTicks) {
  open();
  askAll();
  EXPECT_EQ(reading_.buttons, 0u);
  standin_.command("button 1 1");
  standin_.command("button 3 1");
  askAll();
  EXPECT_EQ(reading_.buttons, 0b101u);
  standin_.command("button 1 0");
  askAll();
  EXPECT_EQ(reading_.buttons, 0b100u);
}

TEST_F(VirtuoseDeviceTest, aHandleWithoutAButtonIsAskedForItOnce) {
  standin_.command("fail virtGetButton 9");
  open();
  const std::string complaints = standin_.complaints();
  askAll();
  EXPECT_EQ(standin_.complaints(), complaints);
  EXPECT_EQ(reading_.condition, 0u);
}

TEST_F(VirtuoseDeviceTest, aWrenchArrivesAsForceThenTorque) {
  open();
  ticks(300, {{1, -2, 3}, {0.1, -0.2, 0.15}});
  const StandinState truth = standin_.state();
  const double expected[] = {1, -2, 3, 0.1, -0.2, 0.15};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(truth.commanded[i], expected[i], 1e-3 * std::abs(expected[i])) << i;
}

TEST_F(VirtuoseDeviceTest, anUnreadyDeviceOpensAndGivesAdvice) {
  for (const auto& [command, words, flag] : {std::tuple{"switch 0", "power switch", kDevicePowerOff},
                                             {"estop press", "emergency stop", kDeviceEmergencyStop}}) {
    standin_.command(command);
    open();
    EXPECT_THAT(device_.status(), HasSubstr(words));
    tick();
    EXPECT_EQ(reading_.condition & ~kDevicePowerOff, flag & ~kDevicePowerOff) << "from the first tick on";
    EXPECT_NE(reading_.condition & flag, 0u);
    device_.close();
  }
}

TEST_F(VirtuoseDeviceTest, noCallFailsUnseen) {
  for (const char* call :
       {"virtGetPosition", "virtGetSpeed", "virtGetDeadMan", "virtGetEmergencyStop", "virtGetPowerOn",
        "virtGetAlarm", "virtGetFailure", "virtGetButton", "virtSetForce"})
    for (const int code : {9, 11, 12, 17, 77}) {
      SCOPED_TRACE(std::string(call) + " " + std::to_string(code));
      const std::string fail = std::string("fail ") + call + " ";
      open();
      askAll();
      ASSERT_EQ(reading_.condition, 0u);
      standin_.command(fail + std::to_string(code));
      std::uint32_t seen = 0;
      for (int k = 0; k < 8; ++k) {
        tick();
        seen |= reading_.condition;
      }
      EXPECT_EQ(seen, static_cast<std::uint32_t>(kDeviceTrouble));
      standin_.command(fail + "0");
      askAll();
      EXPECT_EQ(reading_.condition, 0u);  // it continues when the device works again
      device_.close();
      standin_.advance(0.2);  // closing and reopening at once would be too fast for the device
    }
}

TEST_F(VirtuoseDeviceTest, anUnknownRefusalIsReportedInTheLibrarysWords) {
  open();
  standin_.command("fail virtGetSpeed 77");
  tick();
  EXPECT_THAT(device_.status(), HasSubstr("\"a message of a newer library\""));
}

TEST_F(VirtuoseDeviceTest, everyStepOfTheSetUpThatFailsIsNamedAndUndone) {
  for (const VirtuoseStep& step : virtuoseSteps({})) {
    SCOPED_TRACE(step.call);
    standin_.command(std::string("fail ") + step.call + " 11");
    const Status status = device_.open(1000);
    ASSERT_FALSE(status.ok());
    EXPECT_THAT(status.error().message, HasSubstr(std::string(step.call) + "("));
    EXPECT_THAT(status.error().message, HasSubstr("error 11"));
    EXPECT_THAT(standin_.calls(), testing::EndsWith("virtSetForce virtSetPowerOn virtClose"));
    EXPECT_EQ(standin_.state().open_contexts, 0);
    EXPECT_EQ(standin_.state().commanded[0], 0);
    EXPECT_EQ(tick(), DeviceRead::kNoUpdate);
    standin_.command(std::string("fail ") + step.call + " 0");
  }
  for (const char* call :
       {"virtGetPowerOn", "virtGetAlarm", "virtGetFailure", "virtGetDeadMan", "virtGetEmergencyStop"}) {
    standin_.command(std::string("fail ") + call + " 8");
    const Status status = device_.open(1000);
    ASSERT_FALSE(status.ok());
    EXPECT_THAT(status.error().message, HasSubstr(std::string(call) + " failed with error 8"));
    EXPECT_EQ(standin_.state().open_contexts, 0);
    standin_.command(std::string("fail ") + call + " 0");
  }
  open();
}

TEST_F(VirtuoseDeviceTest, closingLeavesNoForceAndNoPower) {
  open();
  ticks(300, {{3, 0, 0}, {}});
  EXPECT_NEAR(standin_.state().felt[0], 3, 1e-3);
  device_.close();
  standin_.advance(0.003);
  const StandinState truth = standin_.state();
  EXPECT_EQ(truth.felt[0], 0);
  EXPECT_EQ(truth.is_powered, 0);
  EXPECT_EQ(truth.open_contexts, 0);
  EXPECT_THAT(standin_.calls(), testing::EndsWith("virtSetForce virtSetPowerOn virtClose"));
  device_.close();
  EXPECT_EQ(standin_.complaints(), "");
  // and it opens again
  open();
  EXPECT_EQ(tick(), DeviceRead::kFresh);
}

TEST_F(VirtuoseDeviceTest, roundingIsNormalizedAndAnInvalidQuaternionReachesTheGate) {
  open();
  for (const auto& [scale, length] : {std::pair{1.000001, 1.0}, {0.5, 0.5}}) {
    standin_.command("bad_turn " + std::to_string(scale));
    ticks(10);
    EXPECT_NEAR(dot(reading_.X_WH.q, reading_.X_WH.q), length * length, length == 1 ? 1e-14 : 1e-6);
  }
}

TEST_F(VirtuoseDeviceTest, readAndWriteUseNoHeapEvenWhenTheLinkIsLost) {
  open();
  ticks(10);
  std::uint64_t calls = 0;
  for (const char* command : {"link_down 0", "link_down 5"}) {
    standin_.command(command);
    const NoAllocScope scope;
    for (int k = 0; k < 500; ++k) {
      tick({{1, 2, 3}, {0.1, 0, 0}});
      device_.skip(2);
    }
    calls += scope.calls();
  }
  EXPECT_EQ(calls, 0u);
  EXPECT_EQ(reading_.condition, std::uint32_t{kDeviceLost});
}

}  // namespace
}  // namespace needlelab::test
