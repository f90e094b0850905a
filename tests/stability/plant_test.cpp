// Compares the plant of the hard cases with the station's device and chain.
#include "client/sim/stability/loop/plant.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "client/sim/stability/case_file.h"
#include "client/sim/tools/closed_loop.h"

namespace needlelab {
namespace {

TEST(Plant, givesTheSameBitsAsTheStationsDeviceAndChain) {
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok()) << file.error().message;
  CaseEntry entry(*file, "hold_quantised");
  const SceneSpec scene = entry.scene();
  PlantOptions options = entry.plant();
  options.device.hand.tremor_m = 100e-6;
  const TimedPlan path = entry.path();
  ASSERT_TRUE(entry.status().ok()) << entry.status().error().message;
  for (const std::uint32_t delay : {0u, 1u, 3u}) {
    options.device.delay_ticks = delay;
    const auto source = engineSource()(scene, options.rate_hz);
    ASSERT_TRUE(source.ok());
    const auto run = runPlant(**source, path.plan, options);
    ASSERT_TRUE(run.ok()) << run.error().message;

    const auto model = compile(scene, options.rate_hz);
    ASSERT_TRUE(model.ok());
    SimulatedDevice device(options.device, path.plan);
    const auto chain = runClosedLoop(*model, device, {}, 100'000);
    ASSERT_TRUE(chain.ok());
    // the plan may end between two ticks
    ASSERT_NEAR(static_cast<double>(run->ticks.size()), static_cast<double>(chain->size()), 1);
    for (std::size_t i = 0; i < std::min(run->ticks.size(), chain->size()); ++i) {
      ASSERT_EQ(run->ticks[i].seen.p_WT_m.z, (*chain)[i].X_WT.p.z) << "tick " << i << ", delay " << delay;
      ASSERT_EQ(run->ticks[i].rendered_force_N.z, (*chain)[i].rendered_W.force_N.z) << "tick " << i;
    }
  }
}

// with a tool the handle is 0.13 m behind the tip: the wrench has the lever's torque, and the hand turns
TEST(Plant, givesTheSameBitsWithATool) {
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok()) << file.error().message;
  CaseEntry entry(*file, "lever_clamping");
  const SceneSpec scene = entry.scene();
  PlantOptions options = entry.plant();
  options.device.hand.tremor_m = 100e-6;
  ASSERT_TRUE(entry.status().ok()) << entry.status().error().message;
  const Pose X_HT = options.device.X_HT;
  ASSERT_NEAR(norm(X_HT.p), 0.131, 1e-3);
  const Quat down = orientationAlong({0, 0, -1});
  HandPlan plan(Pose{{0, 0, 0.005}, down});
  plan.hold(0.3).moveTo({{0.002, 0, -0.03}, down}, 0.02, Motion::kTrapezoid).hold(0.3);
  const auto source = engineSource()(scene, options.rate_hz);
  ASSERT_TRUE(source.ok());
  const auto run = runPlant(**source, plan, options);
  ASSERT_TRUE(run.ok()) << run.error().message;

  const auto model = compile(scene, options.rate_hz);
  ASSERT_TRUE(model.ok());
  SimulatedDevice device(options.device, plan);
  const auto chain = runClosedLoop(*model, device, X_HT, 100'000);
  ASSERT_TRUE(chain.ok());
  ASSERT_NEAR(static_cast<double>(run->ticks.size()), static_cast<double>(chain->size()), 1);
  double torque_Nm = 0;
  for (std::size_t i = 0; i < std::min(run->ticks.size(), chain->size()); ++i) {
    ASSERT_EQ(run->ticks[i].seen.p_WT_m, (*chain)[i].X_WT.p) << "tick " << i;
    ASSERT_EQ(run->ticks[i].rendered_force_N, (*chain)[i].rendered_W.force_N) << "tick " << i;
    torque_Nm = std::max(torque_Nm, norm((*chain)[i].rendered_W.torque_Nm));
  }
  EXPECT_GT(torque_Nm, 0.01);
}

// b/(T (½ + d)) over 500 N/m, with the hand's b and without it
TEST(LoopMargins, areTheoryOverTheStiffness) {
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok());
  CaseEntry entry(*file, "hold_quantised");
  const SceneSpec scene = entry.scene();
  PlantOptions options = entry.plant();
  const TimedPlan path = entry.path();
  for (const std::uint32_t delay : {0u, 1u, 3u}) {
    options.device.delay_ticks = delay;
    const auto source = engineSource()(scene, options.rate_hz);
    ASSERT_TRUE(source.ok());
    const auto run = runPlant(**source, path.plan, options);
    ASSERT_TRUE(run.ok());
    EXPECT_NEAR(run->margins.coupled, 3.5 / (1e-3 * (0.5 + delay)) / 500, 1e-9);
    EXPECT_NEAR(run->margins.passive, 0.5 / (1e-3 * (0.5 + delay)) / 500, 1e-9);
  }
}

// Without a hand all work goes into the device's losses and its motion, whatever the force: the hand gets
// nothing. A force that drags a resting hand gives it the energy that a spring takes up.
TEST(GripEnergy, isWhatTheHandGets) {
  class Push final : public ForceSource {
   public:
    void step(const TipSample&, StepReport& report) noexcept override { report.wrench_W.force_N = {0, 0, 1}; }
    [[nodiscard]] double axialStiffness_N_per_m() const noexcept override { return 0; }
  };
  HandPlan plan(Pose{{0, 0, 0.005}, orientationAlong({0, 0, -1})});
  plan.hold(1);
  PlantOptions options;
  options.device.limits.damping_Ns_per_m = 0.5;
  options.device.dry_friction_N = 0.05;
  options.device.hand.tremor_m = 0;
  Push push;
  const auto held = runPlant(push, plan, options);
  ASSERT_TRUE(held.ok());
  EXPECT_EQ(held->margins.passive, INFINITY) << "no stiffness";
  // 1 N minus dry friction over the spring's 300 N/m: f²/2K, plus the damper's part over its travel
  EXPECT_GT(held->grip_energy_J, 0.45 * 0.95 * 0.95 / 300);
  EXPECT_LT(held->grip_energy_J, 0.95 * 0.95 / 300);
  options.device.hand.release_s = 1e-6;
  const auto free = runPlant(push, plan, options);
  ASSERT_TRUE(free.ok());
  EXPECT_GT(free->ticks.back().energy_J, 0.1) << "it flies off";
  EXPECT_LT(free->grip_energy_J, 1e-3 * free->ticks.back().energy_J);
}

}  // namespace
}  // namespace needlelab
