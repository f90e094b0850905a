#include "client/sim/tools/closed_loop.h"

#include <gmock/gmock.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "client/device/hand/hand_options.h"
#include "client/device/hand/simulated_device.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

constexpr double kRate = 1000;

// A device with given readings.
class ScriptedDevice final : public Device {
 public:
  explicit ScriptedDevice(std::vector<Vec3> places) : places_(std::move(places)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double) override { return {}; }
  DeviceRead read(DeviceReading& reading) noexcept override {
    if (next_ == places_.size()) return DeviceRead::kFinished;
    reading.X_WH.p = places_[next_++];
    reading.X_WH.q = {1, 0, 0, 0};
    return DeviceRead::kFresh;
  }
  void write(const GuardedWrench& wrench) noexcept override { written.push_back(wrench.wrench()); }
  void close() noexcept override {}
  std::vector<Wrench> written;

 private:
  DeviceInfo info_;
  std::vector<Vec3> places_;
  std::size_t next_ = 0;
};

TEST(ClosedLoop, holdsStillInTissueWithinTheDevicesLimits) {
  const auto model = compile(test::allEffects(), kRate);
  ASSERT_TRUE(model.ok());
  SimulatedDeviceOptions options;
  options.hand.tremor_m = 0;
  PlanStyle style;
  style.hold_s = 15;
  SimulatedDevice device(options, insertionPlan({0, 0, 0}, {0.1, 0.05, -1}, 0.03, style));
  const auto ticks = runClosedLoop(*model, device, {}, 100'000);
  ASSERT_TRUE(ticks.ok()) << ticks.error().message;

  const DeviceLimits limits;
  double deepest = 0;
  for (const ChainTick& tick : *ticks) {
    ASSERT_LE(norm(tick.rendered_W.force_N), limits.peak_force_N);
    ASSERT_LE(norm(tick.rendered_W.torque_Nm), limits.peak_torque_Nm);
    ASSERT_EQ(tick.fault, Fault::kNone);
    deepest = std::max(deepest, tick.report.insertion_m);
  }
  EXPECT_GT(deepest, 0.02);
  // the last second of the hold: rest 0.5 s, 50 mm at 20/0.85 mm/s, 15 s; the force is steady
  const auto in_hold = static_cast<std::size_t>((0.5 + 0.05 / 0.02 / 0.85 + 14) * kRate);
  double least = 1e9, greatest = -1e9;
  for (std::size_t k = in_hold; k < in_hold + 900; ++k) {
    ASSERT_EQ((*ticks)[k].report.phase, Phase::kStopped);
    least = std::min(least, (*ticks)[k].report.wrench_W.force_N.z);
    greatest = std::max(greatest, (*ticks)[k].report.wrench_W.force_N.z);
  }
  EXPECT_LT(greatest - least, 0.02);
  // at the end outside and free
  EXPECT_EQ(ticks->back().report.phase, Phase::kFree);
  EXPECT_EQ(ticks->back().rendered_W.force_N, Vec3{});
}

// the behaviour of `--device simulated` without further options
TEST(ClosedLoop, theCommandLinesHandReachesItsTargetThroughFirmTissue) {
  const auto profile = loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / "shoulder-muscular.json");
  const auto spec = sceneSpecOf(*profile);
  const auto model = compile(*spec, kRate);
  ASSERT_TRUE(model.ok());
  const auto& target = profile->targets(0);
  const Vec3 center{target.center_m().x(), target.center_m().y(), target.center_m().z()};
  SimulatedDeviceOptions options;
  CLI::App app;
  addHandOptions(app, options.hand);
  SimulatedDevice device(options, *choosePlan(options.hand, *spec, {{target.name(), center}}));
  const auto ticks = runClosedLoop(*model, device, {}, 100'000);
  ASSERT_TRUE(ticks.ok()) << ticks.error().message;
  double time_there_s = 0, plunger_there = 0;
  for (const ChainTick& tick : *ticks) {
    if (norm(tick.X_WT.p - center) > target.radius_m()) continue;
    time_there_s += 1 / kRate;
    plunger_there = std::max(plunger_there, tick.plunger);
  }
  EXPECT_GT(time_there_s, 1.5);
  EXPECT_EQ(plunger_there, 1);
  EXPECT_EQ(ticks->back().report.phase, Phase::kFree);
}

TEST(ClosedLoop, sameSeedSameBits) {
  const auto model = compile(test::paperSixLayers(), kRate);
  const auto run = [&] {
    SimulatedDevice device({}, insertionPlan({0, 0, 0}, {0.1, 0, -1}, 0.03, {}));
    return *runClosedLoop(*model, device, {}, 4000);
  };
  const auto a = run(), b = run();
  ASSERT_EQ(a.size(), b.size());
  bool felt = false;
  for (std::size_t k = 0; k < a.size(); ++k) {
    ASSERT_EQ(a[k].X_WH, b[k].X_WH);
    ASSERT_EQ(a[k].rendered_W, b[k].rendered_W);
    felt = felt || a[k].rendered_W.force_N.z > 1;
  }
  EXPECT_TRUE(felt);
}

TEST(ClosedLoop, theHandFeelsTheWrenchAtTheHandle) {
  const auto model = compile(test::paperOneDof(), kRate);
  // the tip 0.1 m beside the handle, along x; down at 20 mm/s from 5 mm above the skin
  std::vector<Vec3> places;
  for (int k = 0; k < 1000; ++k) places.push_back({-0.1, 0, 0.005 - 2e-5 * k});
  ScriptedDevice device(places);
  const Pose X_HT{{0.1, 0, 0}, {}};
  const auto ticks = runClosedLoop(*model, device, X_HT, 10'000);
  ASSERT_TRUE(ticks.ok());
  ASSERT_EQ(device.written.size(), places.size());
  const ChainTick& last = ticks->back();
  EXPECT_NEAR(last.X_WT.p.x, 0, 1e-12);
  EXPECT_NEAR(last.report.wrench_W.force_N.z, 1, 1e-9);
  EXPECT_EQ(device.written.back(), last.rendered_W);
  // (0.1, 0, 0) × (0, 0, 1) = (0, −0.1, 0)
  EXPECT_NEAR(last.rendered_W.torque_Nm.y, -0.1, 1e-9);

  // a recording refers the torque to the tip
  const GestureSample sample = sampleOf(last, 999'000'000, 0, 0);
  EXPECT_EQ(sample.tick, 999u);
  EXPECT_EQ(sample.time_ns, 999'000'000);
  EXPECT_NEAR(sample.force_W_N[2], 1, 1e-9);
  for (const double torque : sample.torque_W_Nm) EXPECT_NEAR(torque, 0, 1e-12);
  EXPECT_EQ(sample.p_WT_m[2], last.X_WT.p.z);
  EXPECT_EQ(sample.q_WT[0], 1);
  EXPECT_EQ(sample.insertion_m, last.report.insertion_m);
  EXPECT_EQ(sample.wall_W_m[2], last.report.p_wall_W_m.z);
  EXPECT_EQ(sample.phase, static_cast<std::uint8_t>(Phase::kInserting));
  EXPECT_EQ(sample.layer, 0);
}

TEST(ClosedLoop, aJumpEndsTheRunWithItsReason) {
  const auto model = compile(test::paperOneDof(), kRate);
  std::vector<Vec3> places(300, Vec3{0, 0, 0.01});
  places.resize(600, Vec3{0, 0, -0.5});  // half a metre in one tick
  ScriptedDevice device(places);
  const auto ticks = runClosedLoop(*model, device, {}, 10'000);
  ASSERT_FALSE(ticks.ok());
  EXPECT_EQ(ticks.error().code, ErrorCode::kFailed);
  EXPECT_THAT(ticks.error().message, HasSubstr("jumped"));
}

TEST(ClosedLoop, endsAfterTheAskedTicks) {
  const auto model = compile(test::paperOneDof(), kRate);
  ScriptedDevice device(std::vector<Vec3>(100, Vec3{0, 0, 0.01}));
  EXPECT_EQ(runClosedLoop(*model, device, {}, 40)->size(), 40u);
}

}  // namespace
}  // namespace needlelab
