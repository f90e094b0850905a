// CUT_MEMORY (FORCE_MODEL.md, "Memory of the cut") by formula: forces along a cut, membranes with holes, the
// work of fracture, the ring of tracks, and the memory as part of the state.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/resume.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr EffectMask kCut = bitOf(Effect::kCutting), kPierce = bitOf(Effect::kPuncture),
                     kRemember = bitOf(Effect::kCutMemory);
constexpr double kCutShare = 0.307, kCutRadius_m = 0.001, kWallStiffness_N_per_m = 500;

SceneSpec remembering(SceneSpec scene, EffectMask effects) {
  scene.effects = effects | kRemember;
  const EffectEntry& memory = effectEntry(Effect::kCutMemory);
  memory.fields[0].of(scene) = kCutShare;
  memory.fields[1].of(scene) = kCutRadius_m;
  return scene;
}

/// One layer with a cutting force of 2 N: whole tissue is dragged 4 mm behind the tip, cut tissue 1.2 mm.
SceneSpec cutScene(EffectMask effects = kCut) {
  return remembering(oneLayer(2.0, 0.5, 0.0), effects);
}

/// Out of the tissue, sideways, and in again to this depth; returns the reports of the way in.
std::vector<StepReport> insertAgain(Probe& probe, double to_m, double aside_m = 0) {
  probe.go(300, -0.001);
  probe.at(-0.001, aside_m);
  return probe.go(static_cast<int>(std::lround((to_m + 0.001) / 2e-5)), to_m, aside_m);
}

double mostCutting(const std::vector<StepReport>& reports) {
  double max_N = 0;
  for (const StepReport& report : reports) max_N = std::max(max_N, -report.cutting_N);
  return max_N;
}

TEST(CutMemory, recuttingATrackCostsItsShareAndFreshTissueTheWhole) {
  Probe probe(cutScene(), 1000);
  probe.at(-0.001);
  for (const StepReport& report : probe.go(1050, 0.020))
    ASSERT_NEAR(report.cutting_N, -std::min(500 * std::max(0.0, report.depth_m), 2.0), 1e-9);
  // the wall, and with it the cut, lags 4 mm behind the tip
  for (const StepReport& report : insertAgain(probe, 0.025)) {
    const double x = std::max(0.0, report.depth_m);
    const double stretch_m = std::min(std::max(std::min(x, kCutShare * 0.004), x - 0.016), 0.004);
    ASSERT_NEAR(report.cutting_N, -500 * stretch_m, 1e-9) << "at " << x;
    if (report.layer >= 0) {
      ASSERT_NEAR(report.p_wall_W_m.z, -(x - stretch_m), 1e-12) << "at " << x;
    }
  }
  EXPECT_NEAR(insertAgain(probe, 0.020).back().cutting_N, -kCutShare * 2.0, 1e-9) << "now it is cut to 21 mm";
}

// E ≥ 0, so w ≥ min(x − σ·Δ_cut, 0), also where the line's move has left the own track's end behind P0
TEST(CutMemory, aNeedleThatSlidesAsideUnderTheSkinFeelsNoMoreThanACutOrItsWay) {
  for (const double tilt_deg : {0.0, 30.0, 45.0, 60.0}) {
    Probe probe(cutScene(kAxial), 1000);
    probe.tilt(tilt_deg * kDegree);
    const double aside = std::tan(tilt_deg * kDegree);
    probe.at(-0.003, -0.003 * aside);
    probe.go(400, 0.004, 0.004 * aside);
    probe.go(200, 0.0003, 0.0003 * aside);
    for (const double to_m : {0.008, -0.004})
      for (const StepReport& report : probe.go(600, 0.0003, to_m))
        ASSERT_LE(-report.cutting_N,
                  std::max(kCutShare * 2.0, kWallStiffness_N_per_m * report.insertion_m) + 1e-9)
            << tilt_deg << " degrees, " << report.insertion_m << " m inserted";
  }
}

TEST(CutMemory, tissueIsCutOnceWithinAnInsertionToo) {
  Probe probe(cutScene(kAxial), 1000);
  probe.at(-0.001);
  probe.go(1050, 0.020);
  probe.go(600, 0.008);  // the attracted force has dragged the wall to 9 mm
  for (const StepReport& report : probe.go(800, 0.024)) {
    const double x = report.depth_m;
    const double stretch_m = std::min(std::max(std::min(x - 0.009, kCutShare * 0.004), x - 0.016), 0.004);
    ASSERT_NEAR(report.cutting_N + report.attracted_N, -500 * stretch_m, 1e-9) << "at " << x;
  }
}

