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

TEST(Contact, theTrajectoryFollowsTheAxisAboveTenDegreesElseTheNormal) {
  for (const double degrees_over_surface : {90.0, 45.0, 10.5, 9.5, 0.0, -30.0, -90.0}) {
    EngineRun run(paperSixLayers(), 1000);
    const double a = degrees_over_surface * kDegree;
    const Vec3 axis{std::cos(a), 0, -std::sin(a)};
    run.step({{0, 0, 0.001}, pointing(axis)});
    run.step({{0, 0, -0.001}, pointing(axis)});
    const Vec3 expected = degrees_over_surface > 10 ? axis : Vec3{0, 0, -1};
    EXPECT_NEAR(norm(run.state().u_W - expected), 0, 1e-15) << degrees_over_surface;
    EXPECT_NEAR(run.state().slant, std::max(0.05, -expected.z * 1.0), 1e-15);
  }
}

TEST(Contact, flippedNeedleCutsAlongTheNormalWithFiniteForces) {
  EngineRun run(allEffects(), 1000);
  for (const auto& sample : insertHoldWithdraw(1000, defaultSite(), {0, 0, -1}, {0, 0, 1}, 0.03, 0.04, 0.3)) {
    const StepReport report = run.step(sample);
    ASSERT_TRUE(isFinite(report.wrench_W.force_N) && isFinite(report.wrench_W.torque_Nm));
    ASSERT_LE(norm(report.wrench_W.force_N), 10.0 + 1e-12);
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
  // 5° to the surface: u is the normal's, forces grow with depth only
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

TEST(Contact, insertedLengthIsTheLesserOfWayAndDepthOverSlant) {
  // Sphere of 20 mm: beyond its far side, the depth limits the inserted length.
  SceneSpec scene = paperOneDof();
  scene.limb = SphereLimb{{0, 0, 0}, 0.02};
  EngineRun run(scene, 1000);
  double greatest_step_N = 0, before_N = 0;
  bool out_again = false;
  for (int i = -10; i <= 450; ++i) {
    const double way = 1e-4 * i;
    const StepReport report = run.step({{0, 0, 0.02 - way}, pointing({0, 0, -1})});
    if (way > 0 && way < 0.04) {
      ASSERT_NEAR(report.depth_m, std::min(way, 0.04 - way), 1e-15);
      ASSERT_NEAR(report.insertion_m, std::min(way, 0.04 - way), 1e-15);
      ASSERT_NEAR(report.cutting_N, -std::min(1.0, 500 * way), 1e-9);
      greatest_step_N = std::max(greatest_step_N, std::abs(report.cutting_N - before_N));
      before_N = report.cutting_N;
    }
    out_again = out_again || (i > 0 && (report.flags & kFlagExit));
  }
  EXPECT_TRUE(out_again) << "through the far side";
  EXPECT_LE(greatest_step_N, 1.0 + 0.05);
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

TEST(Contact, aCopyOfTheStateGoesOnWithTheSameBits) {
  const Motion motion = randomGesture(12, 1000, defaultSite());
  EngineRun run(allEffects(), 1000);
  for (std::size_t k = 0; k < motion.size() / 2; ++k) run.step(motion[k]);
  SimState copy = run.state();
  for (std::size_t k = motion.size() / 2; k < motion.size(); ++k) {
    StepReport mine;
    step(run.model(), motion[k], copy, mine);
    ASSERT_EQ(run.step(motion[k]).wrench_W, mine.wrench_W);
    ASSERT_EQ(hashOf(run.state()), hashOf(copy));
  }
}

}  // namespace
}  // namespace needlelab::test
