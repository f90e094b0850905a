// Contact (FORCE_MODEL.md, "Contact"): entry point, direction, exit, starting inside, the three limb shapes,
// layers.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

TEST(Contact, entryPointIsWhereTheDepthIsZeroBetweenTwoTicks) {
  const SceneSpec scene = paperSixLayers();
  EngineRun run(scene, 1000);
  const Vec3 before{0.01, 0.02, 0.003}, after{0.014, 0.018, -0.001};
  run.step({before, pointing({0, 0, -1})});
  const StepReport report = run.step({after, pointing({0, 0, -1})});
  EXPECT_TRUE(report.flags & kFlagEntry);
  EXPECT_NEAR(norm(run.state().p_entry_W_m - Vec3{0.013, 0.0185, 0}), 0, 1e-16);
  EXPECT_EQ(report.phase, Phase::kInserting);
  EXPECT_EQ(report.layer, 0);
}

TEST(Contact, aPointOnTheSurfaceIsOutside) {
  Probe probe(paperOneDof(), 1000);
  probe.at(-0.001);
  EXPECT_EQ(probe.at(0).phase, Phase::kFree);
  EXPECT_TRUE(probe.at(1e-9).flags & kFlagEntry);
  EXPECT_TRUE(probe.at(0).flags & kFlagExit);
  EXPECT_EQ(probe.last().layer, -1);
}

TEST(Contact, exitResetsEverythingAndTheNextEntryStartsAfresh) {
  const SceneSpec scene = allEffects();
  Probe used(scene, 1000), fresh(scene, 1000);
  used.at(-0.001);
  used.go(300, 0.02);
  used.go(200, 0.01, 0.01);
  used.stay(300);
  used.go(200, -0.001, 0.01);
  EXPECT_EQ(used.last().wrench_W, Wrench{});
  for (const double value :
       {used.last().insertion_m, used.last().speed_mps, used.last().lateral_error_m, used.last().cutting_N,
        used.last().friction_N, used.last().clamping_N, used.last().clamping_stiffness_N_per_m})
    EXPECT_EQ(value, 0.0);
  EXPECT_TRUE(std::isnan(used.last().p_wall_W_m.x));
  used.at(-0.001);
  fresh.at(-0.001);
  const auto again = used.go(400, 0.025), first = fresh.go(400, 0.025);
  for (std::size_t k = 0; k < again.size(); ++k) ASSERT_EQ(again[k].wrench_W, first[k].wrench_W) << k;
}

TEST(Contact, startingInsideGivesNoForceUntilTheTipHasBeenOutside) {
  Probe probe(allEffects(), 1000);
  for (const auto& report : probe.go(300, 0.02, 0.01)) {
    ASSERT_EQ(report.wrench_W, Wrench{});
    ASSERT_EQ(report.phase, Phase::kFree);
    ASSERT_EQ(report.layer, -1);
    ASSERT_EQ((report.flags & kFlagStartedInside) != 0, report.depth_m > 0);
  }
  probe.go(300, -0.001);
  EXPECT_GT(norm(probe.go(300, 0.02).back().wrench_W.force_N), 0.5);
}

TEST(Contact, theTrajectoryFollowsTheAxisToEightyDegreesAndIsMirrored) {
  for (const double degrees_over_surface : {90.0, 45.0, 10.001, 9.999, 0.0, -9.999, -10.001, -30.0, -90.0}) {
    EngineRun run(withEffects(paperSixLayers(), kAxial), 1000);
    const double a = degrees_over_surface * kDegree;
    const Vec3 axis{std::cos(a), 0, -std::sin(a)};
    run.step({{0, 0, 0.001}, pointing(axis)});
    run.step({{0, 0, -0.001}, pointing(axis)});
    const double held = std::max(10.0, std::abs(degrees_over_surface)) * kDegree;
    const Vec3 expected{std::cos(held), 0, -std::sin(held)};
    EXPECT_NEAR(norm(run.state().u_W - expected), 0, 1e-15) << degrees_over_surface;
  }
}

TEST(Contact, slidingOnTheSurfaceWithoutGoingInIsFree) {
  Probe probe(allEffects(), 1000);
  probe.at(-1e-6);
  for (const auto& report : probe.go(500, -1e-6, 0.05)) {
    ASSERT_EQ(report.wrench_W, Wrench{});
    ASSERT_EQ(report.flags, 0u);
  }
}