TEST(CutMemory, aTremorDoesNotFallIntoItsOwnCut) {
  const Motion still = insertHoldWithdraw(1000, defaultSite(), {0, 0, -1}, {0, 0, -1}, 0.020, 0.02, 1.0);
  const Motion motion = withTremor(still, 1000, 1e-4, 3);
  EngineRun with(cutScene(kAxial), 1000), without(withEffects(cutScene(), kAxial), 1000);
  int compared = 0;
  for (const TipSample& sample : motion) {
    const StepReport a = with.step(sample), b = without.step(sample);
    if (b.phase == Phase::kWithdrawing && b.depth_m < 0.019) break;
    ASSERT_EQ(a.cutting_N, b.cutting_N);
    compared += b.layer >= 0 ? 1 : 0;
  }
  EXPECT_GT(compared, 1500);
}

TEST(CutMemory, isOneOfWidthNotOfDepth) {
  for (const double aside_m : {0.0, 0.9 * kCutRadius_m, 1.1 * kCutRadius_m, 0.005}) {
    Probe probe(cutScene(), 1000);
    probe.at(-0.001);
    probe.go(1050, 0.020);
    const double max_N = mostCutting(insertAgain(probe, 0.010, aside_m));
    EXPECT_NEAR(max_N, aside_m < kCutRadius_m ? kCutShare * 2.0 : 2.0, 1e-9) << aside_m;
  }
}

TEST(CutMemory, enteringAnOldCutFromTheSideReleasesOnce) {
  // so steep that the old cut is narrower than the wall's move: the wall stops at its other side
  for (const double slope : {0.7, 1.5}) {
    Probe probe(cutScene(), 1000);
    probe.at(-0.001);
    probe.go(1300, 0.025);
    probe.go(300, -0.001);
    // begins aside and meets the old cut 14 mm deep
    probe.tilt(std::atan(-slope));
    probe.at(-0.001, 0.015 * slope);
    int releases = 0;
    double before_N = 0;
    for (const StepReport& report : probe.go(1050, 0.020, -0.006 * slope)) {
      if ((report.flags & kFlagLayerChange) != 0) {
        ++releases;
        EXPECT_GT(report.cutting_N, before_N + 0.5);
        EXPECT_LE(std::hypot(report.p_wall_W_m.x, report.p_wall_W_m.y), kCutRadius_m + 1e-9);
      } else {
        ASSERT_GE(before_N - report.cutting_N, -0.03) << "no step without a flag";
      }
      before_N = report.cutting_N;
    }
    EXPECT_EQ(releases, 1) << slope;
    EXPECT_NEAR(probe.last().cutting_N, -2.0, 1e-9) << "on the other side the tissue is whole";
  }
}

// Azar and Hayward 2008: the difference to a second insertion at the same place is the work of fracture.
TEST(CutMemory, theFirstInsertionsWorkLessTheSecondsIsTheWorkOfFracture) {
  SceneSpec scene = remembering(oneLayer(2.0, 0.4, 0.0), kAxial | bitOf(Effect::kShaftFriction));
  scene.layers[0].friction_N_per_m = 18;
  EngineRun run(scene, 2000);
  const Motion once = insertHoldWithdraw(2000, defaultSite(), {0, 0, -1}, {0, 0, -1}, 0.020, 0.02, 0.0);
  const auto first = run.run(once), second = run.run(once), third = run.run(once);
  // the cut length is the wall's travel: 20 mm minus the 4 mm by which the tissue yields
  const double fracture_J = (1 - kCutShare) * 2.0 * (0.020 - 2.0 / kWallStiffness_N_per_m);
  EXPECT_NEAR(forceWork(once, second) - forceWork(once, first), fracture_J, 1e-6);
  EXPECT_NEAR(forceWork(once, third), forceWork(once, second), 1e-9) << "nothing more is cut";
  for (std::size_t k = 0; k < once.size(); ++k) ASSERT_EQ(first[k].friction_N, second[k].friction_N);
}

