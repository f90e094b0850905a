// The vendor's rules (FACTS.md), one by one: the stand-in rejects a backend that breaks the rule, and accepts
// ours.
#include <cmath>
#include <limits>

#include "tests/unit/client/device/virtuose/bench.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

using Steps = std::vector<VirtuoseStep>;

std::size_t placeOf(const Steps& steps, const std::string& call) {
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (steps[i].call == call) return i;
  throw std::out_of_range(call);
}

// our set-up with one call moved after another
Steps moved(Steps steps, const std::string& call, const std::string& behind) {
  const VirtuoseStep step = steps[placeOf(steps, call)];
  steps.erase(steps.begin() + static_cast<std::ptrdiff_t>(placeOf(steps, call)));
  steps.insert(steps.begin() + static_cast<std::ptrdiff_t>(placeOf(steps, behind)) + 1, step);
  return steps;
}

Steps without(Steps steps, const std::string& call) {
  steps.erase(steps.begin() + static_cast<std::ptrdiff_t>(placeOf(steps, call)));
  return steps;
}

class VirtuoseRules : public VirtuoseTest {
 protected:
  Result<VirtContext> openWith(const Steps& steps) { return openVirtuose(api_, VirtuoseSetup{}, steps); }
  /// Opens a connection, uses it and closes it.
  template <typename Use>
  void with(const Steps& steps, Use&& use) {
    auto context = openWith(steps);
    ASSERT_TRUE(context.ok()) << context.error().message;
    use(*context);
    closeVirtuose(api_, *context);
  }
  int force(VirtContext context, float x, float torque = 0) const {
    float wrench[6] = {x, 0, 0, 0, torque, 0};
    return api_.virtSetForce(context, wrench);
  }
  /// The felt force while `x` N is commanded for five milliseconds.
  double felt(VirtContext context, float x = 1, float torque = 0) const {
    for (int k = 0; k < 5; ++k) {
      force(context, x, torque);
      standin_.advance(kTick_s);
    }
    return standin_.state().felt[0];
  }
  const VirtuoseApi api_ = standinApi();
  const Steps steps_ = virtuoseSteps(VirtuoseSetup{});
};

TEST_F(VirtuoseRules, ourSetUpIsInTheVendorsOrderAndNothingIsRefused) {
  open();
  EXPECT_EQ(standin_.calls(),
            "virtOpen virtSetIndexingMode virtSetForceFactor virtSetSpeedFactor virtSetTimeStep "
            "virtSetBaseFrame virtSetObservationFrame virtSetCommandType virtSaturateTorque "
            "virtSetTimeoutValue virtSetForce virtSetPowerOn");
  ticks(100);
  device_.close();
  EXPECT_EQ(standin_.complaints(), "");
}

TEST_F(VirtuoseRules, aRuleViolationIsRefusedWithItsNumberAndUndone) {
  Steps cartesian = steps_;
  cartesian[placeOf(cartesian, "virtSetCommandType")].run = [](const VirtuoseApi& api, VirtContext vc) {
    return api.virtSetCommandType(vc, 2);
  };
  const struct {
    Steps steps;
    const char *command, *undo, *words;
    ErrorCode code;
  } rows[] = {
      {moved(steps_, "virtSetForceFactor", "virtSetCommandType"), "", "",
       "virtSetForceFactor(1) failed with error 19", ErrorCode::kFailed},
      {moved(steps_, "virtSetTimeStep", "virtSetCommandType"), "", "",
       "virtSetTimeStep(0.001 s) failed with error 19", ErrorCode::kFailed},
      {without(steps_, "virtSetCommandType"), "", "", "virtSetForce(zero) failed with error 17",
       ErrorCode::kFailed},
      {cartesian, "", "", "error 17", ErrorCode::kFailed},
      {steps_, "daemon 0", "daemon 1", "Virtuose at 127.0.0.1#53210: connecting failed with error 2",
       ErrorCode::kUnavailable},
      {steps_, "version wrong", "version right", "install the VirtuoseAPI", ErrorCode::kVersion},
  };
  for (const auto& row : rows) {
    SCOPED_TRACE(row.words);
    if (*row.command != 0) standin_.command(row.command);
    const auto context = openWith(row.steps);
    ASSERT_FALSE(context.ok());
    EXPECT_EQ(context.error().code, row.code);
    EXPECT_THAT(context.error().message, HasSubstr(row.words));
    EXPECT_EQ(standin_.state().open_contexts, 0);
    if (*row.undo != 0) standin_.command(row.undo);
  }
}

