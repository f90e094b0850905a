/// Self-test and calibration of a Virtuose, with the stand-in for the vendor's library.

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "client/device/hand/simulated_device.h"
#include "client/device/virtuose/virtuose_device.h"
#include "client/station/run/checks/calibrate.h"
#include "client/station/run/checks/self_test.h"
#include "tests/support/time/device_world.h"
#include "tests/support/virtuose_standin/control.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

VirtuoseDevice standinDevice() {
  VirtuoseOptions options;
  options.library = kStandinLibrary;
  return VirtuoseDevice(options);
}

bool noForce(const StandinState& state) {
  for (const double value : state.commanded)
    if (value != 0) return false;
  return true;
}

/// The stand-in's time advances with the loop's ticks in a simulated world, and the test checks its last
/// command in each tick.
class StandinClock final : public TimeSource {
 public:
  explicit StandinClock(Standin& standin) : standin_(standin) {}
  std::int64_t nowNs() noexcept override { return world.nowNs(); }
  // the loop wakes: the world's time is already there
  void sleepUntilNs(std::int64_t due_ns) noexcept override {
    if (!noForce(standin_.state())) ++forces;
    standin_.advance(static_cast<double>(due_ns - standin_ns_) * 1e-9);
    standin_ns_ = due_ns;
  }
  DeviceWorld world;
  int forces = 0;

 private:
  Standin& standin_;
  std::int64_t standin_ns_ = world.nowNs();
};

DeviceFacts measure(
    Device& device, StandinClock& clock, double seconds,
    const std::function<void(const std::string&)>& log = [](const std::string&) {}) {
  DeviceTestSettings settings;
  settings.seconds = seconds;
  bool stopped = false;
  return measureDevice(device, clock, settings, noSignals(), log, stopped, clock.world, clock.world);
}

const Check& checkNamed(const std::vector<Check>& checks, const std::string& name) {
  for (const Check& check : checks)
    if (check.name == name) return check;
  throw std::out_of_range(name);
}

TEST(BringupVirtuose, selfTestFindsItWellAndGivesItNoForce) {
  Standin standin;
  auto device = standinDevice();
  StandinClock clock(standin);
  SelfTestFacts facts;
  facts.device = measure(device, clock, 0.5);
  EXPECT_EQ(facts.device.trouble, "");
  EXPECT_EQ(facts.device.loop.fresh, 500u) << "every tick of half a second";
  EXPECT_EQ(clock.forces, 0);
  const auto checks = judge(facts);
  EXPECT_EQ(checkNamed(checks, "condition").verdict, Verdict::kOk);
  EXPECT_EQ(checkNamed(checks, "pose").verdict, Verdict::kOk);
  EXPECT_EQ(checkNamed(checks, "force limits").found, "10 N peak, 3 N continuous, 1000 N/m at most");
  EXPECT_TRUE(noForce(standin.state()));
  EXPECT_EQ(standin.state().open_contexts, 0);
}

TEST(BringupVirtuose, selfTestReportsTheFault) {
  const struct {
    const char *command, *failed, *told, *words;
    std::size_t said;
  } rows[] = {{"estop press", "condition", "device says", "emergency stop", 1},
              {"daemon 0", "device", "device", "service", 0}};
  for (const auto& row : rows) {
    Standin standin;
    standin.command(row.command);
    auto device = standinDevice();
    StandinClock clock(standin);
    SelfTestFacts facts;
    std::vector<std::string> said;
    facts.device = measure(device, clock, 0.3, [&](const std::string& text) { said.push_back(text); });
    const auto checks = judge(facts);
    EXPECT_EQ(checkNamed(checks, row.failed).verdict, Verdict::kFailed);
    EXPECT_THAT(checkNamed(checks, row.told).found, HasSubstr(row.words));
    EXPECT_EQ(said.size(), row.said);
  }
}

// The stand-in's hand swings the handle about a point 135 mm away, slowly, because otherwise its spring would
// lag.
TEST(BringupVirtuose, calibrationFindsTheTipWithoutForce) {
  PivotMotion motion;
  motion.X_HT.p = {0.004, -0.003, 0.135};
  motion.p_WP_m = {0.05, 0.02, -0.1};
  motion.swing_period_s = 6;
  motion.swing_rad = 0.4;
  const PivotDevice hand(motion);
  const auto poseText = [&](double t_s) {
    const Pose X = hand.handleAt(t_s);
    return fmt::format("{:.8f} {:.8f} {:.8f} {:.8f} {:.8f} {:.8f} {:.8f}", X.p.x, X.p.y, X.p.z, X.q.x, X.q.y,
                       X.q.z, X.q.w);
  };
  std::string script = "0 place " + poseText(0) + "\n";
  for (int i = 0; i < 25 * 20; ++i)
    script += fmt::format("{:.3f} hand ", i * 0.05) + poseText(i * 0.05 + 0.05) + " 0.05\n";

  Standin standin;
  standin.script(script);
  auto device = standinDevice();
  ASSERT_TRUE(device.open(1000).ok());
  StandinClock clock(standin);
  CalibrationSettings settings;
  settings.settle_s = 1;
  settings.seconds = settings.enough_s = 20;
  settings.real_time = false;
  const auto found = calibrateTip(
      device, clock, settings, noSignals(), [](const auto&) {}, clock.world, clock.world);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_EQ(pivotTrouble(found->fit), "");
  EXPECT_LT(norm(found->fit.p_HT_m - motion.X_HT.p), 3e-4);
  EXPECT_EQ(clock.forces, 0);
  device.close();
}

}  // namespace
}  // namespace needlelab::test