TEST(Contact, grazingStaysSmallAndContinuous) {
  // 5° to the surface: u is the normal, and forces grow with depth only
  const Motion motion = grazing(1000, defaultSite(), std::tan(5 * kDegree), 0.03, 0.05);
  EngineRun run(allEffects(), 1000);
  StepReport before = run.step(motion.front());
  for (std::size_t k = 1; k < motion.size(); ++k) {
    const StepReport report = run.step(motion[k]);
    ASSERT_LE(norm(report.wrench_W.torque_Nm - before.wrench_W.torque_Nm), 0.005) << k;
    if (!(report.flags & (kFlagExit | kFlagRupture | kFlagLayerChange))) {
      ASSERT_LE(norm(report.wrench_W.force_N - before.wrench_W.force_N), 1400 * 5e-5 + 0.01) << k;
    }
    before = report;
  }
}

// right through a ball of 20 mm: the inserted part stays inside until the tip is back on the side of P0
TEST(Contact, theNeedleThroughTheLimbStaysInIt) {
  SceneSpec scene = withEffects(paperOneDof(), kPlacedEffects);
  scene.limb = SphereLimb{{0, 0, 0}, 0.02};
  scene.layers[0].friction_N_per_m = 20;
  scene.layers[0].lateral_stiffness_N_per_m2 = 5000;
  EngineRun run(scene, 1000);
  Vec3 before_N{};
  int exits = 0, entries = 0;
  const auto go = [&](Vec3 from, Vec3 to, int ticks) {
    StepReport last;
    for (int i = 1; i <= ticks; ++i) {
      const Vec3 p = from + (to - from) * (static_cast<double>(i) / ticks);
      last = run.step({p, pointing({0, 0, -1})});
      entries += (last.flags & kFlagEntry) != 0 ? 1 : 0;
      exits += (last.flags & kFlagExit) != 0 ? 1 : 0;
      const double step_N = norm(last.wrench_W.force_N - before_N);
      // beyond the far side the tip cuts nothing: the only release
      if ((last.flags & (kFlagExit | kFlagLayerChange)) == 0)
        EXPECT_LE(step_N, 900 * norm(to - from) / ticks);
      before_N = last.wrench_W.force_N;
    }
    return last;
  };
  const StepReport inside = go({0, 0, 0.021}, {0, 0, -0.0199}, 4090);
  EXPECT_NEAR(inside.insertion_m, 0.0399, 1e-12);
  EXPECT_NEAR(inside.cutting_N, -1.0, 1e-9);
  EXPECT_NEAR(inside.friction_N, -20 * 0.0399, 1e-9);
  const StepReport through = go({0, 0, -0.0199}, {0, 0, -0.03}, 1010);
  EXPECT_NEAR(through.depth_m, -0.01, 1e-12);
  EXPECT_NEAR(through.insertion_m, 0.05, 1e-12);
  EXPECT_EQ(through.cutting_N, 0.0);
  EXPECT_NEAR(through.friction_N, -20 * 0.04, 1e-9) << "of the length in the limb";
  EXPECT_EQ(through.layer, 0);
  const StepReport aside = go({0, 0, -0.03}, {0.005, 0, -0.03}, 500);
  EXPECT_GT(norm(aside.wrench_W.force_N), 0.3) << "it cannot be carried away";
  go({0.005, 0, -0.03}, {0, 0, -0.03}, 500);
  EXPECT_EQ(exits, 0);
  const StepReport back = go({0, 0, -0.03}, {0, 0, 0.0199}, 4990);
  EXPECT_NEAR(back.attracted_N, 500 * 1e-4, 1e-3) << "fades with the inserted length";
  go({0, 0, 0.0199}, {0, 0, 0.021}, 110);
  EXPECT_EQ(exits, 1);
  EXPECT_EQ(entries, 1);
}