TEST_F(VirtuoseRules, values_theDeviceRefusesInvalidValuesAndWeSendNone) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  with(without(without(steps_, "virtSetCommandType"), "virtSetForce"), [&](VirtContext context) {
    const auto refused = [&](int result) { return result != 0 && api_.virtGetErrorCode(context) == 9; };
    float no_turn[7] = {};
    int pressed = 0;
    EXPECT_TRUE(refused(api_.virtSetTimeStep(context, 0.0005f)));
    EXPECT_TRUE(refused(api_.virtSetTimeStep(context, nan)));
    EXPECT_TRUE(refused(api_.virtSetForceFactor(context, 0)));
    EXPECT_TRUE(refused(api_.virtSetIndexingMode(context, 5)));
    EXPECT_TRUE(refused(api_.virtSetCommandType(context, 8)));
    EXPECT_TRUE(refused(api_.virtSetTimeoutValue(context, 0)));
    EXPECT_TRUE(refused(api_.virtSetBaseFrame(context, no_turn)));
    EXPECT_TRUE(refused(api_.virtGetButton(context, 4, &pressed)));
    ASSERT_EQ(api_.virtSetCommandType(context, kVirtImpedance), 0);
    EXPECT_TRUE(refused(force(context, nan)));
  });

  // A loop that is too fast or too slow is refused before the connection is opened.
  const auto calls = standin_.calls();
  for (const double rate : {1000.5, 2000.0, 40'000.0, 49.0, 0.0, -1.0, std::nan("")}) {
    const Status status = device_.open(rate);
    ASSERT_FALSE(status.ok()) << rate;
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(status.error().message, HasSubstr("[50, 1000]"));
    EXPECT_THAT(status.error().message, HasSubstr("--rate"));
  }
  EXPECT_EQ(standin_.calls(), calls);
  for (const double rate : {50.0, 333.0, 1000.0}) {
    EXPECT_TRUE(device_.open(rate).ok()) << rate;
    device_.close();
  }
}

TEST_F(VirtuoseRules, timeOut_aSilentLinkIsError6) {
  with(steps_, [&](VirtContext context) {
    standin_.command("link_down 0.1");
    float pose[7];
    EXPECT_NE(api_.virtGetPosition(context, pose), 0);
    EXPECT_EQ(api_.virtGetErrorCode(context), 6);
    standin_.advance(0.11);
    EXPECT_EQ(api_.virtGetPosition(context, pose), 0);  // after a short pause the next call succeeds
  });
}

TEST_F(VirtuoseRules, oneProgram_aSecondConnectionIsRefusedUntilTheFirstIsClosed) {
  VirtContext first = nullptr;
  with(steps_, [&](VirtContext context) {
    EXPECT_FALSE(openWith(steps_).ok());
    first = context;
  });
  with(steps_, [](VirtContext) {});
  float pose[7];
  EXPECT_NE(api_.virtGetPosition(first, pose), 0);  // using the old connection gives an error
  EXPECT_EQ(api_.virtGetErrorCode(first), 3);
}

TEST_F(VirtuoseRules, power_isOnlyPermittedByUsAndCompletedByTheUser) {
  // Without our permission there is no force, regardless of the user.
  with(without(steps_, "virtSetPowerOn"), [&](VirtContext context) { EXPECT_EQ(felt(context), 0); });
  with(steps_, [&](VirtContext context) {
    // The emergency stop also turns off the switch.
    for (const auto& [command, felt_N] : {std::pair{"switch 1", 1},
                                          {"switch 0", 0},
                                          {"switch 1", 1},
                                          {"dead_man 0", 0},
                                          {"dead_man 1", 1},
                                          {"estop press", 0},
                                          {"estop free", 0},
                                          {"switch 1", 1}}) {
      standin_.command(command);
      EXPECT_EQ(felt(context), felt_N) << command;
    }
  });
}

TEST_F(VirtuoseRules, watchdog_twoSecondsOfSilenceCutForceAndLink) {
  with(steps_, [&](VirtContext context) {
    force(context, 1);
    standin_.advance(1.9);
    EXPECT_EQ(standin_.state().felt[0], 1);  // until then the last force continues
    standin_.advance(0.2);
    EXPECT_EQ(standin_.state().felt[0], 0);
    EXPECT_NE(force(context, 1), 0);
    EXPECT_EQ(api_.virtGetErrorCode(context), 2);
  });
}

