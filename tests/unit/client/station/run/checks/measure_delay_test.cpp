#include "client/station/run/checks/measure_delay.h"

#include <gmock/gmock.h>

#include <csignal>

#include "client/device/hand/simulated_device.h"
#include "common/base/files/files.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/blocked_signals.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab {
namespace {

using test::BlockedSignals;
using test::FakeDevice;
using test::FakeTime;
using testing::HasSubstr;

/// A hand that holds the handle still, with its tremor.
SimulatedDevice held(std::uint32_t delay_ticks, double lag_s, double stiffness_N_per_m = 300) {
  SimulatedDeviceOptions options;
  options.hand.stiffness_N_per_m = stiffness_N_per_m;
  options.hand.tremor_m = 100e-6;
  options.delay_ticks = delay_ticks;
  options.lag_s = lag_s;
  HandPlan plan({{0.4, 0, 0}, {}});
  plan.hold(20);
  return {options, plan};
}

Result<DelayFit> measure(Device& device, double rate_hz = 1000) {
  const BlockedSignals blocked{SIGTERM};
  ImpatientClock clock;
  EXPECT_TRUE(device.open(rate_hz).ok());
  return measureDelay(device, clock, rate_hz, false, blocked.set(), [](double) {});
}

TEST(MeasureDelay, findsTheDelayAndLagOfASimulatedDevice) {
  for (const std::uint32_t ticks : {0u, 1u, 3u})
    for (const double lag_s : {0.0, 2e-3}) {
      SimulatedDevice device = held(ticks, lag_s);
      const auto fit = measure(device);
      ASSERT_TRUE(fit.ok()) << fit.error().message;
      EXPECT_NEAR(fit->total_s(), 1e-3 * ticks + lag_s, 0.5e-3) << ticks << " ticks, " << lag_s << " s";
    }
}

TEST(MeasureDelay, comparesTheMassWithTheDevicesOwn) {
  // moves like the 0.35 kg of a Virtuose, and says that it has 0.7
  class Heavier final : public Device {
   public:
    Heavier() { info_.limits.apparent_mass_kg = 0.7; }
    [[nodiscard]] const DeviceInfo& info() const override { return info_; }
    Status open(double rate_hz) override { return of_.open(rate_hz); }
    DeviceRead read(DeviceReading& reading) noexcept override { return of_.read(reading); }
    void write(const GuardedWrench& at_handle_W) noexcept override { of_.write(at_handle_W); }
    void close() noexcept override { of_.close(); }

   private:
    SimulatedDevice of_ = held(1, 0);
    DeviceInfo info_ = of_.info();
  } heavier;
  EXPECT_THAT(measure(heavier).error().message, HasSubstr("Right are 0.56 to 2.70 kg"));
}

TEST(MeasureDelay, neverPushesHarderThanHalfANewtonNorTurns) {
  double max_N = 0;
  FakeDevice device([](std::uint64_t, DeviceReading& reading) {
    reading.X_WH.p = {0.4, 0, 0};
    return DeviceRead::kFresh;
  });
  FakeTime clock;
  ProbeLoop loop(device, clock, 1000, std::vector<double>(1000, 7.0), {1, 0, 0});
  loop.run();
  for (const Wrench& wrench : device.writes) {
    max_N = std::max(max_N, norm(wrench.force_N));
    EXPECT_EQ(wrench.torque_Nm, Vec3{});
  }
  EXPECT_NEAR(max_N, kProbe_N, 0.02);
  EXPECT_LE(max_N, kProbe_N);
  EXPECT_EQ(device.writes.back(), Wrench{}) << "it ends without force";
}

TEST(MeasureDelay, missedTicksKeepForceAndPlace) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH.p = {0.4 + 1e-6 * static_cast<double>(tick), 0, 0};
    return DeviceRead::kFresh;
  });
  FakeTime clock;
  clock.late_ns[300] = 3'200'000;
  ProbeLoop loop(device, clock, 1000, std::vector<double>(500, 0.4), {1, 0, 0});
  loop.run();
  const auto response = loop.response();
  ASSERT_EQ(loop.stats().missed, 3u);
  for (std::size_t i = 300; i < 303; ++i) {
    EXPECT_EQ(response[i].force_N, response[299].force_N) << i;
    EXPECT_EQ(response[i].place_m, response[299].place_m) << i;
  }
  EXPECT_GT(response[303].place_m, response[299].place_m);
}