TEST(Contact, depthOfEveryShape) {
  const Limb plane = PlaneLimb{{0, 0, 0.1}, {0, 0, 1}};
  EXPECT_NEAR(signedDepth(plane, {5, 6, 0.04}), 0.06, 1e-15);
  EXPECT_NEAR(signedDepth(plane, {5, 6, 0.14}), -0.04, 1e-15);
  const Limb sphere = SphereLimb{{1, 2, 3}, 0.5};
  EXPECT_NEAR(signedDepth(sphere, {1, 2, 3}), 0.5, 1e-15);
  EXPECT_NEAR(signedDepth(sphere, {1, 2.75, 3}), -0.25, 1e-15);
  const Limb capsule = CapsuleLimb{{0, 0, 0}, {0, 0, 0.2}, 0.05};
  EXPECT_NEAR(signedDepth(capsule, {0.03, 0.04, 0.1}), 0.0, 1e-15) << "beside the segment";
  EXPECT_NEAR(signedDepth(capsule, {0, 0, 0.26}), -0.01, 1e-15) << "beyond its end: a half sphere";
  EXPECT_NEAR(signedDepth(capsule, {0, 0, -0.02}), 0.03, 1e-15);
}

TEST(Contact, planeNormalsOfAnyLengthMeanTheSame) {
  SceneSpec one = allEffects(), two = allEffects();
  one.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  two.limb = PlaneLimb{{7, -3, 0}, {0, 0, 250}};
  EngineRun a(one, 1000), b(two, 1000);
  for (const auto& sample : randomGesture(3, 1000, defaultSite()))
    ASSERT_EQ(a.step(sample).wrench_W, b.step(sample).wrench_W);
}

TEST(Contact, capsuleNormalIsAwayFromItsSegment) {
  SceneSpec scene = paperOneDof();
  scene.limb = CapsuleLimb{{0, 0, 0}, {0.2, 0, 0}, 0.05};
  struct Case {
    Vec3 out;
    Vec3 at;
  };
  for (const auto& c : {Case{{0, 0, 1}, {0.1, 0, 0}}, Case{{0, 0.6, 0.8}, {0.03, 0, 0}},
                        Case{{1, 0, 0}, {0.2, 0, 0}}, Case{normalized(Vec3{-1, 0, 1}), {0, 0, 0}}}) {
    EngineRun run(scene, 1000);
    run.step({c.at + c.out * 0.052, pointing(-c.out)});
    run.step({c.at + c.out * 0.049, pointing(-c.out)});
    EXPECT_NEAR(norm(run.state().normal_W - c.out), 0, 1e-12);
    EXPECT_NEAR(norm(run.state().u_W + c.out), 0, 1e-12);
  }
}

TEST(Contact, layersAreHalfOpenAndTheLastHasNoEnd) {
  SceneSpec scene = withEffects(paperSixLayers(), kAxial);
  for (auto& layer : scene.layers) layer.thickness_m = 0.0078125;  // 2⁻⁷: boundaries without rounding
  Probe probe(scene, 1000);
  probe.at(-0.001);
  for (int i = 1; i < 6; ++i) {
    const double top = i * 0.0078125;
    EXPECT_EQ(probe.at(std::nextafter(top, 0)).layer, i - 1);
    EXPECT_EQ(probe.at(top).layer, i);
    EXPECT_TRUE(probe.last().flags & kFlagLayerChange);
    EXPECT_FALSE(probe.at(top).flags & kFlagLayerChange);
  }
  EXPECT_EQ(probe.at(0.9).layer, 5);
}

TEST(Contact, aSampleThatIsNotANumberIsNotStepped) {
  Probe probe(allEffects(), 1000), twin(allEffects(), 1000);
  for (Probe* p : {&probe, &twin}) {
    p->at(-0.001);
    p->go(200, 0.01);
  }
  EngineRun hostile(allEffects(), 1000);
  const double nan = std::nan("");
  const SimState before = probe.state();
  StepReport report;
  SimState state = before;
  for (const TipSample& bad :
       {TipSample{{nan, 0, 0}, {}}, TipSample{{0, 0, HUGE_VAL}, {}}, TipSample{{0, 0, 0}, {0, nan, 0, 1}}}) {
    step(probe.model(), bad, state, report);
    EXPECT_EQ(report.flags, kFlagNotStepped);
    EXPECT_EQ(report.wrench_W, Wrench{});
    EXPECT_EQ(hashOf(state), hashOf(before));
  }
}

}  // namespace
}  // namespace needlelab::test