TEST_F(VirtuoseRules, watchdog_oursIsKeptAliveUntilTheLoopBegins) {
  open();
  // ten seconds of preparation: a zero force every half second
  const long before = standin_.state().exchanges;
  for (int k = 0; k < 100; ++k) {
    standin_.advance(0.1);
    world_.sleepForNs(100 * kMs);
  }
  EXPECT_EQ(standin_.state().exchanges - before, 20);
  EXPECT_EQ(device_.read(reading_), DeviceRead::kFresh);
  EXPECT_EQ(reading_.condition & kDeviceLost, 0u);
  // the loop has the connection: no other thread sends commands
  world_.sleepForNs(1'000 * kMs);
  EXPECT_EQ(standin_.state().exchanges - before, 20);
}

TEST_F(VirtuoseRules, rate_moreThanOneExchangeAMillisecondIsAnOverrun) {
  with(steps_, [&](VirtContext context) {
    for (int k = 0; k < 20; ++k) {  // a loop of 2 kHz
      force(context, 0);
      force(context, 0);
      standin_.advance(kTick_s);
    }
    unsigned alarm = 0;
    EXPECT_EQ(api_.virtGetAlarm(context, &alarm), 0);
    EXPECT_NE(alarm & kVirtAlarmOverrun, 0u);
  });
}

TEST_F(VirtuoseRules, rate_oursIsOneExchangeAMillisecondAlsoWithLateTicks) {
  open();
  ticks(100);
  for (int k = 0; k < 50; ++k) {  // every second tick is 0.9 ms late
    standin_.advance(0.0009);
    tick();
    device_.read(reading_);
    device_.write({});
    standin_.advance(0.0001);
  }
  EXPECT_EQ(standin_.state().overruns, 0);
  EXPECT_EQ(reading_.condition & kDeviceOverrun, 0u);
}

TEST_F(VirtuoseRules, saturation_theDeviceEnforcesAndReportsOurLimits) {
  // A backend that does not set its limits gets the motors' full force.
  with(without(steps_, "virtSaturateTorque"),
       [&](VirtContext context) { EXPECT_NEAR(felt(context, 14, 1), 14, 1e-6); });
  with(steps_, [&](VirtContext context) {
    EXPECT_NEAR(felt(context, 14, 1), 10, 1e-6);
    EXPECT_NEAR(standin_.state().felt[4], 0.8, 1e-6);
    EXPECT_NE(standin_.state().alarms & kVirtAlarmSaturation, 0u);
  });

  // Ours never commands more: the gate has the same limits.
  open();
  double max_N = 0;
  for (int k = 0; k < 300; ++k) {
    tick({{0, 50, 0}, {0, 2, 0}});  // one factor for both; the force exceeds its limit by more
    ASSERT_EQ(standin_.state().alarms & kVirtAlarmSaturation, 0u) << k;
    max_N = std::max(max_N, standin_.state().felt[1]);
  }
  EXPECT_GT(max_N, 9.5);  // before the thermal budget reduces it
}

TEST_F(VirtuoseRules, heat_aLastingForceOverheatsAndOursStaysBelow) {
  with(steps_, [&](VirtContext context) {
    double hot_after_s = 0;
    for (int k = 0; k < 10'000 && hot_after_s == 0; ++k) {
      force(context, 8);
      standin_.advance(kTick_s);
      if ((standin_.state().alarms & kVirtAlarmOverheat) != 0) hot_after_s = k * kTick_s;
    }
    // mean square over 10 s: 64 (1 − exp(−t/10)) = 3.9²
    EXPECT_NEAR(hot_after_s, -10 * std::log(1 - 3.9 * 3.9 / 64), 0.01);
  });
  standin_.advance(30);
  ASSERT_EQ(standin_.state().alarms, 0u);
  standin_.command("let_go");  // no hand has to hold this load
  standin_.command("dead_man 1");
  open();
  for (int k = 0; k < 40'000; ++k) {
    // back and forth, so that the handle stays in place
    tick({{k / 20 % 2 == 0 ? 8.0 : -8.0, 0, 0}, {}});
    ASSERT_EQ(standin_.state().alarms & kVirtAlarmOverheat, 0u) << k;
    ASSERT_EQ(gate_.fault(), Fault::kNone) << k;
  }
}

TEST_F(VirtuoseRules, indexing_ourPositionIsTheHandlesOwn) {
  // the hand releases the sensor, moves 30 mm, and grips again
  const auto elsewhere = [&](const std::function<void()>& tick) {
    standin_.command("place 0 0 0 0 0 0 1");
    standin_.command("dead_man 0");
    standin_.command("hand 0.03 0 0 0 0 0 1 0.5");
    for (int k = 0; k < 1000; ++k) tick();
    standin_.command("dead_man 1");
  };
  Steps shifting = steps_;
  shifting[placeOf(shifting, "virtSetIndexingMode")].run = [](const VirtuoseApi& api, VirtContext vc) {
    return api.virtSetIndexingMode(vc, 0);
  };
  with(shifting, [&](VirtContext context) {
    elsewhere([&] { felt(context, 0); });
    float pose[7];
    ASSERT_EQ(api_.virtGetPosition(context, pose), 0);
    EXPECT_NEAR(pose[0], 0, 1e-4);  // a backend with indexing keeps its old position, so the patient moves
  });
  open();
  elsewhere([&] { tick(); });
  ticks(10);
  EXPECT_NEAR(reading_.X_WH.p.x, 0.03, 1e-3);
  EXPECT_NEAR(reading_.X_WH.p.x, standin_.state().position_m[0], 1e-5);
}

}  // namespace
}  // namespace needlelab::test
