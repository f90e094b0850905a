// Tests FEM as the engine's axial model: its own mesh, with contact, turns, membranes and limbs.
#include <gtest/gtest.h>

#include <cmath>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/scenes/motions.h"
#include "tests/unit/common/fem/soft_tissue.h"

namespace needlelab::test {
namespace {

// the six layers, clamped passively, with membranes; one mesh for all tests of this file. The tissue is so
// stiff that a needle soon cuts instead of only indenting the skin.
SceneSpec sixLayers(LimbKind limb = LimbKind::kPlane) {
  SceneSpec scene =
      likeForLike(withClamping(withLimb(allEffects(), limb), ClampingMode::kConservative), AxialModel::kFem);
  for (FemLayerSpec& layer : scene.fem.layers) layer.young_Pa = 200e3;
  static const std::shared_ptr<const NeedleCompliance> compliance =
      complianceOf(scene, 1000, kDefaultStations);
  scene.fem.nodes = 1000;
  scene.fem.compliance = compliance;
  return scene;
}

struct FemRun {
  std::vector<StepReport> reports;
  double energy_to_hand_J = 0;  ///< by the force, trapezoidal
  double worst_step_N = 0;      ///< change of axial force in a tick, in excess of the stiffest response
  std::uint32_t flags = 0, unsettled = 0;
  std::uint64_t hash = 0;
};

FemRun runThrough(const SceneSpec& scene, const Motion& motion, double rate_hz) {
  const auto model = compile(scene, rate_hz);
  if (!model.ok()) throw std::runtime_error(model.error().message);
  auto state = std::make_unique<SimState>();
  FemRun run;
  Vec3 force_before{}, p_before = motion.front().p_WT_m;
  double axial_before = 0;
  for (const TipSample& sample : motion) {
    StepReport report;
    step(*model, sample, *state, report);
    const Vec3 moved = sample.p_WT_m - p_before;
    run.energy_to_hand_J += 0.5 * dot(report.wrench_W.force_N + force_before, moved);
    const double axial = report.cutting_N + report.friction_N;
    if ((report.flags & (kFlagExit | kFlagEntry | kFlagLayerChange)) == 0)
      run.worst_step_N = std::max(
          run.worst_step_N, std::fabs(axial - axial_before) - model->axial_stiffness_N_per_m * norm(moved));
    run.flags |= report.flags;
    run.unsettled += state->needle.unsettled;
    run.reports.push_back(report);
    force_before = report.wrench_W.force_N;
    axial_before = axial;
    p_before = sample.p_WT_m;
  }
  run.hash = hashOf(*state);
  return run;
}

TEST(FemScene, isRefusedWithoutItsMesh) {
  SceneSpec scene = sixLayers();
  scene.fem.compliance = nullptr;
  EXPECT_TRUE(validate(scene).ok());  // a server does not need the mesh
  const auto model = compile(scene, 1000);
  ASSERT_FALSE(model.ok());
  EXPECT_NE(model.error().message.find("mesh was not computed"), std::string::npos);
  EXPECT_TRUE(addCompliance(scene).ok());
  EXPECT_TRUE(compile(scene, 1000).ok());
}

TEST(FemScene, refusesFrictionTwice) {
  SceneSpec scene = sixLayers();
  scene.effects |= bitOf(Effect::kShaftFriction);
  const Status status = validate(scene);
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.error().message.find("SHAFT_FRICTION"), std::string::npos);
}

TEST(FemScene, straightInsertionIsHeldBackAndWithdrawalIsPulledIn) {
  SceneSpec scene = sixLayers();
  scene.effects = bitOf(Effect::kCutting);
  const Site site = defaultSite();
  const Motion motion = insertHoldWithdraw(1000, site, site.inward, site.inward, 0.03, 0.05, 0.1, 0.002);
  const FemRun run = runThrough(scene, motion, 1000);
  double most = 0, least = 0;
  for (const StepReport& report : run.reports) {
    const double along = dot(report.wrench_W.force_N, site.inward);
    EXPECT_NEAR(along, report.cutting_N + report.friction_N, 1e-12);
    EXPECT_LE(report.cutting_N, 0.0);
    most = std::max(most, along);
    least = std::min(least, along);
  }
  EXPECT_LT(least, -0.5);
  EXPECT_GT(most, 0.05);
  EXPECT_EQ(norm(run.reports.back().wrench_W.force_N), 0.0);
  EXPECT_EQ(run.unsettled, 0u);
  EXPECT_LE(run.worst_step_N, 0.01);
}

// The work of the cutting force on the way in between two depths.
double cuttingWork(const std::vector<StepReport>& reports, std::size_t from, std::size_t to, double min_m,
                   double max_m) {
  double work_J = 0;
  for (std::size_t k = from + 1; k < to; ++k) {
    const double moved_m = reports[k].depth_m - reports[k - 1].depth_m;
    if (moved_m > 0 && reports[k].depth_m > min_m && reports[k].depth_m <= max_m)
      work_J -= 0.5 * (reports[k].cutting_N + reports[k - 1].cutting_N) * moved_m;
  }
  return work_J;
}

// FEM cuts its tissue once: CUT_MEMORY along the needle, within one insertion. Where its tip does not press,
// cutting is free.
TEST(FemScene, cutTissueCostsLessOnReinsertionAsWithCutMemory) {
  SceneSpec scene = sixLayers();
  scene.effects = bitOf(Effect::kCutting);
  SceneSpec wall = scene;
  wall.axial_model = AxialModel::kEnhancedTrackingWall;
  wall.effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), wall);
  const Site site = defaultSite();
  const auto at = [&](double depth_m) { return site.p_surface_m + site.inward * depth_m; };
  MotionBuilder builder(1000, at(-0.002), site.inward);
  builder.slideTo(at(0.030), 0.05);
  const std::size_t first = builder.samples().size();
  builder.slideTo(at(0.006), 0.05);
  const std::size_t second = builder.samples().size();
  builder.slideTo(at(0.040), 0.05);
  const Motion motion = builder.take();
  for (const SceneSpec* const one : {&scene, &wall}) {
    const FemRun run = runThrough(*one, motion, 1000);
    const double whole_J = cuttingWork(run.reports, 0, first, 0.010, 0.020),
                 again_J = cuttingWork(run.reports, second, motion.size(), 0.010, 0.020);
    EXPECT_GT(whole_J, 5e-3) << axialModelName(one->axial_model);
    EXPECT_LT(again_J, 0.3 * whole_J) << axialModelName(one->axial_model);
    EXPECT_LT(run.reports.back().cutting_N, -0.9 * one->layers.back().cutting_force_N)
        << axialModelName(one->axial_model) << " cuts whole tissue again";
  }
}