TEST(MeasureDelay, aReleasedDeviceIsAskedForAgain) {
  FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
    reading.X_WH.p = {0.4, 0, 0};
    reading.condition = tick == 2000 ? kDeviceReleased : 0u;
    return DeviceRead::kFresh;
  });
  const auto fit = measure(device);
  EXPECT_EQ(fit.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(fit.error().message, HasSubstr("hold the handle until the measurement ends"));
}

TEST(MeasureDelay, aTickOfTheProbeAllocatesNothing) {
  FakeDevice device([](std::uint64_t, DeviceReading& reading) {
    reading.X_WH.p = {0.4, 0, 0};
    return DeviceRead::kFresh;
  });
  FakeTime clock;
  ProbeLoop loop(device, clock, 1000, probeForce(1000, 2, 0.5), {1, 0, 0});
  const test::NoAllocScope guard;
  loop.run();
  EXPECT_EQ(guard.calls(), 0u);
}

class KeptDelay : public testing::Test {
 protected:
  StationOptions options(const std::string& device) {
    StationOptions o;
    o.spool = folder_.path();
    o.device = device;
    return o;
  }
  const DeviceInfo unknown_{"Virtuose", {}, true, true, true};
  test::TempFolder folder_;
};

TEST_F(KeptDelay, isThatOfTheDevicesOwnRow) {
  DelayFit fit;
  fit.delay_s = 2.25e-3, fit.lag_s = 1.5e-3;
  ASSERT_TRUE(keepDelay(delayFile(options("")), "virtuose:a", fit, 1).ok());
  fit.delay_s = 5e-3;
  ASSERT_TRUE(keepDelay(delayFile(options("")), "virtuose:b", fit, 2).ok());
  const auto a = loopDelayOf(options("virtuose:a"), unknown_),
             b = loopDelayOf(options("virtuose:b"), unknown_);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_DOUBLE_EQ(a->ticks, 2.25);
  EXPECT_DOUBLE_EQ(a->lag_s, 1.5e-3);
  EXPECT_DOUBLE_EQ(a->totalTicks(1000), 3.75);
  EXPECT_TRUE(a->is_known);
  EXPECT_DOUBLE_EQ(b->ticks, 5);
}

TEST_F(KeptDelay, isThatOfTheTableUnlessMeasuredOrKnownForTheDevice) {
  const auto assumed = loopDelayOf(options("falcon:0"), unknown_);
  ASSERT_TRUE(assumed.ok());
  EXPECT_EQ(assumed->ticks, 3);
  EXPECT_FALSE(assumed->is_known);
  DeviceInfo known = unknown_;
  known.delay_ticks = 1;
  EXPECT_EQ(loopDelayOf(options("simulated"), known)->ticks, 1);
  EXPECT_TRUE(loopDelayOf(options("simulated"), known)->is_known);
}

TEST_F(KeptDelay, ofADamagedFileIsRefusedWithWhatToDo) {
  const auto file = delayFile(options(""));
  ASSERT_TRUE(writeFileAtomically(file, viewOf(std::string("[1, 2"))).ok());
  EXPECT_THAT(loopDelayOf(options("falcon:0"), unknown_).error().message,
              HasSubstr("measure the delay again"));
  ASSERT_TRUE(
      writeFileAtomically(file, viewOf(std::string(R"({"falcon:0": {"delay_s": "x", "lag_s": 0}})"))).ok());
  EXPECT_THAT(loopDelayOf(options("falcon:0"), unknown_).error().message,
              testing::AllOf(HasSubstr("falcon:0.delay_s: must be a number"), HasSubstr("--measure-delay")));
}

}  // namespace
}  // namespace needlelab