TEST(CutMemory, aMembraneThatWasPiercedStaysOpenNearItsHole) {
  SceneSpec scene = oneLayer(1.0, 0, 0);
  scene.layers[0].membrane = MembraneSpec{200, 20'000, 0.6};
  scene = remembering(scene, kPierce);
  EngineRun run(scene, 2000);
  const Motion once = insertHoldWithdraw(2000, defaultSite(), {0, 0, -1}, {0, 0, -1}, 0.010, 0.02, 0.0);
  const auto first = run.run(once), second = run.run(once);
  for (const StepReport& report : second) {
    ASSERT_EQ(report.puncture_N, 0.0);
    ASSERT_EQ(norm(report.wrench_W.force_N), 0.0);
    ASSERT_FALSE(report.flags & kFlagRupture) << "nothing gives way that held";
  }
  // z from k1 z + k2 z² = 0.6 N; its work
  const double z = (-200 + std::sqrt(200.0 * 200 + 4 * 20'000 * 0.6)) / 40'000;
  EXPECT_NEAR(-forceWork(once, first), 100 * z * z + 20'000.0 / 3 * z * z * z, 1e-5);

  const auto beside = [&](double aside_m) {
    Motion moved = once;
    for (TipSample& sample : moved) sample.p_WT_m.x += aside_m;
    double max_N = 0;
    for (const StepReport& report : run.run(moved)) max_N = std::max(max_N, -report.puncture_N);
    return max_N;
  };
  EXPECT_EQ(beside(0.9 * kCutRadius_m), 0.0);
  EXPECT_GT(beside(-1.1 * kCutRadius_m), 0.58);
}

TEST(CutMemory, aDeeperMembraneIsOpenOnlyWhereTheTrackWentThroughIt) {
  SceneSpec scene = oneLayer(0, 0, 0);
  scene.layers.push_back(scene.layers[0]);
  scene.layers[0].thickness_m = 0.010;
  scene.layers[0].membrane = scene.layers[1].membrane = MembraneSpec{400, 0, 0.4};
  Probe probe(remembering(scene, kPierce), 1000);
  probe.at(-0.001);
  probe.go(300, 0.005);  // only through the first one
  double max_N = 0;
  for (const StepReport& report : insertAgain(probe, 0.015)) {
    if (report.depth_m < 0.010) {
      ASSERT_EQ(report.puncture_N, 0.0);
    }
    max_N = std::max(max_N, -report.puncture_N);
  }
  EXPECT_NEAR(max_N, 0.4, 0.01);
  for (const StepReport& report : insertAgain(probe, 0.015)) ASSERT_EQ(report.puncture_N, 0.0);
}

TEST(CutMemory, aMembraneThatHoldsAndMeetsAHoleIsARelease) {
  SceneSpec scene = oneLayer(2.0, 0, 0);
  scene.layers[0].membrane = MembraneSpec{200, 0, 2};
  scene.layers[0].friction_N_per_m = 30;
  const auto model = std::make_unique<SceneModel>(
      compiled(remembering(scene, kCut | kPierce | bitOf(Effect::kShaftFriction)), 1000));
  const auto state = std::make_unique<SimState>();
  StepReport report;
  const auto stepTo = [&](double depth_m) {
    step(*model, {{0, 0, -depth_m}, pointing({0, 0, -1})}, *state, report);
    return report;
  };
  stepTo(-0.001);
  for (int i = 1; i <= 200; ++i) stepTo(2e-5 * i);
  ASSERT_NEAR(report.puncture_N, -0.8, 1e-9) << "it is tented by 4 mm";
  // as if u had turned and now led through an old hole
  state->cuts.tracks[0] = {{0.0005, 0, 0}, {0, 0, -1}, 0.001, 1};
  state->cuts.count = state->cuts.next = 1;
  const StepReport open = stepTo(0.004);
  EXPECT_EQ(open.puncture_N, 0.0);
  EXPECT_TRUE(open.flags & kFlagRupture);
  EXPECT_NEAR(open.cutting_N + open.friction_N, 0, 1e-9) << "nothing was cut or rubbed behind the membrane";
  EXPECT_NEAR(norm(open.wrench_W.force_N), 0, 1e-9);
  const StepReport after = stepTo(0.004);
  EXPECT_FALSE(after.flags & kFlagRupture) << "once";
  EXPECT_NEAR(norm(after.wrench_W.force_N), 0, 1e-9) << "both walls have followed the tip";
}

TEST(CutMemory, aRuptureNextToAnOldHoleMakesItsOwnHole) {
  SceneSpec scene = oneLayer(0, 0, 0);
  scene.layers[0].membrane = MembraneSpec{200, 0, 0.4};
  Probe probe(remembering(scene, kPierce), 1000);
  const auto mostAt = [&](double aside_m) {
    probe.go(300, -0.001, aside_m);
    double max_N = 0;
    for (const StepReport& report : probe.go(500, 0.006, aside_m))
      max_N = std::max(max_N, -report.puncture_N);
    probe.go(300, -0.001, aside_m);
    return max_N;
  };
  EXPECT_GT(mostAt(0), 0.38);
  EXPECT_EQ(mostAt(0), 0);
  EXPECT_GT(mostAt(0.004), 0.38);
  EXPECT_EQ(mostAt(0.004), 0);
}

// a replay: the recorded membrane holds where the rounded position would rupture it
TEST(CutMemory, remembersNoRuptureThatTheStationDidNotSee) {
  SceneSpec scene = oneLayer(0, 0, 0);
  scene.layers[0].membrane = MembraneSpec{200, 0, 0.4};
  const SceneModel model = compiled(remembering(scene, kPierce), 1000);
  const Quat inward = pointing({0, 0, -1});
  SimState state;
  StepReport report;
  for (int i = -10; i <= 190; ++i) step(model, {{0, 0, -1e-5 * i}, inward}, state, report);
  StoredTick stored;
  stored.layer = 0;
  stored.phase = Phase::kInserting;
  stored.p_wall_W_m.x = std::nan("");
  for (int i = 0; i < 5; ++i) {
    stepAsStored(model, {{0, 0, -2.0005e-3}, inward}, stored, state, report);
    ASSERT_NEAR(report.puncture_N, -0.4001, 1e-9) << i;
    ASSERT_EQ(report.flags & kFlagRupture, 0u) << i;
  }
  stored.flags = kFlagRupture;
  stepAsStored(model, {{0, 0, -2.0005e-3}, inward}, stored, state, report);
  EXPECT_EQ(report.puncture_N, 0);
}

TEST(CutMemory, actsWithTheWallsOfATableToo) {
  for (const AxialModel model :
       {AxialModel::kTrackingWall, AxialModel::kStatistical, AxialModel::kPrecomputed}) {
    SceneSpec scene = cutScene();
    scene.axial_model = model;
    scene.statistical.table = {{0, 2.0, 0}};
    scene.precomputed.table = {{0, 2.0, 0}};
    Probe probe(scene, 1000);
    probe.at(-0.001);
    probe.go(1050, 0.020);
    EXPECT_NEAR(probe.last().cutting_N, -2.0, 1e-9) << axialModelName(model);
    EXPECT_NEAR(insertAgain(probe, 0.016).back().cutting_N, -kCutShare * 2.0, 1e-9) << axialModelName(model);
  }
}

TEST(CutMemory, withoutAWallThatCutsOnlyMembranesAreRemembered) {
  for (const AxialModel model : {AxialModel::kDirect, AxialModel::kVoigt, AxialModel::kGodObject}) {
    SceneSpec scene = remembering(oneLayer(1.0, 0, 0), kCut | kPierce);
    scene.axial_model = model;
    EXPECT_FALSE(compiled(scene, 1000).isLive(Effect::kCutMemory)) << axialModelName(model);
    scene.layers[0].membrane = MembraneSpec{200, 0, 0.2};
    Probe probe(scene, 1000);
    EXPECT_TRUE(probe.model().isLive(Effect::kCutMemory)) << axialModelName(model);
    probe.at(-0.001);
    const double first_N = mostCutting(probe.go(550, 0.010));
    const auto again = insertAgain(probe, 0.010);
    EXPECT_NEAR(mostCutting(again), first_N, 1e-9) << axialModelName(model);
    for (const StepReport& report : again) ASSERT_EQ(report.puncture_N, 0.0) << axialModelName(model);
  }
}

TEST(CutMemory, keepsSixteenTracksAndForgetsTheOldest) {
  Probe probe(cutScene(), 1000);
  for (int hole = 0; hole <= static_cast<int>(kMaxCutTracks); ++hole) {
    probe.at(-0.001, 0.005 * hole);
    probe.go(500, 0.012, 0.005 * hole);
    probe.go(300, -0.001, 0.005 * hole);
  }
  EXPECT_EQ(probe.state().cuts.count, kMaxCutTracks);
  const auto costs = [&](int hole) {
    probe.at(-0.001, 0.005 * hole);
    return mostCutting(probe.go(500, 0.007, 0.005 * hole));
  };
  EXPECT_NEAR(costs(1), kCutShare * 2.0, 1e-9) << "the second one is the oldest now";
  EXPECT_NEAR(costs(16), kCutShare * 2.0, 1e-9);
  EXPECT_NEAR(costs(0), 2.0, 1e-9);
}

TEST(CutMemory, goingInAndOutOfOneHoleTakesOnePlace) {
  Probe probe(cutScene(), 1000);
  probe.at(-0.001);
  probe.go(1050, 0.020);
  for (int i = 0; i < 40; ++i) insertAgain(probe, 0.019);
  EXPECT_EQ(probe.state().cuts.count, 1u);

  // repeatedly to the same depth, where each stop lets the wall creep further: the track gets longer
  EngineRun run(remembering(allEffects(), kPlacedEffects), 1000);
  const Motion once = insertHoldWithdraw(1000, defaultSite(), {0, 0, -1}, {0, 0, -1}, 0.035, 0.03, 0.5);
  for (int i = 0; i < 40; ++i) run.run(once);
  EXPECT_EQ(run.state().cuts.count, 1u);
}

TEST(CutMemory, aTurnOfTheTrajectoryTakesTheTrackAlong) {
  SceneSpec scene = withClamping(allEffects(), ClampingMode::kConservative);
  scene.virtual_fixture.max_force_N = 0.5;
  scene = remembering(scene, kPlacedEffects);
  EngineRun run(scene, 1000);
  int turned = 0;
  double length_before_m = 0, shift_before_m = 0;
  for (const TipSample& sample : randomGesture(7, 1000, defaultSite())) {
    const bool was_own = run.state().inside && run.state().cuts.own != kMaxCutTracks;
    if (was_own) length_before_m = run.state().cuts.tracks[run.state().cuts.own].length_m;
    shift_before_m = run.state().x_shift_m;
    const Vec3 hole_W_m = run.state().p_hole_W_m;
    const StepReport report = run.step(sample);
    const CutMemory& cuts = run.state().cuts;
    if (report.layer < 0 || cuts.own == kMaxCutTracks || !(run.state().p_hole_W_m == hole_W_m)) continue;
    const CutTrack& own = cuts.tracks[cuts.own];
    if (was_own && (report.flags & kFlagEntry) == 0) {
      ASSERT_NEAR(own.length_m,
                  std::max(length_before_m + run.state().x_shift_m - shift_before_m, run.state().wall_m),
                  1e-12);
    }
    ASSERT_EQ(own.u_W, run.state().u_W);
    ASSERT_EQ(own.p_entry_W_m, run.state().p_entry_W_m);
    ASSERT_GE(own.length_m, run.state().wall_m - 1e-12);
    turned += (report.flags & kFlagTurn) != 0 ? 1 : 0;
  }
  EXPECT_GT(turned, 10);
}

TEST(CutMemory, aTurnDuringWithdrawalShiftsTheCutsEnd) {
  SceneSpec scene = withClamping(allEffects(), ClampingMode::kConservative);
  scene.virtual_fixture.max_force_N = 0.5;
  Probe probe(remembering(scene, kPlacedEffects), 1000);
  probe.at(-0.001);
  probe.go(1000, 0.030);
  probe.go(700, 0.015);
  const double length_m = probe.state().cuts.tracks[0].length_m, shift_m = probe.state().x_shift_m;
  ASSERT_GT(length_m, probe.state().wall_m + 0.005);
  probe.tilt(0.7);
  probe.go(500, 0.015, 0.012);
  const double moved_m = probe.state().x_shift_m - shift_m;
  ASSERT_GT(std::abs(moved_m), 1e-4) << "u has turned";
  EXPECT_NEAR(probe.state().cuts.tracks[0].length_m, length_m + moved_m, 1e-12);
}

TEST(CutMemory, outlivesAnExitAndNotTheState) {
  Probe probe(cutScene(), 1000);
  probe.at(-0.001);
  probe.go(1050, 0.020);
  probe.go(300, -0.001);
  EXPECT_EQ(probe.state().cuts.count, 1u);
  Probe other(cutScene(), 1000);  // a new lesson begins with a new state
  other.at(-0.001);
  EXPECT_NEAR(mostCutting(other.go(500, 0.010)), 2.0, 1e-9);
}

TEST(CutMemory, isPartOfTheStateAndOfItsHash) {
  const SceneSpec scene = remembering(allEffects(), kPlacedEffects);
  const auto model = std::make_unique<SceneModel>(compiled(scene, 1000));
  const auto state = std::make_unique<SimState>(), copy = std::make_unique<SimState>();
  const Motion motion = randomGesture(12, 1000, defaultSite());
  StepReport report, copied;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    step(*model, motion[k], *state, report);
    if (k == motion.size() / 2) *copy = *state;
    if (k <= motion.size() / 2) continue;
    step(*model, motion[k], *copy, copied);
    ASSERT_EQ(hashOf(*state), hashOf(*copy)) << k;
    ASSERT_EQ(report.wrench_W, copied.wrench_W) << k;
  }
  ASSERT_GT(state->cuts.count, 0u);
  const std::uint64_t whole = hashOf(*state);
  const auto changes = [&](auto change) {
    *copy = *state;
    change(copy->cuts);
    return hashOf(*copy) != whole;
  };
  EXPECT_TRUE(changes([](CutMemory& cuts) { cuts.count = 0; }));
  EXPECT_TRUE(changes([](CutMemory& cuts) { cuts.next = (cuts.next + 1) % 16; }));
  EXPECT_TRUE(changes([](CutMemory& cuts) { cuts.tracks[0].length_m += 1e-9; }));
  EXPECT_TRUE(changes([](CutMemory& cuts) { cuts.tracks[0].p_entry_W_m.x += 1e-9; }));
  EXPECT_TRUE(changes([](CutMemory& cuts) { cuts.tracks[0].u_W.y += 1e-9; }));
  EXPECT_TRUE(changes([](CutMemory& cuts) { cuts.tracks[0].membranes ^= 4u; }));
}

TEST(CutMemory, givesTheHandNothingAndUsesNoHeap) {
  GestureRange range;
  range.least_leg_s = 0.4;
  range.most_leg_s = 1.2;
  range.aside_m = 0.002;  // repeatedly into the same holes
  for (std::uint64_t seed = 1; seed <= (longForm() ? 500u : 20u); ++seed) {
    const SceneSpec scene =
        remembering(withClamping(allEffects(), ClampingMode::kConservative), kPlacedEffects);
    const auto model = std::make_unique<SceneModel>(compiled(scene, 2000));
    const auto state = std::make_unique<SimState>();
    const Motion motion = randomGesture(seed, 2000, defaultSite(), range);
    std::vector<StepReport> reports(motion.size());
    std::uint64_t calls = 0;
    {
      const NoAllocScope scope;
      for (std::size_t k = 0; k < motion.size(); ++k) step(*model, motion[k], *state, reports[k]);
      calls = scope.calls();
    }
    EXPECT_EQ(calls, 0u);
    EXPECT_LE(energyToHand(motion, reports), 5e-5) << seed;
    EXPECT_GT(state->cuts.count, 0u) << seed;
  }
}

TEST(CutMemory, numbersOutOfRangeAreNamed) {
  const auto refusal = [](double share, double radius_m) {
    SceneSpec scene = cutScene();
    effectEntry(Effect::kCutMemory).fields[0].of(scene) = share;
    effectEntry(Effect::kCutMemory).fields[1].of(scene) = radius_m;
    const Status status = validate(scene);
    return status.ok() ? std::string() : status.error().message;
  };
  EXPECT_EQ(refusal(0, 0.001), "");
  EXPECT_EQ(refusal(1, 0.01), "");
  EXPECT_EQ(refusal(1.01, 0.001), "cut_memory.cutting_share: 1.01 is out of range [0, 1]");
  EXPECT_EQ(refusal(0.3, 0), "cut_memory.radius_m: 0 is out of range (0, 0.01]");
  EXPECT_EQ(refusal(0.3, 0.011), "cut_memory.radius_m: 0.011 is out of range (0, 0.01]");
}

}  // namespace
}  // namespace needlelab::test
