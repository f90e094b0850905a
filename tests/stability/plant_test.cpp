// Compares the plant of the hard cases with the station's device and chain.
#include "client/sim/stability/plant.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "client/sim/stability/case_file.h"
#include "client/sim/tools/closed_loop.h"
#include "tests/support/reference_source.h"

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

// the controls are variants of the reference: without a defect it gives the forces of the engine
TEST(Plant, theReferenceGivesTheEnginesForces) {
  const auto file = CaseFile::embedded();
  ASSERT_TRUE(file.ok());
  CaseEntry entry(*file, "hold_quantised");
  const SceneSpec scene = entry.scene();
  const PlantOptions options = entry.plant();
  const TimedPlan path = entry.path();
  const auto engine = engineSource()(scene, options.rate_hz),
             reference = test::referenceSource()(scene, options.rate_hz);
  ASSERT_TRUE(engine.ok() && reference.ok());
  const auto a = runPlant(**engine, path.plan, options), b = runPlant(**reference, path.plan, options);
  ASSERT_TRUE(a.ok() && b.ok());
  ASSERT_EQ(a->ticks.size(), b->ticks.size());
  for (std::size_t i = 0; i < a->ticks.size(); ++i)
    ASSERT_NEAR(a->ticks[i].report.wrench_W.force_N.z, b->ticks[i].report.wrench_W.force_N.z, 1e-9)
        << "tick " << i;
}

}  // namespace
}  // namespace needlelab