TEST(FemScene, randomGesturesOnAllLimbsAreSteadyAndGiveNothing) {
  GestureRange range;
  range.least_leg_s = 0.4;
  range.most_leg_s = 1.2;
  range.legs = 3;
  range.most_hold_s = 0.4;
  std::uint32_t seen = 0;
  for (const LimbKind limb : kLimbKinds)
    for (std::uint64_t seed = 1; seed <= (longForm() ? 100u : 6u); ++seed) {
      SceneSpec scene = sixLayers(limb);
      scene.virtual_fixture.max_force_N = 0.5;  // so that u turns
      scene.effects &= ~bitOf(Effect::kOrientationLimit);
      const FemRun run = runThrough(scene, randomGesture(seed, 2000, siteOf(limb), range), 2000);
      seen |= run.flags;
      for (const StepReport& report : run.reports) ASSERT_TRUE(isFinite(report.wrench_W.force_N));
      EXPECT_LE(run.energy_to_hand_J, 5e-5) << limbName(limb) << " " << seed;
      EXPECT_LE(run.worst_step_N, 0.02) << limbName(limb) << " " << seed;
    }
  EXPECT_TRUE(seen & kFlagTurn);
  EXPECT_TRUE(seen & kFlagRupture);
}

TEST(FemScene, sameMotionGivesTheSameBitsAndNoHeapIsUsed) {
  const SceneSpec scene = sixLayers();
  const Motion motion = randomGesture(9, 1000, defaultSite());
  EXPECT_EQ(runThrough(scene, motion, 1000).hash, runThrough(scene, motion, 1000).hash);

  const auto model = compile(scene, 1000);
  ASSERT_TRUE(model.ok());
  const auto state = std::make_unique<SimState>();
  StepReport report;
  std::uint64_t calls = 0;
  {
    const NoAllocScope scope;
    for (const TipSample& sample : motion) step(*model, sample, *state, report);
    calls = scope.calls();
  }
  EXPECT_EQ(calls, 0u);
}

}  // namespace
}  // namespace needlelab::test
